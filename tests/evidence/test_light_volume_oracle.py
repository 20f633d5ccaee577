# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import replace

import numpy as np
import pytest

from analytic.errors import InputError
from analytic.geometry import foot_and_height
from analytic.panels import airlight_segments
from realtime.shadow_maps.projection import Projection
from realtime.shadow_maps.shadow_map import ShadowMap, cast_shadow_map
from reference.quadrature.unbounded import Rays
from reference.scene.read import TruthLight, read_truth
from reference.visibility.spot_cone import perpendicular
from tests.evidence.oracles.light_volume import height_field, oracle_airlight, volume_intervals
from tests.helpers.changes_of_variables import theta_of_x, x_of_theta
from tests.helpers.scenes import bounded_medium, spot, tiny_scene
from validation.estimates.quadrature import truth_image
from validation.metrics.errors import error_metrics


def maps_of(scene, size):
    from realtime.scene.read_scene import read_scene

    read = read_scene(scene)
    return [cast_shadow_map(read.geometry, light, size) for light in read.lights]


def variations():
    """Return changes of the tiny scene by name."""
    coloured = {"sigma_t": {"type": "rgb", "value": [0.2, 0.4, 0.9]}, "has_spectral_extinction": True}
    return {
        "point": {},
        "soft spot": {"lamp": spot(beam=21.0)},
        "coloured extinction": {"fog": tiny_scene()["fog"] | coloured},
    }


def twin_error(description, size):
    """Return the error of the twin of a scene against the truth."""
    import mitsuba as mi

    scene = mi.load_dict(description)
    return error_metrics(truth_image(scene).airlight, oracle_airlight(read_truth(scene), maps_of(scene, size)))


@pytest.mark.parametrize("lamp", ["point", "soft spot"])
def test_nothing_hides_nothing(variant, lamp):
    """Rays are only cut at the edges of faces: what is left is the tolerance of the integrals, 1e-10."""
    assert twin_error(tiny_scene(ball=None, floor=None, **variations()[lamp]), 8).max < 1e-10


def test_floor_below_a_spot_is_exact(variant):
    """The height of a plane is linear: nothing but the float32 distances of the map is left, 6e-8 of each."""
    error = twin_error(tiny_scene(size=(32, 24), ball=None, lamp=spot()), 8)
    assert error.relative_rmse < 5e-7
    # In the last pixels of the cone the light is a short way long, of which these roundings are a larger share.
    assert error.max < 1e-4


def plane_below(depth, size):
    """Return the shadow map of an endless horizontal plane below a point light, whose horizon is on borders of texels.

    Its height is -k_z / depth where a direction k points down, 0 elsewhere.
    """
    at = np.linspace(-1, 1, size + 1)
    v, u = np.meshgrid(at, at, indexing="ij")
    # Across and up are the two axes that follow a face's own: z is the second after x and the first after y.
    down = np.stack([-v, -v, -u, -u, -1 + 0 * u, 1 + 0 * u])
    length = np.sqrt(1 + u**2 + v**2)
    distance = np.divide(length * depth, down, where=down > 0, out=np.full(down.shape, np.inf))
    return ShadowMap(size, distance.ravel(), Projection(None))


@pytest.mark.parametrize("level", [0.9, 1.5], ids=["below the camera", "above the camera"])
@pytest.mark.parametrize("surface", [np.inf, 3.7])
def test_shadow_of_a_plane_is_exact(variant, level, surface):
    """Rays that start at 1.3 m are lit where they are above the plane, up to the visible surface."""
    import mitsuba as mi

    truth = read_truth(mi.load_dict(tiny_scene(size=(24, 18), ball=None, floor=None)))
    light, direction = truth.lights[0], truth.direction
    airlight = oracle_airlight(
        truth, [plane_below(light.position[2] - level, 8)], distance=np.full((truth.height, truth.width), surface)
    )
    reaches = (level - truth.origin[2]) / direction[:, 2]
    meets = (reaches > 0) & (reaches < surface)
    assert 0.1 < np.mean(meets) < 0.9
    crossing = np.where(meets, reaches, 0.0)
    if truth.origin[2] > level:
        x0, x1 = np.zeros(len(meets)), np.where(meets, crossing, surface)
    else:
        x0, x1 = crossing, np.where(meets, surface, 0.0)
    foot, height = foot_and_height(np.broadcast_to(truth.origin, direction.shape), direction, light.position)
    sigma_t = truth.medium.sigma_t[0]
    J, _ = airlight_segments(foot, height, x0, x1, sigma_t, truth.medium.phase)
    expected = J[:, None] * truth.medium.albedo * sigma_t * light.intensity / (4 * np.pi)
    # The angles of crossings are rounded, the integrals right to 1e-10.
    assert airlight.reshape(-1, 3) == pytest.approx(expected, rel=1e-9, abs=1e-10 * expected.max())


