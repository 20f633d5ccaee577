# SPDX-License-Identifier: BSD-3-Clause
"""Claim: of independent renders bias and noise are told apart, with errors that hold."""

import json
import math

import numpy as np
import OpenEXR
import pytest

from airlight.errors import InputError
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.storage.exr import Image, write_exr
from airlight.validation.columns import plain
from airlight.validation.motion.blocks import parts_of_error
from airlight.validation.motion.judge import compare_frames
from airlight.validation.motion.noise import (
    Noise,
    compare_runs,
    detectable,
    measure_noise,
    run_paths,
)
from airlight.validation.scenes.loading import load_scene
from airlight.validation.statistics.estimate import Answer
from airlight.validation.statistics.samples import student

REFERENCE = np.linspace(0.5, 1.5, 24 * 32 * 3).reshape(24, 32, 3)
SIGMA = 0.2


def renders(seed: int, count: int, bias: float = 0.0, sigma: float = SIGMA) -> list[np.ndarray]:
    random = np.random.default_rng(seed)
    return [
        (1 + bias) * REFERENCE + sigma * random.normal(size=REFERENCE.shape) for _ in range(count)
    ]


@pytest.mark.claim("noise-white")
def test_white_noise_has_the_closed_form():
    runs, values = 16, REFERENCE.size
    found = measure_noise(REFERENCE, renders(1, runs), seconds=0.25)
    # The mean of s^2 over values has the relative deviation sqrt(2/(values (runs - 1))), 0.8 %.
    assert found.variance.value == pytest.approx(
        SIGMA**2, rel=4 * math.sqrt(2 / (values * (runs - 1)))
    )
    # Squares of noise that is not there: deviation sigma^2 sqrt(2/(N(N-1) P)).
    assert abs(found.squared_bias.value) < 4 * SIGMA**2 * math.sqrt(
        2 / (runs * (runs - 1) * values)
    )
    assert abs(found.bias.value) < 4 * SIGMA / math.sqrt(runs * values)
    assert found.root_bias is None or found.squared_bias.value > 0
    # 4/sqrt(N k/2 channels), k = 12 in the first ring
    np.testing.assert_allclose(found.spectrum, 1, atol=0.15)
    np.testing.assert_allclose(
        found.blur_gain, 1, atol=0.1
    )  # 768/(4 pi s^2) = 4 independent places of 16 runs, 3 channels
    # A Gaussian of deviation s averages 4 pi s^2 pixels; at s = 4 the scatter is 5 %.
    expected = SIGMA / np.sqrt(4 * np.pi * np.square((1.0, 2.0, 4.0)))
    np.testing.assert_allclose(found.blurred_rmse, expected, rtol=0.2)
    assert found.efficiency == pytest.approx(1 / (found.variance.value * 0.25))
    assert found.seconds_to[0.05] == pytest.approx(found.variance.value * 0.25 / 0.05**2, rel=0.02)
    assert found.largest_fraction < 0.01


def test_averages_of_noise_are_never_said_to_be_without_error():
    """Where a squared bias is estimated below zero, 64 averaged runs had an error of 0 %."""
    found = [measure_noise(REFERENCE, renders(seed, 4)) for seed in range(8)]
    assert any(each.squared_bias.value < -each.variance.value / 256 for each in found)
    for each in found:
        assert each.after(256) >= math.sqrt(each.variance.value / 256)


def test_noise_of_another_spectrum_is_told():
    random = np.random.default_rng(2)
    white = random.normal(size=(8, 24, 32, 3))
    blue = [REFERENCE + 0.1 * (each - np.roll(each, 1, axis=1)) for each in white]
    blotches = [
        REFERENCE + 0.1 * sum(np.roll(each, shift, axis=(0, 1)) for shift in range(4))
        for each in white
    ]
    # |1 - exp(-2 pi i f)|^2 is below 0.59 for f < 1/8, and depends on one frequency of two: 0.1 of its mean.
    assert measure_noise(REFERENCE, blue).low_fraction < 0.3
    assert measure_noise(REFERENCE, blotches).low_fraction > 1.5


def test_low_frequencies_are_those_of_eight_pixels_and_more():
    """Waves of 1/24 of the height three times and of the width once have 0.129 cycles a pixel."""
    random = np.random.default_rng(4)
    row, column = np.mgrid[:24, :32]
    phases = 2 * np.pi * (3 * row / 24 + column / 32 + random.random((6, 1, 1)))
    runs = [REFERENCE + 0.1 * np.cos(phase)[..., None] for phase in phases]
    assert measure_noise(REFERENCE, runs).low_fraction < 1e-6


def test_runs_that_share_little_noise_are_named():
    random = np.random.default_rng(6)
    noise = 1e-3 * random.normal(size=(4, *REFERENCE.shape))
    runs = [REFERENCE + each for each in (noise[0], noise[0] + noise[1], noise[2], noise[3])]
    assert measure_noise(REFERENCE, runs).correlated == ((0, 1),)


