# SPDX-License-Identifier: BSD-3-Clause
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.integrate import quad

from reference.quadrature.image import quadrature_image
from reference.scene.read import read_reference
from tests.helpers.scenes import spot, tiny_scene


def reference_of(**changes):
    reference = read_reference(mi.load_dict(tiny_scene(**changes)))
    return reference, quadrature_image(reference)


@pytest.mark.claim("radiance", "attenuation-and-falloff", tolerance="1e-9 relative")
def test_unshadowed_pixels_are_the_adaptive_integral(variant):
    """Against scipy's adaptive quadrature of the distance form, pixel by pixel."""
    reference, image = reference_of(ball=None, floor=None, size=(4, 3))
    light, sigma_t = reference.lights[0], reference.medium.sigma_t[0]
    for pixel, direction in enumerate(reference.direction):

        def integrand(x, direction=direction):
            r = np.linalg.norm(reference.origin + x * direction - light.position)
            return np.exp(-sigma_t * (x + r)) / r**2

        foot = direction @ (light.position - reference.origin)
        value = quad(integrand, 0, 2 * max(foot, 1), points=[foot], epsrel=1e-11, limit=400)[0]
        value += quad(integrand, 2 * max(foot, 1), np.inf, epsrel=1e-11, limit=400)[0]
        expected = reference.medium.albedo * sigma_t * light.intensity * value / (4 * np.pi)
        assert image.airlight.reshape(-1, 3)[pixel] == pytest.approx(expected, rel=1e-9)


@pytest.mark.claim("attenuation-and-falloff", "bound-in-every-pixel", tolerance="3e-5 relative")
def test_shadow_of_a_sphere_against_its_closed_form(variant):
    """The shadow of a sphere is a cone cut by a cap: the lit set of a ray in closed form, sampled finely.

    A point P is in shadow where the segment from the light to P meets the sphere. The airlight is then an integral
    with the indicator of that set, by the midpoint rule with 200 000 steps in theta.
    """
    reference, image = reference_of(floor=None, size=(12, 9))
    light, sigma_t = reference.lights[0], reference.medium.sigma_t[0]
    centre, radius = np.array([0.1, 0.1, 0.7]), 0.41
    to_centre = centre - light.position
    steps = 200_000
    for pixel in (3, 40, 53, 66, 90):
        direction = reference.direction[pixel]
        foot = direction @ (light.position - reference.origin)
        n = reference.origin + foot * direction - light.position
        height = np.linalg.norm(n)
        end = image.distance.reshape(-1)[pixel]
        high = np.pi / 2 if np.isinf(end) else np.arctan2(end - foot, height)
        low = np.arctan2(-foot, height)
        theta = low + (high - low) * (np.arange(steps) + 0.5) / steps
        away = np.sin(theta)[:, None] * direction + np.cos(theta)[:, None] * n / height
        r = height / np.cos(theta)
        along = away @ to_centre
        reach = radius**2 - (to_centre @ to_centre - along**2)
        shadowed = (reach > 0) & (along > 0) & (along - np.sqrt(np.maximum(reach, 0)) < r)
        x = foot + height * np.tan(theta)
        value = np.sum(np.exp(-sigma_t * (x + r)) * ~shadowed) * (high - low) / steps / height
        expected = reference.medium.albedo * sigma_t * light.intensity * value / (4 * np.pi)
        # One step more or less at an edge, and the float32 surface of the sphere that Embree sees.
        assert image.airlight.reshape(-1, 3)[pixel] == pytest.approx(expected, rel=3e-5), pixel
    assert image.transitions > 0


@pytest.mark.claim("lit-surface", tolerance="1e-5 relative: float32")
@pytest.mark.parametrize("kind", ["point", "spot"])
def test_surface_is_mitsubas_direct_integrator(variant, kind):
    """In a vacuum the lit surface is what Mitsuba's `direct` integrator renders at the pixel centres."""
    changes = {} if kind == "point" else {"lamp": spot(beam=20.0)}
    scene = mi.load_dict(tiny_scene(fog=tiny_scene()["fog"] | {"sigma_t": 0.0}, **changes))
    reference = read_reference(scene)
    image = quadrature_image(reference)
    integrator = mi.load_dict({"type": "direct", "bsdf_samples": 0, "emitter_samples": 1})
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(1, reference.width * reference.height)
    ray = mi.Ray3f(mi.Point3f(*(float(c) for c in reference.origin)), dr.normalize(mi.Vector3f(reference.direction.T)))
    expected, _, _ = integrator.sample(scene, sampler, mi.RayDifferential3f(ray))
    expected = np.array(expected, dtype=np.float64).T.reshape(image.surface.shape)
    assert image.surface == pytest.approx(expected, rel=1e-5, abs=1e-9)  # the same float32 operations, in another order
    assert expected.max() > 0
    assert image.airlight.max() == 0
