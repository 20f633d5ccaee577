# SPDX-License-Identifier: BSD-3-Clause
"""The shadow-ray epsilon, against Mitsuba's own constant and against volpath's documented rule."""

import mitsuba as mi
import pytest

from reference.scene.shadow_epsilon import measure_shadow_epsilon


@pytest.mark.claim("shadow-ray-epsilon")
def test_equals_mitsubas_constant(variant):
    # maxt is rounded to float32, half a unit in the last place of a number just below 2: 6e-8, relative to 2
    assert measure_shadow_epsilon() == pytest.approx(mi.math.ShadowEpsilon, abs=6e-8)