def test_a_run_of_less_noise_depends_on_no_other():
    """Four times the samples: the mean over runs had made it alike to the others."""
    runs = [*renders(7, 3), *renders(8, 1, sigma=0.5 * SIGMA), *renders(9, 1, sigma=3 * SIGMA)]
    assert measure_noise(REFERENCE, runs).correlated == ()


@pytest.mark.claim("noise-bias")
def test_a_bias_of_a_thousandth_is_found():
    """Of 1000 trials intervals hold it in 93 to 97 %; at its detectable size nine of ten
    find it, at zero one of 20.
    """
    reference, bias, sigma, trials = REFERENCE[:8, :8], 0.001, 0.0095, 1000
    scale = float(np.sqrt(reference.size)) * float(reference.mean())
    runs = next(count for count in range(4, 99) if detectable(count) * sigma / scale < bias)
    assert runs == 14
    random = np.random.default_rng(7)
    noise = sigma * random.normal(size=(trials, runs, *reference.shape))
    errors = noise.mean(axis=(2, 3, 4)) / reference.mean()  # of runs without a bias
    middle, half = np.array([student(each) for each in errors]).T
    intervals = [
        np.stack([own + middle - half, own + middle + half], axis=1) for own in (bias, 0.0)
    ]
    held = np.mean((intervals[0][:, 0] <= bias) & (bias <= intervals[0][:, 1]))
    found, false = (np.mean(np.prod(np.sign(ends), axis=1) > 0) for ends in intervals)
    assert 0.93 <= held <= 0.97  # 0.95 +- 0.007
    assert 0.87 <= found <= 0.93  # 0.9 +- 0.0095
    assert 0.03 <= false <= 0.07  # 0.05 +- 0.007
    one = measure_noise(reference, [(1 + bias) * reference + each for each in noise[0]])
    np.testing.assert_allclose(one.bias_ci, intervals[0][0], rtol=1e-9, atol=1e-12)
    assert one.runs == runs
    # by the deviation of 14 runs, +- 19 %
    assert one.detectable_bias == pytest.approx(bias, rel=0.8)


@pytest.mark.claim("noise-tails")
def test_a_heavy_tail_is_not_taken_for_a_bias():
    """Runs without a bias have too dark a mean while the brightest values are
    missing; skewed noise has none.
    """
    reference, runs, trials = np.ones((24, 32, 3)), 12, 40
    random = np.random.default_rng(11)

    def said(noise: np.ndarray) -> Noise:
        return measure_noise(reference, [each[..., None] * np.ones(3) for each in noise])

    power = 1.4  # of the tail: a mean of 1, no variance
    tails = (1 - 1 / power) * (1 - random.random((trials, runs, 24, 32))) ** (-1 / power)
    found = [said(each) for each in tails]
    # by Student; 0.27 of 400
    assert np.mean([np.prod(np.sign(each.bias_ci)) > 0 for each in found]) > 0.12
    assert np.mean([each.verdict.startswith("a bias") for each in found]) <= 0.05
    assert "cannot be told" in found[0].verdict
    # In skewed noise with a variance a bias of detectable size is found as often as
    # without a look at the tail.
    exponential = random.exponential(size=(trials, runs, 24, 32))
    bias = detectable(runs) / math.sqrt(768)
    skewed = [said(each) for each in exponential - bias]
    assert not any("cannot be told" in each.verdict for each in skewed)
    # 0.9 +- 0.047
    assert np.mean([each.verdict.startswith("a bias of -") for each in skewed]) > 0.75


@pytest.mark.claim("noise-bias")
@pytest.mark.parametrize("runs", [2, 5])
def test_the_squared_bias_is_unbiased(runs):
    """Its mean of 300 repeats is within three errors of the square that was
    injected, also from two runs.
    """
    reference, bias, sigma = REFERENCE[:4, :4], 0.05, 0.2
    random = np.random.default_rng(runs)
    noise = sigma * random.normal(size=(300, runs, *reference.shape))
    flat = ((bias * reference + noise) / reference.mean()).reshape(300, runs, -1)
    squares = [parts_of_error(each @ each.T / each.shape[1])[0].value for each in flat]
    own = bias**2 * float(np.mean(reference**2)) / float(reference.mean()) ** 2
    assert abs(np.mean(squares) - own) < 3 * np.std(squares) / math.sqrt(300)
    naive = np.mean(flat.mean(axis=1) ** 2)
    assert naive > 2 * own  # the noise of the mean is in it


