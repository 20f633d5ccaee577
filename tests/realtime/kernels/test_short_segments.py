# SPDX-License-Identifier: BSD-3-Clause
"""Few nodes for short segments: what the rules leave, by rays on which they were not tuned and by the truth."""

import numpy as np
import pytest

from realtime.numerics.aligned import aligned_array

PHASES = [
    ("isotropic", 0.0),
    ("rayleigh", 0.0),
    ("hazy", 0.0),
    ("murky", 0.0),
    ("hg", -0.95),
    ("hg", 0.3),
    ("hg", 0.95),
]
RULES = ("FEW", "MORE")


def rule_called(name):
    from realtime.kernels import short_segments

    return getattr(short_segments, name)


def longest_of(rule, name):
    from realtime.scene.phase import PHASES

    return rule.length(next(phase for phase in PHASES if phase.name == name).reach)


def short_rays(count, seed, *, longest):
    """Foot, height, x0, x1, extinction; lengths up to `longest` times the distance from the light."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-np.pi / 2, np.pi / 2, count)
    angle[: count // 2] = np.sign(angle[: count // 2]) * (np.pi / 2 - 10 ** rng.uniform(-5, 0, count // 2))
    near = 10 ** rng.uniform(-3, 1, count)
    s0, height = near * np.sin(angle), near * np.cos(angle)
    length = near * longest * rng.uniform(0.05, 1.2, count)
    # Half of them end where they are closest, or are about it.
    s0 = np.where(rng.random(count) < 0.5, s0, s0 - length * rng.random(count))
    x0 = 10 ** rng.uniform(-2, 1, count)
    # Not darker than e^-40 where the light of the segment comes from.
    sigma_t = np.minimum(10 ** rng.uniform(-3, 1.3, count) / length, 40 / (x0 + length + np.hypot(s0, height)))
    return [x0 - s0, height, x0, x0 + length, sigma_t]


def of_rule(rays, name, g, rule, precision):
    """Return J by a rule, and whether it serves."""
    from realtime.kernels.short_segments import extent, serves, short_segment
    from realtime.numerics.array_types import array_types
    from realtime.rays.ray_light import RayGeometry
    from realtime.scene.phase import named_phase

    types = array_types(precision)
    foot, height, x0, x1, sigma_t = (aligned_array(types.scalar, column) for column in rays)
    phase = named_phase(name, g=types.scalar(g) if name == "hg" else None)
    geometry = RayGeometry(foot, height)
    (value,) = short_segment(geometry, x0, x1, phase, (sigma_t,), rule=rule)
    return np.array(value, dtype=np.float64), np.array(serves(rule, extent(geometry, x0, x1, (sigma_t,)), phase))


@pytest.mark.claim("exact-panels")
@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize(("name", "g"), PHASES)
def test_what_the_rules_leave_without_rounding(variant, name, g, rule):
    """The limits were tuned to 7e-7 on other rays."""
    from analytic.panels import airlight_segments
    from analytic.phase import PhaseFunction

    rule = rule_called(rule)
    rays = short_rays(1500, 3, longest=longest_of(rule, name))
    value, served = of_rule(rays, name, g, rule, "double")
    assert 0.2 < served.mean() < 0.95  # both sides of the limits
    expected, _ = airlight_segments(*rays, PhaseFunction(name, g=g))
    error = np.abs(value[served] / expected[served] - 1)
    assert error.max() < 1e-6


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize(("name", "g"), PHASES)
def test_float32_against_the_truth(variant, name, g, rule):
    """Rounding: the exponent's, 6e-8 of an optical depth; what is deeper than 20 is e^-20 of what is seen."""
    from analytic.panels import airlight_segments
    from analytic.phase import PhaseFunction

    rule = rule_called(rule)
    rays = [
        column.astype(np.float32).astype(np.float64) for column in short_rays(1500, 4, longest=longest_of(rule, name))
    ]
    foot, height, x0, x1, sigma_t = rays
    # Close to the light a segment is as long as float32 holds the difference of its ends.
    resolved = (x1 - x0 > 1e-2 * x1) & (sigma_t * (x0 + np.hypot(x0 - foot, height)) < 20)
    value, served = of_rule(rays, name, g, rule, "single")
    expected, _ = airlight_segments(*rays, PhaseFunction(name, g=g))
    used = served & resolved
    assert used.sum() > 200
    error = np.abs(value[used] / expected[used] - 1)
    assert error.max() < 5e-6


def test_no_rule_serves_at_the_light_or_for_endless_segments(variant):
    rays = [np.array(column) for column in ([2.0, 2.0, 2.0], [0.0, 0.0, 1.0], [2.0, 1.9, 0.0], [2.0, 2.1, np.inf])]
    for rule in RULES:
        _, served = of_rule([*rays, np.full(3, 0.1)], "isotropic", 0.0, rule_called(rule), "single")
        assert not served.any()


def test_segments_without_length_are_zero(variant):
    value, served = of_rule(
        [np.array([column]) for column in (2.0, 0.5, 1.0, 1.0, 0.3)], "hg", 0.5, rule_called("FEW"), "single"
    )
    assert served.all()
    assert value == 0