@pytest.mark.parametrize("kind", ["point", "spot"])
def test_lit_points_are_before_the_displaced_triangles(kind):
    """A point sum mu_i k_i of the cone of a triangle is before it where sum mu_i s_i < 1: by its vertices in space."""
    rng = np.random.default_rng(18)
    size, faces = 4, 6 if kind == "point" else 1
    frame = None if kind == "point" else tuple(spot_frame(rng, 0.7))
    distance = rng.choice([0.4, 0.8, 1.1, 2.3, np.inf], faces * (size + 1) ** 2)
    if kind == "point":
        distance = same_on_common_edges(distance, size)
    light = TruthLight(np.array([0.21, -0.13, 0.34]), np.ones(3))
    origin = rng.normal(size=(200, 3)) * 0.8
    direction = rng.normal(size=(200, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    foot, height = foot_and_height(origin, direction, light.position)
    normal = np.concatenate([perpendicular(o, d[None], light) for o, d in zip(origin, direction, strict=True)], axis=0)
    ends = theta_of_x(0, foot, height), np.full(len(foot), 0.5 * np.pi)
    away, theta = points_on(origin, direction, foot, height, light)
    lit, known = before_triangles(ShadowMap(size, distance, Projection(frame)), away)
    field = height_field(ShadowMap(size, distance, Projection(frame)))
    if kind == "spot":
        # A ray's part in the square face, from the samples that lie there; one straight part each.
        among = known.any(axis=1)
        ends = np.where(known, theta, np.inf).min(axis=1), np.where(known, theta, -np.inf).max(axis=1)
        ends = np.where(among, ends[0], 0.0), np.where(among, ends[1], -1.0)
    intervals = volume_intervals(field, Rays(direction, normal, foot, height), ends)
    inside = np.zeros(theta.shape, dtype=int)
    for ray, low, high in zip(intervals.ray, intervals.low, intervals.high, strict=True):
        inside[ray] += (theta[ray] >= low) & (theta[ray] <= high)
    assert inside.max() == 1
    assert 0.2 < np.mean(lit[known]) < 0.9
    # Samples at the very ends of what is looked at or of a crossing may fall on either side.
    assert np.mean(inside.astype(bool)[known] != lit[known]) < 2e-3


def spot_frame(rng, tangent):
    axis, up, across = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return across * tangent, up * tangent, axis


def cube_directions(size):
    """Return axis + u across + v up at the corners of the texels of six faces, written out face by face."""
    at = np.linspace(-1, 1, size + 1)
    v, u = np.meshgrid(at, at, indexing="ij")
    unit = np.ones_like(u)
    faces = [(unit, u, v), (-unit, u, v), (v, unit, u), (v, -unit, u), (u, v, unit), (u, v, -unit)]
    return np.stack([np.stack(face, axis=-1) for face in faces])


def same_on_common_edges(distance, size):
    """Give corners in the same direction the distance of the first of them."""
    keys = np.round(cube_directions(size).reshape(-1, 3) * size).astype(int)
    _, first, back = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return distance[first][back.ravel()]


def points_on(origin, direction, foot, height, light):
    """Return points of rays as seen from the light, (rays, points, 3), and their angles, (rays, points)."""
    first = theta_of_x(0, foot, height)[:, None]
    theta = first + (0.4999 * np.pi - first) * (np.arange(400) + 0.5) / 400
    x = x_of_theta(theta, foot[:, None], height[:, None])
    return origin[:, None] + x[..., None] * direction[:, None] - light.position, theta


def before_triangles(shadow_map, away):
    """Return whether points lie before the triangles of a map in space, and whether there is a triangle at all."""
    size = shadow_map.size
    if shadow_map.projection.basis is None:
        k = cube_directions(size)
    else:
        at = np.linspace(-1, 1, size + 1)
        v, u = np.meshgrid(at, at, indexing="ij")
        across, up, axis = shadow_map.projection.basis
        k = (axis + u[..., None] * across + v[..., None] * up)[None]
    s = np.linalg.norm(k, axis=-1) / shadow_map.distance.reshape(k.shape[:3])
    lit, known = np.zeros(away.shape[:2], bool), np.zeros(away.shape[:2], bool)
    for face in range(len(k)):
        for row in range(size):
            for column in range(size):
                for other in ((0, 1), (1, 0)):
                    corners = [(row, column), (row + other[0], column + other[1]), (row + 1, column + 1)]
                    vertices = np.stack([k[face, i, j] for i, j in corners], axis=1)
                    mu = away @ np.linalg.inv(vertices).T
                    within = (mu >= 0).all(axis=-1)
                    known |= within
                    lit |= within & (mu @ [s[face, i, j] for i, j in corners] < 1)
    return lit, known


@pytest.mark.claim("error-by-size-of-the-map")
@pytest.mark.parametrize("what", ["point", "soft spot", "coloured extinction"])
def test_errors_fall_with_the_map_size(variant, what):
    """An edge is misplaced by a texel at most, so the error halves with it, give or take where edges fall in texels."""
    description = tiny_scene(size=(32, 24), **variations()[what])
    coarse, fine = (twin_error(description, size).relative_rmse for size in (16, 256))
    assert coarse < 0.05
    assert fine < coarse / 8


def test_lights_add_up(variant):
    import mitsuba as mi

    scene = mi.load_dict(tiny_scene(second=spot()))
    truth, maps = read_truth(scene), maps_of(scene, 16)
    each = [
        oracle_airlight(replace(truth, lights=(light,)), [shadow_map])
        for light, shadow_map in zip(truth.lights, maps, strict=True)
    ]
    assert all(np.max(image) > 0 for image in each)
    assert oracle_airlight(truth, maps) == pytest.approx(sum(each), rel=1e-14)


def test_what_cannot_be_done_is_refused(variant):
    import mitsuba as mi

    scene = mi.load_dict(tiny_scene())
    with pytest.raises(InputError, match="got 0 shadow maps for 1 lights"):
        oracle_airlight(read_truth(scene), [])
    with pytest.raises(InputError, match="got a distance of 0, wanted distances above 0"):
        height_field(ShadowMap(4, np.zeros(150), Projection(None)))
    sphere = bounded_medium({"type": "sphere", "center": [0, 0, 1], "radius": 0.3}, 0.4, (0.9, 0.9, 0.9))
    sphere["exterior"] = {"type": "ref", "id": "fog"}
    bounded = mi.load_dict(tiny_scene(ball=sphere))
    with pytest.raises(InputError, match="medium 'ball' has bounds"):
        oracle_airlight(read_truth(bounded), maps_of(scene, 4))
