# SPDX-License-Identifier: BSD-3-Clause
from typing import Any

import numpy as np
import pytest

from tests.helpers.scenes import spot, tiny_scene
from tests.helpers.volumes import make_camera, tetrahedron


@pytest.mark.parametrize("kind", ["point", "spot"])
@pytest.mark.parametrize("order", ["image", "tiles"])
def test_sum_over_a_convex_volume_is_one_integral(variant, kind, order):
    """A ray meets a tetrahedron in one interval: clipped by its four planes, not by crossings."""
    import mitsuba as mi

    from realtime.kernels.exact import exact
    from realtime.kernels.registry import airlight_integral
    from realtime.methods.light_volumes.published.raster import signed_crossings
    from realtime.methods.light_volumes.published.signed_sum import crossing_sum
    from realtime.numerics.array_types import array_types
    from realtime.rays.ray_light import ray_geometry
    from realtime.scene.camera import ray_directions, tiled_pixels
    from realtime.scene.lights import Light, spot_fields
    from realtime.scene.medium import Medium
    from realtime.scene.phase import named_phase

    corners = np.array([(0.1, 0.2, 1.9), (1.1, -0.8, -0.9), (-1.2, -0.7, -1.1), (0.1, 1.3, -0.8)])
    camera = make_camera((1.9, -2.3, 0.4), size=(32, 24))
    pixel = mi.UInt32(tiled_pixels(32, 24) if order == "tiles" else np.arange(32 * 24, dtype=np.uint32))
    lane = mi.UInt32(np.argsort(np.array(pixel)).astype(np.uint32)) if order == "tiles" else None
    direction, low = ray_directions(camera, pixel)
    rays = np.array(direction).T
    begin, end = np.zeros(len(rays)), np.full(len(rays), 3.1)  # the visible surface cuts some of the intervals
    for k in range(4):
        a, b, c, inner = np.roll(corners, -k, axis=0)
        normal = np.cross(b - a, c - a)
        normal *= np.sign(normal @ (inner - a))
        along, height = rays @ normal, (np.array(camera.origin).ravel() - a) @ normal
        begin = np.where(along > 0, np.maximum(begin, -height / along), begin)
        end = np.where(along < 0, np.minimum(end, -height / along), end)
    assert np.mean(end > begin) > 0.1
    assert np.any((end > begin) & (end == 3.1))
    cone = spot_fields(np.array([0.1, 0.2, -1.0]) / np.sqrt(1.05), 0.45, 0.45, array_types("double"))
    arrays = {"position": mi.Vector3d(0.1, 0.2, 1.9), "intensity": mi.Color3d(1)}
    light = Light(**arrays, **(cone if kind == "spot" else {}))
    medium = Medium((mi.Float64(0.4),), mi.Color3d(1), named_phase("isotropic"))
    geometry = ray_geometry(camera.origin, direction, light, low=low)
    settings: dict[str, Any] = {"medium": medium, "light": light}
    wanted = airlight_integral(exact, geometry, mi.Float64(begin), mi.Float64(np.maximum(begin, end)), **settings)
    batches = signed_crossings(tetrahedron(corners), camera)
    distance = mi.Float64(np.full(len(rays), 3.1))
    total = crossing_sum(batches, kernel=exact, geometry=geometry, distance=distance, lane=lane, **settings)
    # The nodes of J(0, x) and J(begin, end) differ; the kernel promises 1e-6 of each.
    assert np.array(total) == pytest.approx(np.array(wanted), abs=2e-6 * np.max(np.array(wanted)))
    assert np.max(np.array(wanted)) > 0.05


def view_of(scene):
    """Return the view of a scene's frame."""
    import mitsuba as mi

    from realtime.frame.frame_view import frame_view
    from realtime.frame.surface import cast_rays
    from realtime.scene.camera import ray_directions, tiled_pixels

    camera = scene.camera
    pixel = mi.UInt32(tiled_pixels(camera.width, camera.height))
    direction = ray_directions(camera, pixel)[0]
    distance = cast_rays(scene.geometry, None, camera.origin, direction).distance
    parts = {"features": scene.features, "geometry": scene.geometry, "medium": scene.medium, "lights": scene.lights}
    return frame_view(camera, pixel, distance, **parts)


@pytest.mark.parametrize("kind", ["point", "spot"])
@pytest.mark.parametrize("precision", ["single", "double"])
def test_a_frame_is_that_of_the_height_field(variant, kind, precision):
    """The twin finds the lit parts of rays in the height field, in another form and without triangles."""
    import mitsuba as mi

    from realtime.kernels.exact import exact
    from realtime.methods.light_volumes.published.mesh import volume_mesh
    from realtime.methods.light_volumes.published.signed_sum import mesh_airlight
    from realtime.scene.read_scene import read_scene
    from realtime.shadow_maps.shadow_map import cast_shadow_map
    from reference.scene.read import read_truth
    from tests.evidence.oracles.light_volume import oracle_airlight

    # A kernel in float64 for a beam with a soft edge takes ten seconds to compile.
    lamp = {"lamp": spot(beam=20.0 if precision == "single" else 33.0)} if kind == "spot" else {}
    loaded = mi.load_dict(tiny_scene(size=(40, 28), **lamp))
    scene = read_scene(loaded, precision)
    light = scene.lights[0]
    shadow_map = cast_shadow_map(scene.geometry, light, 32)
    view = view_of(scene)
    lanes = mesh_airlight(view, light, volume_mesh(shadow_map, light), kernel=exact)
    airlight, distance = np.empty((40 * 28, 3)), np.empty(40 * 28)
    airlight[np.array(view.pixel)], distance[np.array(view.pixel)] = np.array(lanes).T, np.array(view.distance)
    wanted = oracle_airlight(read_truth(loaded), [shadow_map], distance=distance.reshape(28, 40)).reshape(-1, 3)
    # The scene holds its numbers in float32, 6e-8 each; float32 adds the kernel's 5e-6 and the rounding of the cone.
    tolerance = 3e-7 if precision == "double" else 1e-5
    assert np.max(np.abs(airlight - wanted)) < tolerance * np.max(wanted)


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


def test_no_crossings_no_light(variant):
    import mitsuba as mi

    from realtime.kernels.exact import exact
    from realtime.methods.light_volumes.published.signed_sum import crossing_sum
    from realtime.rays.ray_light import RayGeometry
    from realtime.scene.lights import Light
    from realtime.scene.medium import Medium
    from realtime.scene.phase import named_phase

    settings: dict[str, Any] = {
        "medium": Medium((mi.Float(0.4),), mi.Color3f(1), named_phase("isotropic")),
        "light": Light(mi.Vector3f(0), mi.Color3f(1)),
        "geometry": RayGeometry(mi.Float([2.0, 3.0]), mi.Float([1.0, 1.0]), None, None),
    }
    assert np.array_equal(crossing_sum([], kernel=exact, distance=mi.Float([5.0, 6.0]), **settings), [0, 0])