def test_a_bias_of_changing_sign_shows_in_its_square():
    sign = np.where(np.arange(32) % 2, 0.1, -0.1)[:, None]
    found = measure_noise(REFERENCE, [run + sign for run in renders(3, 8)])
    assert found.bias_ci[0] < 0 < found.bias_ci[1]
    assert found.root_bias == pytest.approx(0.1, rel=0.05)
    assert math.isinf(found.seconds_to[0.05] or math.inf)


@pytest.mark.parametrize("off", [0.0, 0.003])
def test_an_error_of_the_reference_is_no_bias_of_the_runs(off):
    """Sixteen runs without a bias, and a reference with random errors: their square was said to be
    a bias of the runs. An error of its mean is one no more.
    """
    random = np.random.default_rng(12)
    own = 2e-3 * random.normal(size=REFERENCE.shape)
    reference, runs = (1 + off) * REFERENCE + own, renders(13, 16, sigma=0.01)
    assert measure_noise(reference, runs).verdict.startswith("a bias")
    known = off + 4e-3 / math.sqrt(own.size), math.hypot(off, 4e-3)
    found = measure_noise(reference, runs, off=known)
    assert found.verdict.startswith("no bias")
    assert found.bias_ci[1] - found.bias_ci[0] > 2 * known[0]
    assert found.detectable_bias > known[0]
    # A bias beyond that is found all the same.
    biased = measure_noise(reference, renders(13, 16, 0.02, 0.01), off=known)
    assert biased.verdict.startswith("a bias of +")
    assert biased.root_bias == pytest.approx(0.02 - off, rel=0.2)


@pytest.mark.parametrize(
    ("off", "words"),
    [
        (0.0, "no random numbers: all of its error is bias, +0.1 % in the mean"),
        (0.002, "no random numbers: no error beyond that of the reference"),
        (math.inf, "whether there is a bias cannot be told: the error of the reference is unknown"),
    ],
)
def test_an_error_of_the_reference_is_no_bias_of_a_single_run(off, words):
    assert measure_noise(REFERENCE, [1.001 * REFERENCE], off=(off, off)).verdict == words


def test_an_interval_of_a_single_run_has_the_error_of_the_mean_on_both_sides():
    found = measure_noise(REFERENCE, [1.001 * REFERENCE], off=(0.002, 0.003))
    assert found.bias_ci == pytest.approx((-0.001, 0.003))


def test_runs_that_differ_by_less_than_rounding_are_refused():
    """There was a division by their noise, which is zero."""
    for value in (-0.0, 1e-40):
        images = [0.1 * REFERENCE for _ in range(3)]
        for number, image in enumerate(images):
            image[0] = 0.0
            image[0, number] = value
        with pytest.raises(InputError, match="all are the same"):
            measure_noise(REFERENCE, images)


def test_only_the_sign_for_digits_has_a_meaning_in_names(tmp_path):
    """Brackets in a name stood for one of the letters in them: no file was found."""
    names = ["night [v2] 1.exr", "night [v2] 2.exr", "night v 1.exr", "night * 1.exr"]
    for name in names:
        (tmp_path / name).touch()
    assert [path.name for path in run_paths(tmp_path / "night [v2] #.exr")] == names[:2]
    with pytest.raises(InputError, match="1 files have such a name"):
        run_paths(tmp_path / "night * #.exr")


def test_a_part_of_a_frame_is_refused(tmp_path):
    """The pixels that such a file does not hold were black ones, a bias of all runs and frames."""
    window = [np.array(corner, np.int32) for corner in ((0, 0), (9, 11), (0, 0), (15, 11))]
    header = {"dataWindow": tuple(window[:2]), "displayWindow": tuple(window[2:])}
    for number in range(2):
        planes = {key: np.ones((12, 10), np.float32) for key in "RGB"}
        OpenEXR.File(header, planes).write(str(tmp_path / f"{number}.exr"))
    about = tmp_path / "frames.json"
    about.write_text(json.dumps({"first": 0, "frames": 2}))
    for compare, more in ((compare_runs, ()), (compare_frames, (about,))):
        with pytest.raises(InputError, match=r"0\.exr holds a part of its frame alone"):
            compare("open-fog", tmp_path / "#.exr", *more)


def test_runs_of_two_layers_are_refused(tmp_path):
    """All light of one file was judged as the airlight of the other."""
    write_exr(tmp_path / "0.exr", Image({"airlight": np.ones((12, 16, 3))}))
    write_exr(tmp_path / "1.exr", Image({"total": np.ones((12, 16, 3))}))
    with pytest.raises(InputError, match="has no layer 'airlight'"):
        compare_runs("open-fog", tmp_path / "#.exr")


