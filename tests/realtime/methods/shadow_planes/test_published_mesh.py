# SPDX-License-Identifier: BSD-3-Clause
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from realtime.scene.mesh_adjacency import make_casters
from tests.helpers.casters import closed_sphere
from tests.helpers.planes import CAMERA, LIGHT, bundles, crossings, index_of
from tests.helpers.scenes import tiny_scene


def fog_and_lamp():
    import mitsuba as mi

    from realtime.scene.read_scene import read_scene

    lamp = {"type": "point", "position": LIGHT.tolist(), "intensity": {"type": "rgb", "value": [5.0, 4.0, 3.0]}}
    scene = read_scene(mi.load_dict(tiny_scene(ball=None, floor=None, lamp=lamp)), "double")
    return scene.medium, scene.lights[0]


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


def interpolated(module, rows, ratio, monkeypatch):
    """Gamma on the planes of a finely divided sphere, interpolated, and as it is."""
    import mitsuba as mi

    from realtime.kernels.registry import KERNELS
    from realtime.methods.shadow_planes.published_mesh import gamma_at, mesh_gamma

    monkeypatch.setattr(module, "RATIO", ratio)
    # Edges of 2 cm: what is left of their length is below what the rows leave.
    index, crossed, points = crossed_planes(closed_sphere(4))
    medium, light = fog_and_lamp()
    view: Any = SimpleNamespace(**empty_view(), medium=medium)
    kernel = KERNELS["exact"].function
    at = mesh_gamma(view, index, light, kernel=kernel, rows=rows)
    mesh = np.array(at(*crossed))
    exact = np.array(gamma_at(view, light, mi.Vector3d(np.ascontiguousarray(points.T)), kernel=kernel))
    return mesh[0], exact[0]


def test_vertices_converge_to_pixels(variant, monkeypatch):
    """Linear between rows: of second order in the logarithm of their ratio."""
    import realtime.methods.shadow_planes.published_mesh as module

    errors = []
    for rows, ratio in ((8, 2.25), (16, 1.5), (32, 1.5**0.5)):
        mesh, exact = interpolated(module, rows, ratio, monkeypatch)
        assert len(mesh) > 200
        errors.append(np.sqrt(np.mean((mesh - exact) ** 2)) / exact.mean())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(2, abs=0.45)
    assert errors[0] > errors[1] > errors[2]


def test_gamma_keeps_its_value_beyond_the_last_row(variant, monkeypatch):
    import realtime.methods.shadow_planes.published_mesh as module

    near, exact = interpolated(module, 2, 1.5, monkeypatch)
    assert np.all(np.isfinite(near))
    # Lower bound of what is cut off: Gamma still grows beyond 1.5 times the distance of the sphere.
    assert np.max(np.abs(near - exact)) > 0.05 * exact.mean()


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
