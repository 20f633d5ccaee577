# SPDX-License-Identifier: BSD-3-Clause
"""The marcher of Billeter 2010: samples of the visibility, and one integral
for each run of lit cells.

Protects the claim that `sum=transitions` is that baseline: no error without
shadows, order 1 with them.
"""

import mitsuba as mi
import numpy as np
import pytest

from airlight.reference.scene.read import read_reference
from tests.helpers.frames import frame, relative_rmse
from tests.helpers.scenes import bounded_medium, clear_scene, spot, tiny_scene


def render(method, *, scene, precision="double", **parameters):
    return frame(scene, method, precision=precision, **parameters).airlight


def lit_by_hand(points, light, centre, radius):
    """Return whether no ball lies between points and the light, by the distance of its
    centre from the segment.
    """
    way = light - points
    fraction = np.clip(np.sum((centre - points) * way, axis=-1) / np.sum(way * way, axis=-1), 0, 1)
    return np.linalg.norm(points + fraction[..., None] * way - centre, axis=-1) > radius


def runs_by_hand(scene, distance, steps, spacing):
    """Add up, cell by cell, twelve Gauss nodes of the integrand where the
    middle of the cell is lit.
    """
    reference = read_reference(mi.load_dict(scene))
    light, centre, radius = (
        reference.lights[0],
        np.array(scene["ball"]["center"]),
        scene["ball"]["radius"],
    )
    sigma, albedo = reference.medium.sigma_t, reference.medium.albedo
    nodes, weights = np.polynomial.legendre.leggauss(12)
    image = np.zeros((len(reference.direction), 3))
    for pixel, (direction, end) in enumerate(
        zip(reference.direction, distance.ravel(), strict=True)
    ):
        foot = (light.position - reference.origin) @ direction
        height = np.linalg.norm(light.position - reference.origin - foot * direction)
        angles = np.arctan2(np.array([0.0, end]) - foot, height)
        ends = np.array([0.0, end]) if spacing == "uniform" else angles
        edges = ends[0] + np.arange(2 * steps + 1) / (2 * steps) * (ends[1] - ends[0])
        x = edges if spacing == "uniform" else foot + height * np.tan(edges)
        lit = lit_by_hand(
            reference.origin + x[1::2, None] * direction, light.position, centre, radius
        )
        for number in np.flatnonzero(lit):
            begin, close = x[2 * number], x[2 * number + 2]
            at = 0.5 * (begin + close) + 0.5 * (close - begin) * nodes
            r = np.hypot(at - foot, height)
            value = np.exp(-sigma[:, None] * (at + r)) / r**2
            image[pixel] += value @ weights * 0.5 * (close - begin)
    scale = albedo * sigma * light.intensity / (4 * np.pi)
    return (scale * image).reshape(reference.height, reference.width, 3)


@pytest.mark.claim(
    "billeter-marcher", tolerance="relative RMSE 1e-5 of twelve nodes in every lit cell"
)
@pytest.mark.parametrize("spacing", ["uniform", "equiangular"])
def test_transitions_are_integrals_over_the_cells_whose_middles_are_lit(variant, spacing):
    scene = tiny_scene(size=(10, 8))
    distance = frame(scene, "unshadowed", precision="double").distance
    seen = np.isfinite(distance)
    marched = render("ray-march", scene=scene, steps=17, spacing=spacing, sum="transitions")
    expected = runs_by_hand(scene, np.where(seen, distance, 1.0), 17, spacing)
    # Mitsuba's distances and shadow rays are float32; no sample lies that close
    # to an edge of the shadow.
    assert relative_rmse(marched[seen], expected[seen]) < 1e-5
    assert relative_rmse(render("unshadowed", scene=scene)[seen], expected[seen]) > 0.01


@pytest.mark.claim("billeter-marcher", tolerance="1e-12 relative")
@pytest.mark.parametrize(
    ("name", "spacing"), [("soft spot", "equiangular"), ("bounded", "uniform")]
)
def test_without_shadows_the_kernel_is_all(variant, name, spacing):
    fog = bounded_medium(
        {"type": "sphere", "center": [0.1, 0.2, 0.7], "radius": 0.6}, 0.9, (0.9, 0.4, 0.3)
    )
    scene = (
        tiny_scene(ball=None, lamp=spot(beam=11.0))
        if name == "soft spot"
        else clear_scene(ball=fog)
    )
    whole = render("unshadowed", scene=scene)
    runs = render(
        "ray-march", scene=scene, steps=3, spacing=spacing, sum="transitions", shadow="none"
    )
    np.testing.assert_allclose(runs, whole, rtol=1e-9, atol=1e-12 * whole.max())


@pytest.mark.slow
@pytest.mark.claim("billeter-marcher", tolerance="0.25 of the order 1")
def test_with_shadows_the_order_is_one(variant):
    scene = tiny_scene(size=(48, 36))
    reference = render("ray-march", scene=scene, steps=6000, sum="transitions")
    steps = np.array([12, 48, 192])
    errors = [
        relative_rmse(
            render("ray-march", scene=scene, steps=int(n), spacing="uniform", sum="transitions"),
            reference,
        )
        for n in steps
    ]
    order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(1, abs=0.25)


@pytest.mark.parametrize(
    ("method", "parameters"),
    [
        ("ray-march", {"spacing": "uniform", "steps": 400}),
        ("soft-shafts", {"filter": "none", "steps": 400}),
    ],
)
def test_rays_that_meet_no_medium_and_no_surface_are_black(variant, method, parameters):
    """Equal steps of an unbounded ray past all media had the length -inf: `random:19` was
    not finite in all pixels.
    """
    ball = {"type": "sphere", "center": [0.2, 0.1, 0.7], "radius": 0.4}
    scene = clear_scene(pearl=bounded_medium(ball, 0.9, (0.9, 0.4, 0.3)))
    image = render(method, scene=scene, precision="single", **parameters)
    wanted = render("unshadowed", scene=scene)
    assert (wanted == 0).any()
    assert (image[wanted == 0] == 0).all()
    assert relative_rmse(image, wanted) < 1e-2
