# SPDX-License-Identifier: BSD-3-Clause
"""Claim: as few panels and nodes as a segment needs leave less than 1e-6, on rays on which no rule was tuned."""

import drjit as dr
import numpy as np
import pytest

from realtime.kernels.exact import panels_mean, path_interval
from realtime.numerics.array_types import aligned_array, array_types
from realtime.rays import RayGeometry
from realtime.scene.rule_reach import PANEL_NODES
from tests.helpers.kernel_values import phase_of
from tests.realtime.kernels.test_exact import NAMES, g_of, many_rays

pytestmark = pytest.mark.usefixtures("variant")

#: Rounding left aside, the rule leaves 5e-7, 8e-7 of cos^64; it was tuned on other rays.
LEFT = 1e-6


@pytest.mark.claim("exact-panels")
@pytest.mark.parametrize("name", NAMES)
def test_what_the_rule_of_panels_leaves_without_rounding(name):
    """By the rule for float32, but in float64, and by five times as many nodes."""
    types = array_types("double")
    columns = [aligned_array(types.scalar, column) for column in many_rays(20_000, 7)]
    foot, height, x0, x1, sigma_t = columns
    phase = phase_of(name, g_of(name, 20_000), types.scalar)
    scale, tail = phase.lobe_scales(types.scalar)
    h, e0, e1, _ = path_interval(RayGeometry(foot, height), x0, x1, sigma_t, tail=tail)
    # Cut where float32 cuts: this is about nodes.
    e1 = dr.minimum(e1, e0 + dr.minimum(20 / (sigma_t * h), 1e7 * (tail + e0)))
    f0 = e0 / scale
    width = dr.maximum(dr.asinh(e1 / scale) - dr.asinh(f0), 0)
    parts = (phase, (f0, dr.sqrt(f0 * f0 + 1)), scale, width, [sigma_t * h], None)
    rule, reference = (np.array(panels_mean(*parts, nodes=nodes)[0]) for nodes in (PANEL_NODES, 40))
    long_enough = np.array(width) > 1e-6  # the difference of two asinh has lost shorter ones
    assert np.abs(rule[long_enough] / reference[long_enough] - 1).max() < LEFT
