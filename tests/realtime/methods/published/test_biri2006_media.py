# SPDX-License-Identifier: BSD-3-Clause
"""A constant distance from the light in bounded media: what section 4.2 of Biri 2006
means, and what it prints.
"""

import mitsuba as mi
import numpy as np
import pytest
from scipy.integrate import quad

from airlight.errors import InputError
from airlight.reference.scene.read import read_reference
from tests.helpers import frames
from tests.helpers.frames import relative_rmse
from tests.helpers.scenes import bounded_medium, clear_scene

CENTRE, RADIUS, SIGMA, MEAN = np.array([-0.2, 0.4, 0.7]), 0.6, 0.7, 1.2 * 0.6


def render(scene, kernel, **parameters):
    return frames.render(
        scene, "shadow-planes-2006", kernel=kernel, precision="double", **parameters
    ).airlight


def ball(**phase):
    shape = {"type": "sphere", "center": CENTRE.tolist(), "radius": RADIUS}
    return bounded_medium(shape, SIGMA, (0.9, 0.4, 0.3), **phase)


def by_hand(scene, exponent, p):
    """Integrate exp(-exponent(x, r, foot, height, enter)) p/r^2 over every
    chord by adaptive quadrature.
    """
    reference = read_reference(mi.load_dict(scene))
    light = reference.lights[0]
    image = np.zeros(len(reference.direction))
    for pixel, direction in enumerate(reference.direction):
        toward = CENTRE - reference.origin
        middle = toward @ direction
        half = RADIUS**2 - (toward @ toward - middle**2)
        if half <= 0:
            continue
        enter, leave = middle - np.sqrt(half), middle + np.sqrt(half)
        away = light.position - reference.origin
        foot = away @ direction
        height = np.sqrt(away @ away - foot**2)

        def integrand(x, foot=foot, height=height, enter=enter):
            r = np.hypot(x - foot, height)
            return np.exp(-exponent(x, r, foot, height, enter)) * p((foot - x) / r) / r**2

        image[pixel] = quad(integrand, enter, leave, epsabs=0, epsrel=1e-11)[0]
    scale = np.array([0.9, 0.4, 0.3]) * SIGMA * light.intensity / (4 * np.pi)
    return image.reshape(reference.height, reference.width, 1) * scale


def meant(x, r, foot, height, enter):
    return SIGMA * (x - enter + MEAN)


def printed(x, r, foot, height, enter):
    # (sin theta + 1)/cos theta with theta the angle at the light from the foot.
    return SIGMA * (foot + MEAN - enter + MEAN * (r + x - foot) / height)


@pytest.mark.claim(
    "polynomial-of-bounded-media",
    "mean-distance-of-the-paper",
    tolerance="relative RMSE 1e-4 of nodes and degree 25",
)
@pytest.mark.parametrize(("form", "exponent"), [("paper", meant), ("printed", printed)])
@pytest.mark.parametrize("phase", [pytest.param("isotropic", marks=pytest.mark.slow), "rayleigh"])
def test_both_forms_are_their_integrals_by_nodes_and_by_a_polynomial(
    variant, form, exponent, phase
):
    # The chords pass their feet within 45 degrees at the light, where the series converge fast.
    lamp = clear_scene()["lamp"] | {"position": [-0.1, 0.5, 2.7]}
    scene = clear_scene(lamp=lamp, ball=ball(phase={"type": phase}))
    p = {"isotropic": lambda c: 1.0, "rayleigh": lambda c: 0.75 * (1 + c * c)}[phase]
    expected = by_hand(scene, exponent, p)
    assert (expected > 0).sum() > 30
    assert relative_rmse(render(scene, "exact", media=form), expected) < 1e-4
    assert relative_rmse(render(scene, "taylor-25", media=form), expected) < 1e-4
    few = relative_rmse(render(scene, "taylor-1", media=form), expected)
    more = relative_rmse(render(scene, "taylor", media=form), expected)
    assert 1e-7 < more < 0.2 * few


@pytest.mark.claim("polynomial-of-bounded-media")
def test_a_polynomial_kernel_is_asked_for_a_constant_distance_and_by_no_other_method(variant):
    scene = clear_scene(ball=ball())
    exact, asked = render(scene, "exact", media="exact"), render(scene, "taylor", media="paper")
    assert relative_rmse(asked, exact) > 0.05
    wrong = render(scene, "taylor-printed", media="printed")
    # c_2 of the isotropic function is misprinted: a^2 - a for half of it.
    assert relative_rmse(wrong, render(scene, "taylor", media="printed")) > 1e-3
    for kernel in ("taylor", "quadrature"):
        with pytest.raises(
            InputError, match=f"kernel: got {kernel}, which is of one medium without bounds"
        ):
            frames.render(scene, "shadow-planes", kernel=kernel)