def test_a_seed_used_twice_is_noticed(variant, tmp_path):
    """Eight files of four images are four runs: their squared bias, which is 0, would be
    far from it by its error.
    """
    exact = reference_image(load_scene("open-fog", (16, 12)).scene).airlight
    random = np.random.default_rng(116)
    images = [exact + 0.3 * exact.mean() * random.normal(size=exact.shape) for _ in range(4)]
    for run in range(8):
        write_exr(tmp_path / f"{run:04d}.exr", Image({"airlight": images[run // 2]}), finite=False)
    found = compare_runs("open-fog", tmp_path / "####.exr", pixel="centre")
    assert found.noise.runs == 4
    assert found.noise.squared_bias.exceeds(0.0) is not Answer.YES
    assert "0001.exr is 0000.exr" in found.notes[0]
    assert "4 of 8" in found.notes[0]


def test_a_run_without_a_finite_value_is_named(variant, tmp_path):
    exact = reference_image(load_scene("open-fog", (16, 12)).scene).airlight
    random = np.random.default_rng(5)
    for run in range(4):
        image = (
            np.nan * exact
            if run == 2
            else exact + 0.1 * exact.mean() * random.normal(size=exact.shape)
        )
        write_exr(tmp_path / f"{run}.exr", Image({"airlight": image}), finite=False)
    found = compare_runs("open-fog", tmp_path / "#.exr", pixel="centre")
    assert found.noise.runs == 3
    assert found.failures == ("no value is finite in 2.exr: left out",)
    for run in range(4):
        write_exr(tmp_path / f"{run}.exr", Image({"airlight": np.nan * exact}), finite=False)
    with pytest.raises(InputError, match="no run has a finite value"):
        compare_runs("open-fog", tmp_path / "#.exr", pixel="centre")


@pytest.mark.parametrize("made", ["independent", "history", "accumulated", "skewed"])
def test_runs_that_depend_on_one_another_have_no_average(made):
    """A history between runs, and averages that go on, correlate the noise of
    neighbours; skewed noise does not.
    """
    runs = renders(6, 8)
    if made == "history":
        for number in range(1, 8):
            runs[number] = 0.5 * (runs[number] + runs[number - 1])
    elif made == "accumulated":
        runs = [np.mean(runs[: number + 1], axis=0) for number in range(8)]
    elif made == "skewed":
        random = np.random.default_rng(8)
        runs = [REFERENCE * random.exponential(size=(24, 32, 1)) for _ in range(8)]
    found = measure_noise(REFERENCE, runs)
    dependent = made in ("history", "accumulated")
    assert bool(found.correlated) == dependent == math.isnan(found.after(64))
    assert ("runs are not independent" in found.verdict) == dependent
    if dependent:
        assert any(j == i + 1 for i, j in found.correlated)


def test_renders_of_a_scene_from_files(variant, tmp_path):
    exact = reference_image(load_scene("open-fog", (32, 24)).scene).airlight
    random = np.random.default_rng(4)
    for run in range(6):
        noisy = 1.02 * exact + 0.05 * exact.mean() * random.normal(size=exact.shape)
        write_exr(tmp_path / f"{run:02d}.exr", Image({"airlight": noisy}))
    (tmp_path / "times.json").write_text(json.dumps({"00.exr": {"ms": 5, "device": "a card"}}))
    found = compare_runs("open-fog", tmp_path / "##.exr", pixel="centre", margin=0.01)
    assert found.noise.verdict.startswith("a bias of +2")
    assert found.failures == ("the relative bias is not shown to be within +-0.01",)
    assert plain(found)["noise"]["seconds"] == 0.005
    assert any("on a card" in line for line in found.lines)
    with pytest.raises(InputError, match="0 files have such a name"):
        compare_runs("open-fog", tmp_path / "###.exr")
    with pytest.raises(InputError, match="all are the same"):
        measure_noise(REFERENCE, [REFERENCE, REFERENCE])


def test_a_margin_is_not_kept_by_an_interval_that_may_not_hold(variant, tmp_path):
    """One value has most of the variance: the verdict could not tell a bias, and the margin of
    100 % was kept.
    """
    exact = reference_image(load_scene("open-fog", (16, 12)).scene).airlight
    random = np.random.default_rng(9)
    for run in range(6):
        noisy = exact + 1e-3 * exact.mean() * random.normal(size=exact.shape)
        noisy[5, 5] += 3 * exact.mean() * (run == 2)
        write_exr(tmp_path / f"{run}.exr", Image({"airlight": noisy}))
    found = compare_runs("open-fog", tmp_path / "#.exr", pixel="centre", margin=1.0)
    assert "cannot be told" in found.noise.verdict
    assert max(map(abs, found.noise.bias_ci)) < 1.0
    assert found.failures == ("the relative bias is not shown to be within +-1",)


@pytest.mark.parametrize("margin", [0.0, -0.01, math.nan])
def test_a_margin_that_nothing_keeps_or_misses_is_refused(margin):
    for compare, about in ((compare_runs, ()), (compare_frames, ("frames.json",))):
        with pytest.raises(InputError, match="margin: got"):
            compare("open-fog", "#.exr", *about, margin=margin)
