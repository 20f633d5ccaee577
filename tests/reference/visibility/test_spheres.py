# SPDX-License-Identifier: BSD-3-Clause
import mitsuba as mi
import numpy as np
import pytest

from reference.scene.read import read_truth
from reference.scene.shapes import read_shapes
from reference.visibility.lit_intervals import lit_intervals, point_leg
from reference.visibility.random_checks import checked_geometry
from reference.visibility.spheres import sphere_shadows
from reference.visibility.triangles import EXACT_EDGE, geometric_intervals
from tests.helpers.polygons import rays_of, visibility_test
from tests.helpers.scenes import tiny_scene


def random_rays(count, seed):
    """Return rays past a light at the origin: directions, normals to the foot points, heights."""
    generator = np.random.default_rng(seed)
    direction, other = generator.normal(size=(2, count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    normal = np.cross(direction, other)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return direction, normal, generator.uniform(0.05, 4.0, count)


def surface_crossed(point, centre, radius):
    """Return whether the segments from the origin to points cross a sphere, by distances alone.

    From outside: the point of the segment that is nearest to the centre is within the radius. From inside: the end is
    beyond it.
    """
    if np.linalg.norm(centre) < radius:
        return np.linalg.norm(point - centre, axis=-1) > radius
    share = np.clip(point @ centre / np.sum(point**2, axis=-1), 0, 1)
    return np.linalg.norm(share[..., None] * point - centre, axis=-1) < radius


@pytest.mark.claim("exact-shadows", tolerance="1e-9 of an angle about each edge")
@pytest.mark.parametrize("radius", [0.02, 0.7, 1.69, 1.71, 3.0], ids=["small", "plain", "close", "inside", "large"])
def test_samples_against_the_definition(radius):
    """Random points of random rays; the light is 1.7 from the centre, so in the last two it is inside of the sphere."""
    centre = np.array([0.5, 1.5, np.sqrt(1.7**2 - 2.5)])
    direction, normal, height = random_rays(3000, 5)
    ray, low, high = sphere_shadows((centre[None], np.array([radius])), direction, normal, height)
    assert len(ray) > 10
    assert np.all(low <= high)
    assert np.all(np.abs(np.stack([low, high])) <= 0.5 * np.pi)
    theta = np.random.default_rng(6).uniform(-0.5 * np.pi, 0.5 * np.pi, (3000, 200))
    # Around each edge too: what is 1e-9 of an angle inside is hidden, what is 1e-9 outside is not.
    for edge in (low, high):
        theta[ray, :2] = np.where(np.abs(edge) < 1.5, edge, 0)[:, None] + np.array([-1e-9, 1e-9])
        hidden = np.zeros(theta.shape, bool)
        for r, a, b in zip(ray, low, high, strict=True):
            hidden[r] |= (theta[r] > a) & (theta[r] < b)
        point = height[:, None, None] * (direction[:, None] * np.tan(theta)[..., None] + normal[:, None])
        wrong = hidden != surface_crossed(point, centre, radius)
        # 3e-9 of the rays' planes touch the sphere so closely that an angle is worth less than 1e-9.
        assert wrong.sum() <= 1


def test_in_the_plane_of_the_centre():
    """Sphere, ray and light in one plane: tangents at asin(R/D), and a ray through it enters where it should."""
    direction, normal = np.array([[0.0, 0.0, 1.0]]), np.array([[0.0, 1.0, 0.0]])
    centre = np.array([[0.0, 1.0, 0.5]])
    ray, low, high = sphere_shadows((centre, np.array([0.3])), direction, normal, np.array([5.0]))
    middle, half = np.arctan2(0.5, 1.0), np.arcsin(0.3 / np.hypot(1, 0.5))
    assert (ray.tolist(), low, high) == ([0], pytest.approx([middle - half]), pytest.approx([middle + half]))
    _, low, high = sphere_shadows((centre, np.array([0.3])), direction, normal, np.array([0.75]))
    chord = np.sqrt(0.3**2 - 0.25**2)
    assert low == pytest.approx(np.arctan2([0.5 - chord], 0.75), rel=1e-14)
    assert high == pytest.approx(np.arctan2([0.5 + chord], 0.75), rel=1e-14)
    for hidden_from in (np.array([0.6]), np.array([0.699])):
        assert not len(sphere_shadows((centre, np.array([0.3])), direction, normal, hidden_from)[0])


@pytest.mark.claim("shadow-ray-certificate")
@pytest.mark.parametrize("place", ["outside", "light", "camera", "both"])
def test_random_shadow_rays_contradict_nothing(variant, place):
    """Spheres, one around the light, the camera or both of them: no shadow ray of Mitsuba says otherwise."""
    from dataclasses import replace

    shells = {
        "light": {"type": "sphere", "center": [0.8, 0.8, 1.7], "radius": 0.6},
        "camera": {"type": "sphere", "center": [0.3, -4.0, 1.2], "radius": 0.9},
        "both": {"type": "sphere", "center": [0.3, -1.6, 1.2], "radius": 4.0, "flip_normals": True},
    }
    more = {} if place == "outside" else {"shell": shells[place]}
    second = {"type": "sphere", "center": [0.5, 0.2, 1.3], "radius": 0.15}
    truth = read_truth(mi.load_dict(tiny_scene(second=second, size=(32, 24), **more)))
    light, rays, ends = rays_of(truth)
    intervals = lit_intervals(truth, light, rays, ends=ends, samples=800)
    assert intervals.edge == EXACT_EDGE
    assert intervals.random_checks.checked == 100 * np.sum(ends[1] > ends[0])
    assert intervals.random_checks.left == 0
    assert intervals.random_checks.missed < 1e-4  # float32 rays where a plane grazes a sphere, settled in float64
    assert (intervals.transitions > 100) == (place in ("outside", "both"))
    # Were the second sphere forgotten, the check would tell.
    shapes = read_shapes(truth.occluders)
    keep = shapes.radius != shapes.radius.min()
    fewer = replace(shapes, centre=shapes.centre[keep], radius=shapes.radius[keep])
    wrong = geometric_intervals(truth, light, rays, ends=ends, shapes=fewer)
    visible = visibility_test(truth.occluders, light.position, rays)
    left = checked_geometry(
        wrong, visible, (point_leg(light.position, rays), shapes), ends=ends, checks=100
    ).random_checks.left
    assert (left > 50) == (place in ("outside", "both"))
