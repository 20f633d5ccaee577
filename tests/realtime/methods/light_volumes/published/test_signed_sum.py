# SPDX-License-Identifier: BSD-3-Clause
"""Where rays pass a hidden light closely, what signs cancel leaves no trace."""

from typing import Any

import pytest


def test_light_that_the_rays_pass_closely_leaves_nothing_where_it_is_hidden(variant):
    """A box in shadow about the light: J(0, x) beyond it is 1e4 times what is lit, and cancels without a trace."""
    import mitsuba as mi

    from realtime.kernels.exact import exact
    from realtime.methods.light_volumes.published.raster import Crossings
    from realtime.methods.light_volumes.published.signed_sum import crossing_sum
    from realtime.rays.ray_light import RayGeometry
    from realtime.scene.lights import Light
    from realtime.scene.medium import Medium
    from realtime.scene.phase import named_phase

    totals = {}
    for Float, Vector, Color in ((mi.Float, mi.Vector3f, mi.Color3f), (mi.Float64, mi.Vector3d, mi.Color3d)):
        medium = Medium((Float(0.4),), Color(1), named_phase("isotropic"))
        light = Light(Vector(0), Color(1))
        geometry = RayGeometry(Float([2.0]), Float([1e-5]), None, None)
        x = mi.Float64([0.5, 1.5, 2.5, 3.5, 9.0, 9.0])
        sign = mi.Float64([-1, 1, -1, 1, -1, 1])
        crossings = Crossings(mi.UInt32([0] * 6), x, sign)
        settings: dict[str, Any] = {"medium": medium, "light": light, "geometry": geometry}
        totals[Float] = crossing_sum([crossings], kernel=exact, distance=Float([5.0]), **settings)[0]
        parts = [exact(geometry, Float(a), Float(b), medium, light)[0] for a, b in ((0.5, 1.5), (2.5, 3.5))]
        assert totals[Float] == pytest.approx(sum(parts), rel=1e-5 if Float is mi.Float else 1e-9)
    assert 0.1 < totals[mi.Float64] < 10
