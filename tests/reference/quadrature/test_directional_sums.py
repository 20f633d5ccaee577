# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of directional lights in bodies of media, against sums and closed forms that share nothing with it."""

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

from reference.quadrature.image import quadrature_image
from reference.quadrature.ray_values import ray_values
from reference.scene.read import read_reference
from tests.helpers.suns import BRICK, CHORDS, brick, pearl, plain_airlight, sun, sunny

HG = {"phase": {"type": "hg", "g": 0.6}}
TABLE = {"phase": {"type": "tabphase", "values": "0.5, 0.2, 0.4, 1.7"}}


def reference_and_image(scene, **settings):
    reference = read_reference(mi.load_dict(scene))
    return reference, quadrature_image(reference, **settings)


CASES = {
    "box": lambda: sunny(brick=brick(**HG)),
    "ball": lambda: sunny(pearl=pearl(**HG)),
    "one in the light of the other": lambda: sunny(brick=brick(**TABLE), pearl=pearl(3.1), sun=sun([1.0, 0.07, -0.11])),
    "the other way round": lambda: sunny(brick=brick(2.9), pearl=pearl(**TABLE), sun=sun([-1.0, 0.07, -0.11])),
    "light along an axis": lambda: sunny(brick=brick(), pearl=pearl(), sun=sun([-1.0, 0.0, 0.0])),
    "towards the camera": lambda: sunny(brick=brick(**HG), pearl=pearl(), sun=sun([-0.07, -1.0, -0.1])),
}


FAST = ("one in the light of the other", "light along an axis", "towards the camera")


@pytest.mark.claim("directional-reference", tolerance="2e-8 relative, 2e-5 along an axis: the steps' own")
@pytest.mark.parametrize("case", [pytest.param(case, marks=[] if case in FAST else pytest.mark.slow) for case in CASES])
def test_airlight_is_the_sum_over_small_steps(variant, case):
    """Rationale: nothing is shared with the estimator but the rays: own chords, own rule, no kinks looked for.

    Expected: to 2e-8; the rule's error at a kink is of the order of 1/200000^2, at a tangent of a sphere 1/200000^1.5,
    where the light enters a face or passes beside it 1/200000.
    """
    rtol = 2e-5 if case == "light along an axis" else 2e-8
    reference, image = reference_and_image(CASES[case]())
    airlight, bound = image.airlight.reshape(-1, 3), image.airlight_bound.reshape(-1, 3)
    lit = np.flatnonzero(airlight.max(axis=1) > 0)
    assert len(lit) >= 3
    for pixel in lit[:: max(1, len(lit) // 3)]:
        assert airlight[pixel] == pytest.approx(plain_airlight(reference, pixel), rel=rtol), pixel
    assert np.all(bound[lit] <= 2e-9 * airlight[lit])
    assert np.all(bound[lit] > 0)


@pytest.mark.claim("directional-reference", tolerance="1e-12 relative")
@pytest.mark.parametrize("way", ["across", "with the ray", "against it"])
def test_ray_through_a_box_in_closed_form(variant, way):
    """Light that falls on the box's upper face, along the ray's own direction, and against it.

    From above: the leg of depth z below the upper face; along the ray both depths add up to that of the chord, or the
    leg is as long as the way of the view.
    """

    origin, direction = np.array([-0.5, -2.0, 0.71875]), np.array([0.0, 1.0, 0.0])
    directions = {"across": [0.0, 0.0, -1.0], "with the ray": [0.0, 1.0, 0.0], "against it": [0.0, -1.0, 0.0]}
    reference, _ = reference_and_image(sunny(brick=brick(**HG), sun=sun(directions[way])))
    around = replace(reference, origin=origin, direction=direction[None], width=1, height=1)
    values = ray_values(around)
    (medium,) = reference.media
    sigma_t, length = medium.sigma_t, 2 * BRICK[1][1]
    cos_scatter = -float(np.dot(directions[way], direction))
    if way == "across":
        above = BRICK[0][2] + BRICK[1][2] - origin[2]
        integral = np.exp(-sigma_t * above) * (1 - np.exp(-sigma_t * length)) / sigma_t
    elif way == "with the ray":  # the leg goes back to the face at which the ray came in
        integral = (1 - np.exp(-2 * sigma_t * length)) / (2 * sigma_t)
    else:
        integral = np.exp(-sigma_t * length) * length
    g = float(np.float32(0.6))
    p = (1 - g * g) / (1 + g * g - 2 * g * cos_scatter) ** 1.5
    expected = reference.directional[0].irradiance / (4 * np.pi) * medium.albedo * sigma_t * p * integral
    assert values.airlight[0] == pytest.approx(expected, rel=1e-12)  # the closed form, but for rounding
    assert np.all(values.bound < 1e-6 * values.airlight)


def test_shadow_of_a_sphere_in_fog(variant):
    """A sphere between sun and box: points by the distance of its centre from their legs, and the plain sum."""
    centre, radius = np.array([-0.71875, 0.25, 1.21875]), 0.1875
    occluder = {"type": "sphere", "center": centre.tolist(), "radius": radius}
    reference, image = reference_and_image(sunny(brick=brick(), occluder=occluder))
    towards = -reference.directional[0].direction

    def lit(point):
        off = centre - point
        along = off @ towards
        return ~((along > 0) & (np.sum(off**2, axis=1) - along**2 < radius**2))

    airlight = image.airlight.reshape(-1, 3)
    pixels = np.flatnonzero(airlight.max(axis=1) > 0)
    shadowed = 0
    for pixel in pixels[::5]:
        expected = plain_airlight(reference, pixel, lit=lit)
        shadowed += int(np.any(expected < 0.999 * plain_airlight(reference, pixel)))
        # Both edges are met to half a step of 1/200000.
        assert airlight[pixel] == pytest.approx(expected, rel=1e-5), pixel
    assert shadowed >= 2
    assert image.checked > 0
    assert image.left == 0


def test_surface_is_attenuated_by_the_bodies_before_it_and_above(variant):
    """The floor below the sphere of fog: E cos albedo/pi, less the chords of the leg and of the view."""
    floor = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(6.3), "bsdf": {"type": "diffuse"}}
    reference, image = reference_and_image(sunny(pearl=pearl(), floor=floor))
    distance = image.distance.reshape(-1)
    hit = np.isfinite(distance)
    point = reference.origin + distance[hit, None] * reference.direction[hit]
    towards = np.broadcast_to(-reference.directional[0].direction, point.shape)
    depth = np.zeros(len(point))
    for origin, direction, end in (
        (reference.origin, reference.direction[hit], distance[hit]),
        (point, towards, np.inf),
    ):
        near, far = CHORDS["pearl"](origin, direction)
        depth += np.maximum(np.minimum(far, end) - np.maximum(near, 0), 0)
    clear = 0.5 / np.pi * towards[0, 2] * reference.directional[0].irradiance
    expected = clear * np.exp(-1.3 * depth)[:, None]
    assert np.sum(depth > 0.1) > 5
    assert image.surface.reshape(-1, 3)[hit] == pytest.approx(
        expected, rel=2e-5
    )  # surfaces are met in float32, and the sphere at a grazing angle
