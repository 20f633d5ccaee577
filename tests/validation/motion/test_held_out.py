# SPDX-License-Identifier: BSD-3-Clause
"""Claim: sequences of another make give the values that made them, which faulty measures miss.

A lamp passes pillars before a wall, in images whose sides no block divides. The histories are those
of `scipy.signal.lfilter`, and the noise is gamma: positive and skewed, as that of samples of light.
"""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import t as student

from airlight.validation.motion.measures import Measures, Sequence, measure
from airlight.validation.statistics.estimate import Answer, Estimate
from airlight.validation.statistics.samples import mean_of_series

FRAMES, HEIGHT, WIDTH = 30, 29, 45
WEIGHT, SIGMA, FRACTION, AGE = 0.2, 0.08, 0.25, 4


def wall() -> np.ndarray:
    row, column = np.mgrid[:HEIGHT, :WIDTH]
    place = 4 + 37 * (0.5 - 0.5 * np.cos(2 * np.pi * np.arange(FRAMES) / 24))
    square = (column - place[:, None, None]) ** 2 + (row - 0.4 * HEIGHT) ** 2
    pillars = np.where((column // 5) % 3 == 0, 0.3, 1.0)
    return (0.05 + pillars * 9 / (square + 16))[..., None] * np.array([0.4, 0.9, 0.7])


LIGHT = wall()
MEAN = float(LIGHT.mean())


def history(frames: np.ndarray) -> np.ndarray:
    start = (1 - WEIGHT) * frames[:1]
    return lfilter([WEIGHT], [1, WEIGHT - 1], frames, axis=0, zi=start)[0]


def noise(seed: int, shape: tuple[int, ...] = LIGHT.shape) -> np.ndarray:
    random = np.random.Generator(np.random.Philox(seed))
    return SIGMA * MEAN * (random.gamma(4.0, 0.5, size=shape) - 2)  # of deviation one


def late(frames: np.ndarray, by: int) -> np.ndarray:
    return frames[np.maximum(np.arange(len(frames)) - by, 0)]


def left_behind() -> np.ndarray:
    return LIGHT + FRACTION * np.maximum(late(LIGHT, AGE) - LIGHT, 0)


MADE = {
    "history": history(LIGHT) + noise(1),
    "late history": late(history(LIGHT), 1),
    "noise": 0.97 * LIGHT + noise(2),
    "ghost": left_behind() + noise(3),
    "at rest": history(np.broadcast_to(LIGHT[:1], LIGHT.shape) + noise(4)),
}

#: Sequence, measure, what made it, and a tolerance beside four standard errors
VALUES: list[tuple[str, Callable[[Measures], Estimate], float, float]] = [
    ("history", lambda found: found.lag.lag, 4.0, 0.0),
    ("history", lambda found: found.lag.persistence, 0.8, 0.0),
    ("history", lambda found: found.lag.gain, 1.0, 0.0),
    ("history", lambda found: found.lag.time_constant, -1 / math.log(0.8), 0.0),
    ("history", lambda found: found.flicker_beside_lag, math.sqrt(2) * SIGMA, 0.0),
    ("late history", lambda found: found.lag.lag, 5.0, 1e-2),
    ("noise", lambda found: found.lag.gain, 0.97, 0.0),
    ("noise", lambda found: found.lag.lag, 0.0, 0.0),
    ("noise", lambda found: found.bias, -0.03, 0.0),
    ("ghost", lambda found: found.ghost_by_age[AGE - 1], FRACTION, 0.0),
    # The variance of each change of an average of weight w is 2 w^2/(2 - w), less while it
    # still remembers its start.
    (
        "at rest",
        lambda found: found.flicker,
        SIGMA * WEIGHT * math.sqrt(2 / (2 - WEIGHT)),
        0.05 * SIGMA,
    ),
]


def measured(frames: np.ndarray, references: np.ndarray = LIGHT) -> Measures:
    everywhere = np.ones((HEIGHT, WIDTH), dtype=bool)
    found = measure(
        Sequence(len(frames), frames.__getitem__, references.__getitem__, lambda n: everywhere)
    )
    assert found is not None
    return found


@pytest.fixture(scope="module")
def found():
    still = np.broadcast_to(LIGHT[:1], LIGHT.shape)
    return {
        name: measured(frames, still if name == "at rest" else LIGHT)
        for name, frames in MADE.items()
    }


def missed(estimate: Estimate, value: float, tolerance: float = 0.0) -> bool:
    ends = estimate.ends(4.0)
    return ends is None or not ends[0] - tolerance <= value <= ends[1] + tolerance


@pytest.mark.claim("sequence-lag")
def test_values_that_made_the_sequences_are_found(found):
    wrong = [
        (name, value)
        for name, of, value, tolerance in VALUES
        if missed(of(found[name]), value, tolerance)
    ]
    assert len(wrong) <= 0.1 * len(VALUES), wrong


def test_frames_of_a_history_are_no_independent_runs():
    """By Student's law their means would hold the bias, which is zero, far too rarely;
    those of a series hold it.
    """
    plain = known = 0
    for seed in range(60):
        frames = lfilter([WEIGHT], [1, WEIGHT - 1], noise(100 + seed, (FRAMES + 20, 64)), axis=0)[
            20:
        ]
        means = frames.mean(axis=1) / MEAN
        half = float(student.ppf(0.975, FRAMES - 1)) * means.std(ddof=1) / math.sqrt(FRAMES)
        plain += abs(means.mean()) < half
        known += mean_of_series(means).within(1e-12) is not Answer.NO
    # an average of weight 0.2 has independent frames for one of nine: 49 % expected
    assert plain < 0.75 * 60
    assert known >= 0.9 * 60


def test_a_short_sequence_has_a_bias_without_an_error():
    """Seven frames do not tell how far they depend on one another."""
    bias = measured(0.97 * LIGHT[:7] + noise(2, LIGHT[:7].shape), LIGHT[:7]).bias
    assert (bias.value, bias.error) == (pytest.approx(-0.03, abs=0.02), None)
