# SPDX-License-Identifier: BSD-3-Clause
"""Gamma between the vertices of a plane is linear."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from realtime.scene.mesh_adjacency import make_casters
from tests.helpers.casters import closed_sphere
from tests.helpers.planes import CAMERA, LIGHT, bundles, crossings, index_of


def empty_view():
    """What `mesh_gamma` reads of a view but for the medium: the origin, and of which types the rest is."""
    import mitsuba as mi

    return {"origin": mi.Vector3d(CAMERA.tolist()), "direction": mi.Vector3d(0), "distance": mi.Float64(0)}


def crossed_planes(sphere):
    """The planes of a sphere, where rays cross them (plane, ray, x) and those points [m]."""
    import mitsuba as mi

    index = index_of(make_casters([("ball", *sphere)]), precision="double")
    ways = bundles(1920, spread=0.01)
    x, _ = crossings(index, ways)
    number, plane = np.nonzero((x > 0.2) & (x < 12))
    x, ways = x[number, plane], ways[number]
    rays = SimpleNamespace(**{axis: mi.Float64(np.ascontiguousarray(part)) for axis, part in zip("xyz", ways.T)})
    # The mesh is given in the frame of the light, the light and the camera in the world's.
    axes = np.stack([np.array(axis).ravel() for axis in (index.x_axis, index.y_axis, index.z_axis)])
    return index, (mi.UInt32(plane), rays, mi.Float64(x)), CAMERA + x[:, None] * (ways @ axes)


def test_interpolation_is_exact_on_vertices_and_linear_between(variant, monkeypatch):
    """Gamma replaced by a linear function of the point, which two triangles interpolate exactly."""
    import mitsuba as mi

    import realtime.methods.shadow_planes.published_mesh as module

    slope = np.array([0.3, -0.7, 0.2])
    monkeypatch.setattr(
        module,
        "gamma_at",
        lambda view, light, point, kernel: mi.Color3d(
            point.x * float(slope[0]) + point.y * float(slope[1]) + point.z * float(slope[2]) + 1
        ),
    )
    index, crossed, points = crossed_planes(closed_sphere(1))
    view: Any = SimpleNamespace(**empty_view())
    light: Any = SimpleNamespace(position=mi.Vector3d(LIGHT.tolist()))
    at = module.mesh_gamma(view, index, light, kernel=None, rows=16)
    gamma = np.array(at(*crossed))[0]
    assert gamma == pytest.approx(points @ slope + 1, rel=1e-9)
