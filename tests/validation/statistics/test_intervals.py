# SPDX-License-Identifier: BSD-3-Clause
"""Intervals, p-values, powers and bands of noise hold what they estimate as often as they say."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from airlight.validation.statistics.comparison import LEVEL
from airlight.validation.statistics.estimate import Answer
from airlight.validation.statistics.noise import (
    chance,
    drift,
    growths,
    other_power,
    slower_stages,
    spread,
)
from airlight.validation.statistics.samples import (
    LEAST,
    binomial_interval,
    binomial_p,
    mean_of_series,
    quantile_interval,
    rank_correlation,
    sidak,
    student_quantile,
)
from airlight.validation.timing import FrameTimes, TimeGrowth, Timing
from tests.helpers.calibration import power
from tests.helpers.reports import record_of, sampled, times


@pytest.mark.parametrize(("successes", "trials"), [(0, 12), (12, 12), (3, 40), (992, 1000), (0, 0)])
def test_ends_of_a_share_leave_a_fortieth_on_either_side(successes, trials):
    """By the definition: at the lower end so many or more have the tail's chance, at
    the upper so many or fewer.
    """
    low, high = binomial_interval(successes, trials)
    assert low <= successes / max(trials, 1) <= high
    if successes > 0:
        assert stats.binom.sf(successes - 1, trials, low) == pytest.approx(0.025, rel=1e-8)
    else:
        assert low == 0
    if successes < trials:
        assert stats.binom.cdf(successes, trials, high) == pytest.approx(0.025, rel=1e-8)
    else:
        assert high == 1


@pytest.mark.claim("sweep-intervals")
def test_share_holds_its_probability_at_least_as_often_as_it_says():
    """The law's own sum over all counts, no simulation; Wilson's interval falls
    below 0.95 at many of these.
    """
    ends = [binomial_interval(count, 200) for count in range(201)]
    for probability in (0.003, 0.08, 0.5, 0.992):
        chances = stats.binom.pmf(np.arange(201), 200, probability)
        held = sum(
            chance for chance, (low, high) in zip(chances, ends) if low <= probability <= high
        )
        assert held >= 0.95


def test_quantile_of_a_hundred_by_hand():
    values = np.arange(1, 101)[::-1]
    # Binomial(100, 1/2): P(X <= 39) = 0.0176 < 0.025 <= P(X <= 40) = 0.0284; the same from above.
    assert quantile_interval(values, 0.5) == (50.0, 40.0, 61.0)
    # The largest of a hundred is not above the 99 % quantile often enough:
    # the upper end is not known.
    estimate, low, high = quantile_interval(values, 0.99)
    assert (estimate, high) == (99.0, None)
    assert low == 97.0


@pytest.mark.statistical
@pytest.mark.claim(
    "sweep-intervals", tolerance="0.014 of the level: four standard errors of 4000 samples"
)
def test_quantile_holds_the_true_one_at_least_as_often_as_it_says():
    rng = np.random.default_rng(11)
    held = 0
    for _ in range(4000):
        _, low, high = quantile_interval(rng.exponential(size=60), 0.8)
        held += (low or 0) <= -np.log(0.2) <= (np.inf if high is None else high)
    # Order statistics cannot hit the level exactly: they exceed it. Four standard errors of a
    # fraction of 4000: 0.014.
    assert held / 4000 > 0.95 - 0.014


@pytest.mark.claim("sweep-intervals", tolerance="5e-8: the digits of the example")
def test_rank_correlation_is_that_of_the_authors_own_program():
    """The example of ci.spear in statpsych, the program of D. G. Bonett."""
    y = [21, 4, 9, 12, 35, 18, 10, 22, 24, 1, 6, 8, 13, 16, 19]
    x = [67, 28, 30, 28, 52, 40, 25, 37, 44, 10, 14, 20, 28, 40, 51]
    assert rank_correlation(x, y) == pytest.approx((0.8699639, 0.5840951, 0.9638297), abs=5e-8)


@pytest.mark.statistical
@pytest.mark.claim(
    "sweep-intervals",
    tolerance=(
        "0.035 of the level: four standard errors of 2000 samples, and 0.015 of the approximation"
    ),
)
def test_rank_correlation_holds_the_true_one_about_as_often_as_it_says():
    """The true rank correlation of two normal variables with the
    correlation c is (6/pi) asin(c/2).
    """
    rng = np.random.default_rng(5)
    for c in (0.0, 0.5, 0.8):
        reference, held = 6 / np.pi * np.arcsin(c / 2), 0
        for _ in range(2000):
            x = rng.normal(size=80)
            _, low, high = rank_correlation(x, c * x + np.sqrt(1 - c * c) * rng.normal(size=80))
            held += low <= reference <= high
        # An approximation: within 0.015 of the level, and four standard errors of a
        # fraction of 2000, 0.0195.
        assert held / 2000 == pytest.approx(0.95, abs=0.035)


@pytest.mark.claim("detectable-bias")
def test_power_of_the_detectable_effect_is_ninety_percent():
    assert power(1.959964 + 1.281552, np.inf) == pytest.approx(0.9, abs=1e-6)
    assert power(-1.959964 - 1.281552, np.inf) == pytest.approx(0.9, abs=1e-6)
    # The shifted law that the detectable bias uses is near the non-central one from
    # some dozens of batches on.
    for freedom, error in ((15.0, 0.02), (1000.0, 3e-4)):
        effect = student_quantile(0.975, freedom) + student_quantile(0.90, freedom)
        assert power(effect, freedom) == pytest.approx(0.9, abs=error)


def test_sidak_and_the_binomial_law_by_hand():
    assert sidak(0.01, 1) == pytest.approx(0.01, rel=1e-12)
    assert sidak(0.19, 2) == pytest.approx(0.1, rel=1e-12)
    assert binomial_p(0, 4, 0.5) == pytest.approx(2 / 16, rel=1e-12)
    assert binomial_p(4, 4, 0.5) == pytest.approx(2 / 16, rel=1e-12)
    assert binomial_p(2, 4, 0.5) == 1


def test_spread_is_the_geometric_mean_of_the_quartiles():
    wide = Timing(median_ms=1.0, low_ms=1.0, high_ms=4.0, repetitions=9)
    quiet = replace(wide, high_ms=1.0)
    assert spread([{"frame": wide, "airlight": quiet}]) == pytest.approx(2.0)
    # A single repetition, and what is shorter than a launch, say nothing of the machine.
    assert (
        spread([{"frame": replace(wide, repetitions=1), "surface": replace(wide, median_ms=0.002)}])
        == 1.0
    )
    assert spread([]) == 1.0


def test_more_work_is_seen_in_all_that_contains_it():
    old, new = (record_of(times(1.0), FrameTimes).measured for _ in range(2))
    for stage in ("airlight", "frame", "light_moved", "objects_moved"):
        new[stage] = record_of(sampled([old[stage].median_ms + 0.7] * 20), Timing)
    quiet, busy = [0.01, -0.01] * 20, [0.4, -0.4] * 20
    stages = ["airlight", "frame", "light_moved", "objects_moved"]
    assert slower_stages(old, new, least=1.1, scale=1.0, others=quiet, tests=80) == stages
    assert slower_stages(old, new, least=1.4, scale=1.0, others=quiet, tests=80) == stages[:3]
    assert slower_stages(new, old, least=1.1, scale=1.0, others=quiet, tests=80) == []
    # Where other times grow and fall as much, and where there are no others, it may be chance.
    assert slower_stages(old, new, least=1.1, scale=1.0, others=busy, tests=80) == []
    assert slower_stages(old, new, least=1.1, scale=1.0, others=[], tests=8) == []


def test_the_chance_of_a_growth_by_hand():
    """One time: half of Pareto's tail. Two that grow alike: Fisher's (1 - ln p^2) p^2. One
    that falls: above a half.
    """
    others = [0.1, -0.1, 0.2, 0.0]  # of the mean 0.1
    p = 0.5 * (1 + 3 / 4) ** -4
    assert chance([0.3], others) == pytest.approx(p)
    assert chance([0.3, 0.3], others) == pytest.approx(p**2 * (1 - 2 * np.log(p)))
    assert chance([-0.3], others) == pytest.approx(1 - p)
    assert chance([0.3], [0.0, 0.0]) < 1e-200
    assert chance([0.3], []) == 1.0


@pytest.mark.parametrize(("spread", "configurations"), [(0.05, 4), (0.5, 4), (0.5, 12)])
def test_the_same_code_gives_alarms_as_often_as_the_level_says(spread, configurations):
    """Bursts multiply whole timings by exp(E), E exponential: the law of rule 4."""
    random, runs, stages = np.random.default_rng(configurations), 200, times(1.0)
    stages = {
        stage: stages[stage]["median_ms"]
        for stage in ("surface", "airlight", "frame", "light_moved")
    }
    alarms = 0
    for _ in range(runs):
        pairs = [
            [
                {
                    stage: timing(ms * np.exp(random.exponential(spread)))
                    for stage, ms in stages.items()
                }
                for _ in range(2)
            ]
            for _ in range(configurations)
        ]
        common = drift(pairs)
        grown = [growths(old, new, common) for old, new in pairs]
        for number, (old, new) in enumerate(pairs):
            others = [
                growth
                for place, several in enumerate(grown)
                if place != number
                for growth in several
            ]
            how = {"least": 1.0, "others": others, "tests": 2 * 3 * configurations}
            slow = slower_stages(old, new, scale=common, **how) + slower_stages(
                new, old, scale=1 / common, **how
            )
            alarms += len(slow) > 0
    # Four standard errors of so many runs.
    assert alarms / runs < LEVEL + 4 * np.sqrt(LEVEL / runs)


def timing(ms):
    return Timing(median_ms=ms, low_ms=ms, high_ms=ms, repetitions=20)


@pytest.mark.parametrize(
    ("old", "new", "differs"),
    [
        ((0.5, 0.01), (0.69, 0.01), 0.0),  # a fifth
        ((0.5, 0.01), (0.72, 0.01), 0.22),
        ((0.72, 0.01), (0.5, 0.01), -0.22),
        ((0.5, 0.06), (0.72, 0.08), 0.0),  # three standard errors are 0.3
        ((0.5, None), (0.72, None), 0.0),  # two steps lie on a line, whatever the noise
        ((None, None), (0.72, 0.01), 0.0),  # one step has no power
    ],
)
def test_another_power_is_beyond_tolerance_and_scatter(old, new, differs):
    fits = [
        TimeGrowth(exponent=exponent, standard_error=error, steepest=None, at=None, cliff=False)
        for exponent, error in (old, new)
    ]
    assert other_power(*fits) == pytest.approx(differs)


@pytest.mark.claim("series-intervals")
@pytest.mark.parametrize("persistence", [0.0, 0.5, 0.8])
@pytest.mark.parametrize("frames", [4, LEAST, 16, 32])
def test_a_mean_of_frames_that_depend_on_one_another_is_held(persistence, frames):
    """Of 1000 series intervals of 95 % hold the true mean in 90 % at least, where the
    mean has an error at all.
    """
    random = np.random.default_rng(int(10 * persistence) + frames)
    white = random.normal(size=(1000, frames))
    series = white / np.sqrt(1 - persistence**2)  # stationary from the first frame on
    for n in range(1, frames):
        series[:, n] = persistence * series[:, n - 1] + white[:, n]
    found = [mean_of_series(each) for each in series]
    if frames < LEAST:
        assert all(each.error is None for each in found)
        return
    held = np.mean([each.within(0.0) is not Answer.NO for each in found])
    assert held >= 0.9  # 0.93 in the worst case, +- 0.008
    if persistence == 0.0:
        widths = [each.error for each in found] / (1 / np.sqrt(frames))
        # independent frames pay, but not without end
        assert np.median(widths) < (2.6 if frames == LEAST else 1.8)


def test_frames_that_are_all_off_by_the_same_have_no_error():
    """Frozen noise repeats in each frame: that its mean does not scatter says
    nothing of how far it is off.
    """
    assert mean_of_series(np.full(20, 0.3)).error is None
