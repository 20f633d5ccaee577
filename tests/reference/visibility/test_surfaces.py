# SPDX-License-Identifier: BSD-3-Clause
"""Claim: distances to surfaces are exact to float64, and where Mitsuba starts its shadow
rays an exact test follows.
"""

import mitsuba as mi
import numpy as np
import pytest

from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.quadrature.surface import surface_hits
from airlight.reference.scene.read import read_reference
from airlight.reference.scene.shapes import read_shapes
from airlight.reference.visibility.certificate import reached_by_shadow_rays, segments_blocked
from airlight.reference.visibility.distances import exact_distance, to_plane
from tests.helpers.scenes import tiny_scene


def test_distance_to_a_plane_is_exact(variant):
    reference = read_reference(mi.load_dict(tiny_scene(ball=None)))
    hits = surface_hits(reference)
    distance = exact_distance(reference, hits.interaction, hits.distance)
    met = np.isfinite(hits.distance)
    assert met.sum() > 50
    assert distance[met] == pytest.approx(
        (-reference.origin[2] / reference.direction[:, 2])[met], rel=1e-14
    )
    assert np.isinf(distance[~met]).all()


def test_a_distance_whose_digits_are_lost_is_found_again():
    """Right before a large triangle far from the origin single precision has few digits; a line
    that passes beside the triangle has no better distance.
    """
    corner = np.array([[-1.0, -1.0, 0.05], [1.0, -1.0, 0.05], [0.0, 2.0, 0.05]])
    direction = np.array([[0.0, 0.0, 1.0], [4.0, 0.0, 0.05]])
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    cast = np.array([0.052, 3.0])
    distance = to_plane(np.stack([corner, corner]), direction, cast)
    assert distance == pytest.approx([0.05, 3.0], rel=1e-14)


@pytest.mark.parametrize("inside", [False, True], ids=["outside", "inside"])
def test_distance_to_a_sphere_is_exact(variant, inside):
    """The points lie on the sphere in float64, and they are those that were cast."""
    sphere = (
        {"type": "sphere", "center": [0.1, -3.9, 1.2], "radius": 1.9}
        if inside
        else tiny_scene()["ball"]
    )
    reference = read_reference(mi.load_dict(tiny_scene(ball=sphere, floor=None)))
    hits = surface_hits(reference)
    distance = exact_distance(reference, hits.interaction, hits.distance)
    met = np.isfinite(hits.distance)
    assert met.all() if inside else 5 < met.sum() < 100
    shapes = read_shapes(reference.occluders)
    point = reference.origin + distance[met, None] * reference.direction[met]
    assert np.linalg.norm(point - shapes.centre, axis=1) == pytest.approx(
        shapes.radius.item(), rel=1e-14
    )
    assert distance[met] == pytest.approx(hits.distance[met], rel=1e-5)
    assert np.isinf(distance[~met]).all()


# Where Mitsuba starts its shadow rays: edges that move --------------------------------------------


LIGHT = np.array([1.0, 0.0, 3.0])
# from the edge of the shadow: less and more than half of what the rays start off the floor [m]
NEAR, FAR = 2e-5, 1e-3


def half_covered_floor():
    """A floor whose left is shadowed: the edge of a roof at x = 0, one above it,
    has its shadow at x = -1/2.
    """
    to_roof = mi.ScalarTransform4f().translate([-2, 0, 1]).scale([2, 3, 1])
    return mi.load_dict(
        {
            "type": "scene",
            "floor": {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale([3, 3, 1])},
            "roof": {"type": "rectangle", "to_world": to_roof},
        }
    )


def on_the_floor(scene, x):
    point = mi.Point3f(mi.Float(x), 0.1, 0.4)  # below the roof
    return scene.ray_intersect(mi.Ray3f(point, mi.Vector3f(0, 0, -1)))


@pytest.mark.claim("shadow-rays-start-off-the-surface")
def test_edges_of_shadows_move(variant):
    scene = half_covered_floor()
    x = -0.5 + np.array([-FAR, NEAR, FAR])
    interaction = on_the_floor(scene, x)
    # By hand: rays start 1e-4 (1 + 0.5) up, where the shadow ends 7.5e-5 further to the right.
    corrected = reached_by_shadow_rays(
        interaction, LIGHT, np.array([False, True, True]), scene=scene, shapes=read_shapes(scene)
    )
    assert corrected.tolist() == [False, False, True]


def test_segments_are_blocked_as_rays_are(variant):
    """Against Mitsuba's rays, among triangles and spheres of all sizes; float32 errs on
    edges, one in a million.
    """
    scene = mi.load_dict(tiny_scene())
    shapes = read_shapes(read_reference(scene).occluders)
    random = np.random.default_rng(5)
    start, end = random.uniform(-1.3, 1.3, (2, 4000, 3)) + np.array([0, 0, 0.6])
    way = end - start
    length = np.linalg.norm(way, axis=1)
    ray = mi.Ray3f(mi.Point3f(start.T), mi.Vector3f((way / length[:, None]).T))
    ray.maxt = mi.Float(length)
    cast = np.array(read_reference(scene).occluders.ray_test(ray), dtype=bool)
    assert 0.1 < cast.mean() < 0.9
    assert np.sum(segments_blocked(start, end, shapes) != cast) <= 2


@pytest.mark.claim("shadow-rays-start-off-the-surface")
def test_the_reference_of_a_renderer_with_an_epsilon_has_its_edges(variant):
    """A camera that sees nothing but the band between the two edges: lit in the reference,
    dark for such a renderer.
    """
    to_roof = mi.ScalarTransform4f().translate([-2, 0, 1]).scale([2, 3, 1])
    camera = mi.ScalarTransform4f().look_at(
        origin=[-0.5 + NEAR, 0.1, 0.4], target=[-0.5 + NEAR, 0.1, 0.0], up=[0, 1, 0]
    )
    scene = tiny_scene(
        size=(1, 1),
        ball=None,
        lamp=None,
        floor={"type": "rectangle", "to_world": mi.ScalarTransform4f().scale([3, 3, 1])},
        roof={"type": "rectangle", "to_world": to_roof},
        light={"type": "point", "position": LIGHT.tolist(), "intensity": 3.0},
    )
    scene["sensor"] = scene["sensor"] | {"to_world": camera}
    reference = read_reference(mi.load_dict(scene))
    assert quadrature_image(reference).surface.min() > 0
    assert np.all(quadrature_image(reference, shadow_scale=0.999).surface == 0)
