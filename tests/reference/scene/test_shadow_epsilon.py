# SPDX-License-Identifier: BSD-3-Clause
"""The shadow-ray epsilon, against Mitsuba's own constant and against volpath's documented rule."""

import pytest

from reference.scene.shadow_epsilon import measure_shadow_epsilon


@pytest.mark.claim("shadow-ray-epsilon")
def test_equals_mitsubas_constant(variant):
    import mitsuba as mi

    # maxt is rounded to float32, half a unit in the last place of a number just below 2: 6e-8, relative to 2
    assert measure_shadow_epsilon() == pytest.approx(mi.math.ShadowEpsilon, abs=6e-8)


@pytest.mark.claim("shadow-ray-epsilon")
def test_is_relative_to_the_distance(variant):
    import drjit as dr
    import mitsuba as mi

    interaction = dr.zeros(mi.Interaction3f)
    interaction.p = mi.Point3f(0.3, -1.7, 0.41)
    for distance in (0.11, 1.37, 23.0):
        target = interaction.p + distance * mi.Vector3f(0.48, 0.6, 0.64)
        length = interaction.spawn_ray_to(target).maxt.numpy()[0]
        # the distance is a difference of float32 numbers: a few units in the last place of 23 against 0.11
        assert 1 - length / distance == pytest.approx(measure_shadow_epsilon(), abs=3e-6)
