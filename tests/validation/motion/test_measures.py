# SPDX-License-Identifier: BSD-3-Clause
"""Claim: flicker, lag and ghost of a sequence are those of signals that are known in
closed form, with true errors.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from airlight.validation.columns import plain
from airlight.validation.motion.judge import motion_verdict
from airlight.validation.motion.measures import Measures, Sequence, mean_measures, measure
from airlight.validation.statistics.estimate import Answer

FRAMES, HEIGHT, WIDTH = 40, 24, 32
WEIGHT = 0.1  # of the new frame in an exponential average


def moving_light() -> np.ndarray:
    """Return references, (frames, height, width, 3): a spot of light that circles on a
    dim ground, and jumps once.
    """
    row, column = np.mgrid[:HEIGHT, :WIDTH]
    turn = (
        2 * np.pi * np.arange(FRAMES)[:, None, None] / 30 + (np.arange(FRAMES) >= 25)[:, None, None]
    )
    square = (column - 16 - 9 * np.cos(turn)) ** 2 + (row - 12 - 6 * np.sin(turn)) ** 2
    return (0.2 + np.exp(-square / 30))[..., None] * np.array([1.0, 0.8, 0.6])


LIGHT = moving_light()
MEAN = LIGHT.mean()
CHANGE = math.sqrt(np.mean(np.diff(LIGHT, axis=0) ** 2)) / MEAN


def averaged(frames: np.ndarray, weight: float = WEIGHT) -> np.ndarray:
    shown = [frames[0]]
    for frame in frames[1:]:
        shown.append((1 - weight) * shown[-1] + weight * frame)
    return np.array(shown)


def noise(seed: int, sigma: float) -> np.ndarray:
    return sigma * MEAN * np.random.default_rng(seed).normal(size=LIGHT.shape)


def ghosted(fraction: float, age: int) -> np.ndarray:
    frames = LIGHT.copy()
    frames[age:] += fraction * np.maximum(LIGHT[:-age] - LIGHT[age:], 0)
    return frames


def measured(
    frames: np.ndarray, references: np.ndarray = LIGHT, resets: tuple[int, ...] = (0,)
) -> Measures:
    everywhere = np.ones(references.shape[1:3], dtype=bool)
    sequence = Sequence(
        len(frames), frames.__getitem__, references.__getitem__, lambda n: everywhere, resets
    )
    found = measure(sequence)
    assert found is not None
    return found


def test_exact_frames_have_no_error():
    found = measured(LIGHT.astype(np.float32).astype(np.float64))
    assert max(found.relative_rmse.value, found.flicker.value, abs(found.bias.value)) < 1e-7
    assert found.lag.gain.value == pytest.approx(1, abs=1e-6)
    assert abs(found.lag.lag.value) < 1e-6
    assert motion_verdict(found).kind == "exact"
    assert found.reference_change == pytest.approx(CHANGE, rel=1e-12)


def test_a_pop_of_frames_at_rest_has_its_frame():
    """The median change is 0: the only frame that was wrong was not named."""
    still = np.repeat(LIGHT[:1], 20, axis=0)
    frames = 1.01 * still
    frames[12:] *= 1.1
    found = measured(frames, still)
    assert (found.pop, found.pop_frame) == (None, 12)
    assert measured(1.01 * still, still).pop_frame is None


def test_a_common_factor_changes_nothing():
    frames = averaged(LIGHT) + noise(1, 0.1)
    one, other = (plain(measured(k * frames, k * LIGHT)) for k in (1.0, 128.0))
    assert other.pop("mean") == 128 * one.pop("mean")
    assert one == other


def test_the_order_of_channels_and_pixels_changes_nothing():
    """Cells and blocks of other pixels have other means, so of pixels in another
    order only plain sums stay.
    """
    frames = averaged(LIGHT) + noise(1, 0.1)
    places = np.random.default_rng(0).permutation(HEIGHT * WIDTH)
    shuffled = [
        each.reshape(FRAMES, -1, 3)[:, places].reshape(LIGHT.shape) for each in (frames, LIGHT)
    ]
    one, other, moved = (
        measured(frames),
        measured(frames[..., ::-1], LIGHT[..., ::-1]),
        measured(*shuffled),
    )
    # Sums for ghosts are of float32 numbers.
    for name, tolerance in {
        "lag": 1e-6,
        "ghost": 1e-6,
        "flicker_beside_lag": 1e-9,
        "relative_rmse": 1e-9,
    }.items():
        assert _told(other, name) == pytest.approx(_told(one, name), rel=tolerance)
    for name in ("relative_rmse", "bias", "flicker", "pop", "reference_change"):
        assert _told(moved, name) == pytest.approx(_told(one, name), rel=1e-9)


def _told(found: Measures, name: str) -> float:
    number = found.lag.lag if name == "lag" else getattr(found, name)
    return getattr(number, "value", number)


@pytest.mark.claim("sequence-lag")
def test_an_average_lags():
    """Weight a of a new frame: persistence 1 - a, lag (1 - a)/a, missing share exp(-n/tau)."""
    found = measured(averaged(LIGHT))
    assert found.lag.persistence.value == pytest.approx(0.9, abs=1e-6)
    assert found.lag.delay == 0
    assert found.lag.lag.value == pytest.approx(9, abs=1e-2)
    assert found.lag.time_constant.value == pytest.approx(-1 / math.log(0.9), abs=1e-2)
    assert found.flicker_beside_lag.value < 1e-6
    assert found.flicker.value == pytest.approx(
        math.sqrt(np.mean(np.diff(averaged(LIGHT) - LIGHT, axis=0) ** 2)) / MEAN
    )
    assert found.ghost.exceeds(0.0, 4.0) is Answer.YES
    assert motion_verdict(found).kind == "lag"


@pytest.mark.parametrize("sigma", [0.0, CHANGE])
@pytest.mark.parametrize("delay", [-1, 1, 2])
def test_frames_of_another_number_are_late(delay, sigma):
    places = np.clip(np.arange(FRAMES) - delay, 0, FRAMES - 1)
    found = measured(LIGHT[places] + noise(3, sigma))
    assert found.lag.delay == delay
    assert found.lag.delay_margin.exceeds(0.0, 4.0) is Answer.YES
    verdict = motion_verdict(found)
    assert verdict.kind == "late"
    # A delay that explains half of what a response does is none; one to the front needs no response.
    half = replace(found, lag=replace(found.lag, described=0.5))
    assert (motion_verdict(half).kind == "late") == (delay < 0)
    assert f"{'late' if delay > 0 else 'early'} by {abs(delay)} frame" in verdict.words


def test_a_factor_and_a_constant_are_no_lag():
    factor = measured(1.05 * LIGHT)
    assert factor.lag.gain.value == pytest.approx(1.05, abs=1e-9)
    assert factor.flicker.value == pytest.approx(0.05 * CHANGE)
    assert factor.bias.value == pytest.approx(0.05)
    constant = measured(LIGHT + 0.02 * MEAN)
    assert constant.lag.offset.value == pytest.approx(0.02, abs=1e-9)
    assert constant.relative_rmse.value == pytest.approx(0.02)
    for found in (factor, constant):
        assert abs(found.lag.lag.value) < 1e-6
        assert abs(found.ghost.value) < 1e-6
        assert motion_verdict(found).kind == "noise"


def test_light_of_one_age_is_a_ghost():
    found = measured(ghosted(0.3, 6))
    assert found.ghost.exceeds(0.0, 4.0) is Answer.YES
    assert found.lag.described < 0.9
    response = [each.value for each in found.lag.response]
    assert 1 + int(np.argmax(response[1:])) in (6, 7)
    assert motion_verdict(found).kind == "ghost"
    # A filter that explains half of what a response does is no lag.
    half = replace(averaged_measures(), described=0.5)
    assert motion_verdict(replace(measured(averaged(LIGHT)), lag=half)).kind != "lag"


def averaged_measures():
    """Return the lag of an average, of which all is explained."""
    found = measured(averaged(LIGHT))
    assert motion_verdict(found).kind == "lag"
    return found.lag


@pytest.mark.claim("sequence-lag")
def test_white_noise_has_the_closed_form():
    found = measured(LIGHT + noise(4, 0.2))
    values = LIGHT.size
    assert found.relative_rmse.value == pytest.approx(0.2, abs=4 * 0.2 / math.sqrt(2 * values))
    # Differences of neighbours share a frame: their mean square has 3/2 of the
    # variance of independent ones.
    assert found.flicker.value == pytest.approx(
        0.2 * math.sqrt(2), abs=4 * 0.2 * math.sqrt(1.5 / values)
    )
    for estimate in (found.bias, found.lag.lag, found.ghost, found.lag.offset):
        assert abs(estimate.value) < 4 * estimate.error
    assert motion_verdict(found).kind == "noise"


def test_without_a_change_of_the_reference_no_lag_is_told():
    """At rest an average of weight a leaves sqrt(a/(2 - a)) of the noise, which after a
    reset takes some frames.
    """
    still = np.broadcast_to(LIGHT[:1], LIGHT.shape)
    found = measured(averaged(still + noise(5, 0.1)), still)
    assert found.lag.lag.value is None
    assert found.ghost.value is None
    assert motion_verdict(found).kind == "cannot be told"
    floor = 0.1 * math.sqrt(WEIGHT / (2 - WEIGHT))
    # Over forty frames the mean variance after the reset exceeds the floor by the fraction
    # sum of 0.81^n/40 = 0.13.
    ratio = WEIGHT / (2 - WEIGHT)
    expected = floor * math.sqrt(np.mean([1 + 0.81**n * (1 / ratio - 1) for n in range(FRAMES)]))
    assert found.relative_rmse.value == pytest.approx(
        expected, rel=0.02
    )  # 92 000 values, of which 4800 are independent


def test_histories_begin_at_resets():
    """After a reset frames are the reference again; a sequence without a first
    one is told all the same.
    """
    frames = np.concatenate([averaged(LIGHT[:20]), averaged(LIGHT[20:])])
    found = measured(frames, resets=(0, 20))
    assert found.lag.persistence.value == pytest.approx(0.9, abs=1e-6)
    unknown_past = averaged(np.concatenate([3 * LIGHT[:1], LIGHT[1:]]), 0.5)
    late = measured(unknown_past, resets=())
    assert late.lag.persistence.value == pytest.approx(0.5, abs=1e-3)  # 0.5^16 of the past is left
    assert late.values == LIGHT[16:].size


@pytest.mark.parametrize("counts", [range(FRAMES), range(FRAMES - 2, FRAMES)])
def test_few_pixels_of_a_large_image_have_a_lag_where_it_can_be_told(counts):
    """A mask beside a lamp has few pixels, perhaps in the last frames alone."""
    light = np.tile(LIGHT[:, :, :, :1], (1, 10, 12, 1))[:, :240, :384] * np.ones(3)
    frames = averaged(light)
    beside, nowhere = np.zeros((2, 240, 384), dtype=bool)
    beside[4:6, 20:22] = True
    masks = [beside if n in counts else nowhere for n in range(FRAMES)]
    found = measure(Sequence(FRAMES, frames.__getitem__, light.__getitem__, masks.__getitem__))
    assert found.values == 12 * len(counts)
    told = found.lag.persistence.value
    assert told is None if len(counts) == 2 else told == pytest.approx(1 - WEIGHT, abs=1e-6)


def test_values_that_are_not_finite_are_counted_and_left_out():
    frames = LIGHT.copy()
    frames[3, 5, 6, 0], frames[4, 1, 1] = np.nan, np.inf
    found = measured(frames)
    assert found.nonfinite == 4
    assert found.relative_rmse.value == 0


@pytest.mark.parametrize(("factor", "kind"), [(1.0, "exact"), (2.0, "cannot be told")])
def test_light_in_one_block_has_no_errors_and_decides_nothing(factor, kind):
    """Without its block nothing is left: no number has an error, and frames twice
    too bright are not exact.
    """
    light = np.zeros_like(LIGHT)
    light[:, 8:16, 8:16] = LIGHT[:, 8:16, 8:16]
    found = measured(factor * light, light)
    for estimate in (
        found.relative_rmse,
        found.flicker,
        found.lag.gain,
        found.lag.persistence,
        found.ghost,
    ):
        assert estimate.error is None
    assert found.bias.value == pytest.approx(factor - 1)
    assert motion_verdict(found).kind == kind


def test_rounding_is_no_noise():
    """Frames twice too bright, with light in 9 x 9 pixels."""
    light = np.zeros_like(LIGHT)
    light[:, 8:17, 8:17] = LIGHT[:, 8:17, 8:17]
    assert (
        motion_verdict(measured(2 * light, light)).words
        == "no lag: no noise beyond rounding, and a factor of 2"
    )


def test_the_mean_of_runs_is_unknown_where_one_of_them_is():
    """The first run stood for all where another told nothing, and its values that are not
    finite for those of all.
    """
    still = np.broadcast_to(LIGHT[:1], LIGHT.shape).copy()
    broken = still.copy()
    broken[3, 2, 1] = np.nan
    runs = [measured(LIGHT + noise(1, 0.1)), measured(broken + noise(2, 0.1), still)]
    found = mean_measures(runs)
    assert (found.lag.lag.value, found.lag.delay, found.nonfinite) == (None, None, 3)
    assert motion_verdict(found).kind == "cannot be told"
    assert found.relative_rmse.value == pytest.approx(0.1, rel=0.01)
    # one seed twice: no spread, which is no error of 0
    assert mean_measures([runs[0], runs[0]]) == runs[0]


@pytest.mark.slow
@pytest.mark.claim("sequence-intervals")
def test_intervals_hold_the_reference():
    """Of 100 repeats 95 % intervals hold it in 90 to 99, and numbers scatter as their errors say.

    The interval of the bias is wider, as its frames need not be independent
    (`mean_of_series`): 1.3 times at 40 frames.
    """
    frames, held = ghosted(0.0, 6), np.zeros(5)
    scores = []
    for seed in range(100):
        found = measured(averaged(frames, 0.5) + noise(100 + seed, 0.2))
        # Half of a new frame: the mean age is a/(1 - a) = 1.
        lag = found.lag.lag
        apart = [lag.value - 1, found.lag.gain.value - 1, found.lag.persistence.value - 0.5]
        errors = [lag.error, found.lag.gain.error, found.lag.persistence.error]
        still = measured(LIGHT + noise(100 + seed, 0.2))
        apart += [still.ghost.value, still.bias.value]
        errors += [still.ghost.error, still.bias.error]
        scores.append(np.array(apart) / errors)
        held += np.abs(scores[-1]) < 1.98
    assert ((held >= 90) & (held <= (99, 99, 99, 99, 100))).all(), held
    spread = np.std(scores, axis=0) * (1, 1, 1, 1, 1.3)
    assert ((spread > 0.8) & (spread < 1.25)).all(), spread
