# SPDX-License-Identifier: BSD-3-Clause
"""Images of the quadrature: against adaptive integrals, closed forms, Mitsuba's
direct light and brute force.
"""

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.integrate import quad

from airlight.reference.quadrature.image import quadrature_image, ray_values
from airlight.reference.quadrature.replicates import PointPlan, standard_error
from airlight.reference.scene.camera import film_directions
from airlight.reference.scene.read import read_reference
from tests.helpers.area_lights import fog, lamp, lit_scene, turned
from tests.helpers.polygons import box_scene
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
    """The shadow of a sphere is a cone cut by a cap: the lit set of a ray in
    closed form, sampled finely.

    A point P is in shadow where the segment from the light to P meets the sphere. The airlight is
    then an integral with the indicator of that set, by the midpoint rule with 200 000 steps in
    theta.
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
    """In a vacuum the lit surface is what Mitsuba's `direct` integrator
    renders at the pixel centres.
    """
    changes = {} if kind == "point" else {"lamp": spot(beam=20.0)}
    scene = mi.load_dict(tiny_scene(fog=tiny_scene()["fog"] | {"sigma_t": 0.0}, **changes))
    reference = read_reference(scene)
    image = quadrature_image(reference)
    integrator = mi.load_dict({"type": "direct", "bsdf_samples": 0, "emitter_samples": 1})
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(1, reference.width * reference.height)
    ray = mi.Ray3f(
        mi.Point3f(*(float(c) for c in reference.origin)),
        dr.normalize(mi.Vector3f(reference.direction.T)),
    )
    expected, _, _ = integrator.sample(scene, sampler, mi.RayDifferential3f(ray))
    expected = np.array(expected, dtype=np.float64).T.reshape(image.surface.shape)
    # the same float32 operations, in another order
    assert image.surface == pytest.approx(expected, rel=1e-5, abs=1e-9)
    assert expected.max() > 0
    assert image.airlight.max() == 0


@pytest.mark.claim("lit-surface", tolerance="the estimated error of the surface")
@pytest.mark.parametrize(("height", "most"), [(1.9, 2e-5), (0.004, 1e-2)])
def test_the_error_of_a_surface_covers_single_precision(variant, height, most):
    """A diffuse floor in float64: rho/pi cos I exp(-sigma_t (x + r)) / r^2.

    A lamp close above the floor lights it at grazing incidence, where the rounding of places counts
    most.
    """
    lamp = tiny_scene()["lamp"] | {"position": [0.9, 0.7, height]}
    reference, image = reference_of(ball=None, lamp=lamp)
    light, sigma_t = reference.lights[0], reference.medium.sigma_t[0]
    seen = np.isfinite(image.distance.ravel())
    direction = reference.direction[seen]
    x = -reference.origin[2] / direction[:, 2]
    r = np.linalg.norm(light.position - reference.origin - x[:, None] * direction, axis=1)
    arriving = light.position[2] / r**3 * np.exp(-sigma_t * (x + r))
    expected = np.array([0.4, 0.4, 0.5]) / np.pi * light.intensity * arriving[:, None]
    error = image.surface_error.reshape(-1, 3)[seen]
    assert np.all(np.abs(image.surface.reshape(-1, 3)[seen] - expected) <= error)
    assert 0 < (error / expected).max() < most
    assert image.surface_error.reshape(-1, 3)[~seen].max(initial=0.0) == 0


@pytest.mark.claim("lit-surface", tolerance="the estimated error of the surface")
@pytest.mark.parametrize("away", [2.0, 900.0])
def test_the_error_of_a_small_ball_covers_the_turn_of_its_normal(variant, away):
    """A diffuse ball of a hand's breadth in float64, near the origin and far from it.

    Its place is known to a rounding of its coordinates, and over its radius that turns the normal.
    """
    radius, centre = 0.06, np.array([away, 0.3, 0.2])
    camera = mi.ScalarTransform4f().look_at(
        (centre - [0.3, 0.9, -0.2]).tolist(), centre.tolist(), [0, 0, 1]
    )
    plain = tiny_scene()
    reference, image = reference_of(
        sensor=plain["sensor"] | {"to_world": camera, "fov": 6.0},
        ball=plain["ball"] | {"center": centre.tolist(), "radius": radius},
        lamp=plain["lamp"] | {"position": np.add(centre, [1.1, -1.7, 0.4]).tolist()},
        floor=None,
    )
    light, sigma_t = reference.lights[0], reference.medium.sigma_t[0]
    seen = np.isfinite(image.distance.ravel())
    ball = reference.occluders.shapes()[0]
    centre = np.array(mi.traverse(ball)["to_world"].matrix, dtype=np.float64).reshape(4, 4)[:3, 3]
    direction, to_centre = reference.direction[seen], centre - reference.origin
    middle = direction @ to_centre
    miss = np.linalg.norm(to_centre - middle[:, None] * direction, axis=1)
    x = middle - np.sqrt(np.maximum(radius**2 - miss**2, 0))
    point = reference.origin + x[:, None] * direction
    way = light.position - point
    r = np.linalg.norm(way, axis=1)
    cosine = np.sum(way * (point - centre), axis=1) / (r * radius)
    lit = (cosine > 0.05) & (miss < 0.9 * radius)  # beside the edges of the ball and of its light
    arriving = cosine / r**2 * np.exp(-sigma_t * (x + r))
    expected = np.array([0.6, 0.5, 0.3]) / np.pi * light.intensity * arriving[:, None]
    error = image.surface_error.reshape(-1, 3)[seen]
    assert lit.sum() > 30
    difference = np.abs(image.surface.reshape(-1, 3)[seen] - expected)
    assert np.all(difference[lit] <= error[lit])
    assert np.median((error / expected)[lit]) < 1e-5 * away


@pytest.mark.claim("lit-surface", tolerance="the estimated error of the surface")
@pytest.mark.parametrize(("cutoff", "beam"), [(33.0, 20.0), (2.0, 1.5), (0.3, 0.25)])
def test_the_error_of_a_surface_covers_the_edge_of_a_narrow_spot(variant, cutoff, beam):
    """A diffuse floor in float64 under a soft spot, whose angle Mitsuba takes from a float32 cosine
    close to 1.
    """
    camera = mi.ScalarTransform4f().look_at([0.3, -1.9, 1.3], [-0.009, 0.173, 0], [0, 0, 1])
    reference, image = reference_of(
        ball=None,
        lamp=spot(cutoff=cutoff, beam=beam),
        sensor=tiny_scene()["sensor"] | {"to_world": camera, "fov": min(2.3 * cutoff, 40.0)},
    )
    light, sigma_t = reference.lights[0], reference.medium.sigma_t[0]
    direction = reference.direction
    x = -reference.origin[2] / direction[:, 2]
    way = reference.origin + x[:, None] * direction - light.position
    r = np.linalg.norm(way, axis=1)
    angle = np.arccos(way @ light.axis / r)
    fall = np.clip((light.cutoff - angle) / (light.cutoff - light.beam), 0, 1)
    arriving = fall * light.position[2] / r**3 * np.exp(-sigma_t * (x + r))
    expected = np.array([0.4, 0.4, 0.5]) / np.pi * light.intensity * arriving[:, None]
    error, surface = image.surface_error.reshape(-1, 3), image.surface.reshape(-1, 3)
    assert np.sum((fall > 0) & (fall < 1)) > 20
    # Next to the cutoff the point that float32 rays meet decides whether it is lit.
    inside = np.abs(angle - light.cutoff) > 1e-5
    assert np.all((np.abs(surface - expected) <= error)[inside])
    assert error.max() < 0.1 * expected.max()


# Means over the area of pixels --------------------------------------------------------------------


OUT_OF_VIEW = {
    "type": "point",
    "position": [3.9, 0.7, 3.9],
    "intensity": {"type": "rgb", "value": [5.0, 4.0, 3.0]},
}


def scene_of(scene):
    return read_reference(mi.load_dict(scene))


def brute_force(reference, n, regular=False):
    """Return the means of n x n sub-pixels, a random point in each: airlight, surface,
    and the brightest surface.

    Regular points would all be wrong the same way where an edge runs along the rows; close to a
    light they are better, where a random one may come too close.
    """
    row, column = np.divmod(np.arange(reference.width * reference.height), reference.width)
    y, x = np.divmod(np.arange(n * n), n)
    u, v = (0.5, 0.5) if regular else np.random.default_rng(11).random((2, len(row), n * n))
    positions = np.stack(
        [column[:, None] + (x + u) / n, row[:, None] + (y + v) / n], axis=-1
    ).reshape(-1, 2)
    direction = film_directions(
        reference.scene.sensors()[0], positions, (reference.width, reference.height)
    )
    values = ray_values(replace(reference, direction=direction), checks=1)
    shape = (reference.height, reference.width, n * n, 3)
    surface = values.surface.reshape(shape)
    return values.airlight.reshape(shape).mean(axis=2), surface.mean(axis=2), surface.max()


@pytest.mark.claim(
    "pixel-area", tolerance="7.1 standard errors of 1e-4 relative, which a pilot foresees"
)
def test_smooth_fog_is_the_integral_over_the_pixel(variant):
    """Gauss's product rule with 12 x 12 points, converged for what is smooth:
    the light is out of view.
    """
    reference = scene_of(tiny_scene(ball=None, floor=None, lamp=OUT_OF_VIEW, size=(4, 3)))
    node, weight = np.polynomial.legendre.leggauss(12)
    node, weight = 0.5 * (node + 1), 0.5 * weight
    row, column = np.divmod(np.arange(12), 4)
    x, y = np.meshgrid(node, node)
    positions = np.stack([column[:, None] + x.ravel(), row[:, None] + y.ravel()], axis=-1).reshape(
        -1, 2
    )
    direction = film_directions(reference.scene.sensors()[0], positions, (4, 3))
    values = ray_values(replace(reference, direction=direction)).airlight.reshape(3, 4, 144, 3)
    expected = np.einsum("ijkc,k->ijc", values, np.outer(weight, weight).ravel())
    image = quadrature_image(reference, pixel="area", tolerance=1e-4, checks=1)
    error = np.abs(image.airlight - expected)
    # Student's value with seven degrees of freedom that one value in 10 000 exceeds, for 36 values.
    assert np.all(error <= 7.1 * image.airlight_se + image.airlight_error)
    # A pilot foresees the error from a few positions: 1e-4 in the mean, and not twice
    # and a half of it anywhere.
    stated = image.airlight_se / image.airlight
    assert np.sqrt(np.mean(stated**2)) < 1.5e-4
    assert stated.max() < 2.5e-4


@pytest.mark.claim("pixel-area", tolerance="2e-3 relative beside the bound")
@pytest.mark.parametrize("scene", [tiny_scene, box_scene], ids=["ball", "boxes"])
def test_edges_against_brute_force(variant, scene):
    reference = scene_of(scene(size=(8, 6)))
    image = quadrature_image(reference, checks=1, pixel="area")
    airlight, surface, brightest = brute_force(reference, 24)
    # The light is seen: in its pixel regular sub-pixels converge slowly.
    near = image.light_angle < 0.1
    # Of 24 x 24 random sub-pixels an edge crosses about 24 and leaves sqrt(24)/2/576 = 0.4 % of its
    # jump open; a jump may be larger than the pixel's value, the beam being in front of the light's
    # glow.
    error = np.abs(image.airlight - airlight)[~near]
    assert np.mean(error > 0.02 * airlight[~near] + 4 * image.airlight_se[~near]) == 0
    assert np.mean(error <= 2e-3 * airlight[~near] + 3 * image.airlight_se[~near]) > 0.9
    assert np.abs(image.airlight[~near].mean() / airlight[~near].mean() - 1) < 2e-3
    # The top of the beam, seen almost edge-on, is a strip of a 160th of a
    # pixel with a radiance of 0.2.
    assert np.abs(image.surface - surface).max() < 0.02 * (0.2 if scene is box_scene else brightest)
    assert np.abs(image.surface.mean() / surface.mean() - 1) < 0.01
    centre = quadrature_image(reference, checks=1)
    # the centre is another thing
    assert np.abs(centre.airlight - airlight)[~near].max() > 5 * error.max()


def test_errors_of_pixels_average_out(variant):
    """The variance of the mean over 192 pixels by that of uncorrelated errors is
    chi^2_7/7: 0.09 to 3.5 in 99.8 %.

    If pixels shared positions it would be 80. Two seeds differ by 7.1
    standard errors once in 10 000.
    """
    reference = scene_of(tiny_scene(ball=None, lamp=OUT_OF_VIEW, size=(16, 12)))
    images = [
        quadrature_image(reference, pixel="area", checks=1, plan=PointPlan(seed=seed))
        for seed in (1, 2)
    ]
    errors = [standard_error(image.replicate_means[0].T)[0] for image in images]
    for image, error in zip(images, errors, strict=True):
        alone = np.sqrt(np.sum(image.airlight_se[..., 0] ** 2)) / 192
        assert 0.09 < (error / alone) ** 2 < 3.5
    one, other = (image.airlight[..., 0].mean() for image in images)
    assert one != other
    assert abs(one - other) < 7.1 * np.hypot(*errors)


def test_light_that_is_seen_has_a_standard_error_over_pixels_alone(variant):
    """The edge of a lamp crosses the pixels: their means had no error of what is seen. Two seeds
    differ by 7.1 standard errors once in 10 000.
    """
    place = turned((0.1, 0.2, 3.0), 163, (0.8, 0.6, 1.0))
    scene = lit_scene(size=(1, 1), medium=fog(0.1, 0.5), lamp=lamp(to_world=place))
    reference = read_reference(scene)
    one, other = (
        quadrature_image(reference, pixel="area", tolerance=0.5, checks=1, plan=PointPlan(seed=n))
        for n in (1, 2)
    )
    apart = np.abs(one.emitted - other.emitted)
    spread = np.hypot(one.emitted_se, other.emitted_se)
    assert (apart > 0).any()
    assert (apart <= 7.1 * spread).all()
    assert (spread < one.emitted.max()).all()
    # Errors of airlight and surface alone do not explain the difference.
    assert one.emitted_se.mean() > 5 * np.hypot(one.airlight_se, one.surface_se).mean()
    centre = quadrature_image(reference, checks=1, plan=PointPlan(error=0.0, first=1, most=1))
    assert centre.emitted is not None
    assert centre.emitted_se is None


def test_a_light_in_the_middle_of_a_pixel_has_a_finite_mean(variant):
    """The ray through the centre meets the light; the mean over the area is
    what the one over r leaves.
    """
    reference = scene_of(tiny_scene(ball=None, floor=None, size=(3, 3)))
    light = reference.lights[0]
    middle = reference.origin + 2.7 * reference.direction[4]
    reference = replace(reference, lights=(replace(light, position=middle),))
    centre, area = quadrature_image(reference), quadrature_image(reference, pixel="area")
    assert (centre.airlight_kind, area.airlight_kind) == ("proven", "estimated")
    assert not np.isfinite(centre.airlight[1, 1]).all() or centre.airlight[1, 1].max() > 1e6
    assert np.isfinite(area.airlight).all()
    expected, *_ = brute_force(reference, 32)
    # Around the light the airlight is c/rho: the sub-pixel that holds it leaves about
    # a 32nd of the mean open.
    error = np.abs(area.airlight[1, 1] - expected[1, 1])
    assert np.all(error < 3 * area.airlight_se[1, 1] + expected[1, 1] / 32)
    assert np.all(area.airlight_se[1, 1] < 0.04 * area.airlight[1, 1])
