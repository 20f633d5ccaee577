# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

from reference.quadrature.image import quadrature_image
from reference.quadrature.ray_values import ray_values
from reference.scene.camera import film_directions
from reference.scene.read import read_reference
from tests.helpers.polygons import box_scene
from tests.helpers.scenes import tiny_scene


def reference_of(scene):
    return read_reference(mi.load_dict(scene))


def brute_force(reference, n, regular=False):
    """Return the means of n x n sub-pixels, a random point in each: airlight, surface, and the brightest surface.

    Regular points would all be wrong the same way where an edge runs along the rows; close to a light they are better,
    where a random one may come too close.
    """
    row, column = np.divmod(np.arange(reference.width * reference.height), reference.width)
    y, x = np.divmod(np.arange(n * n), n)
    u, v = (0.5, 0.5) if regular else np.random.default_rng(11).random((2, len(row), n * n))
    positions = np.stack([column[:, None] + (x + u) / n, row[:, None] + (y + v) / n], axis=-1).reshape(-1, 2)
    direction = film_directions(reference.scene.sensors()[0], positions, (reference.width, reference.height))
    values = ray_values(replace(reference, direction=direction), checks=1)
    shape = (reference.height, reference.width, n * n, 3)
    surface = values.surface.reshape(shape)
    return values.airlight.reshape(shape).mean(axis=2), surface.mean(axis=2), surface.max()


@pytest.mark.claim("pixel-area", tolerance="7.1 standard errors of 1e-4 relative, which a pilot foresees")
def test_smooth_fog_is_the_integral_over_the_pixel(variant):
    """Gauss's product rule with 12 x 12 points, converged for what is smooth: the light is out of view."""
    lamp = {"type": "point", "position": [3.9, 0.7, 3.9], "intensity": {"type": "rgb", "value": [5.0, 4.0, 3.0]}}
    reference = reference_of(tiny_scene(ball=None, floor=None, lamp=lamp, size=(4, 3)))
    node, weight = np.polynomial.legendre.leggauss(12)
    node, weight = 0.5 * (node + 1), 0.5 * weight
    row, column = np.divmod(np.arange(12), 4)
    x, y = np.meshgrid(node, node)
    positions = np.stack([column[:, None] + x.ravel(), row[:, None] + y.ravel()], axis=-1).reshape(-1, 2)
    direction = film_directions(reference.scene.sensors()[0], positions, (4, 3))
    values = ray_values(replace(reference, direction=direction)).airlight.reshape(3, 4, 144, 3)
    expected = np.einsum("ijkc,k->ijc", values, np.outer(weight, weight).ravel())
    image = quadrature_image(reference, pixel="area", tolerance=1e-4, checks=1)
    error = np.abs(image.airlight - expected)
    # Student's value with seven degrees of freedom that one value in 10 000 exceeds, for 36 values.
    assert np.all(error <= 7.1 * image.airlight_se + image.airlight_bound)
    # A pilot foresees the error from a few positions: 1e-4 in the mean, and not twice and a half of it anywhere.
    stated = image.airlight_se / image.airlight
    assert np.sqrt(np.mean(stated**2)) < 1.5e-4
    assert stated.max() < 2.5e-4


@pytest.mark.claim("pixel-area", tolerance="2e-3 relative beside the bound")
@pytest.mark.parametrize("scene", [tiny_scene, box_scene], ids=["ball", "boxes"])
def test_edges_against_brute_force(variant, scene):
    reference = reference_of(scene(size=(8, 6)))
    image = quadrature_image(reference, checks=1, pixel="area")
    airlight, surface, brightest = brute_force(reference, 24)
    # The light is seen: in its pixel regular sub-pixels converge slowly.
    near = image.light_angle < 0.1
    # Of 24 x 24 random sub-pixels an edge crosses about 24 and leaves sqrt(24)/2/576 = 0.4 % of its jump open; a jump
    # may be larger than the pixel's value, the beam being in front of the light's glow.
    error = np.abs(image.airlight - airlight)[~near]
    assert np.mean(error > 0.02 * airlight[~near] + 4 * image.airlight_se[~near]) == 0
    assert np.mean(error <= 2e-3 * airlight[~near] + 3 * image.airlight_se[~near]) > 0.9
    assert np.abs(image.airlight[~near].mean() / airlight[~near].mean() - 1) < 2e-3
    # The top of the beam, seen almost edge-on, is a strip of a 160th of a pixel with a radiance of 0.2.
    assert np.abs(image.surface - surface).max() < 0.02 * (0.2 if scene is box_scene else brightest)
    assert np.abs(image.surface.mean() / surface.mean() - 1) < 0.01
    centre = quadrature_image(reference, checks=1)
    assert np.abs(centre.airlight - airlight)[~near].max() > 5 * error.max()  # the centre is another thing


def test_a_light_in_the_middle_of_a_pixel_has_a_finite_mean(variant):
    """The ray through the centre meets the light; the mean over the area is what the one over r leaves."""
    reference = reference_of(tiny_scene(ball=None, floor=None, size=(3, 3)))
    light = reference.lights[0]
    middle = reference.origin + 2.7 * reference.direction[4]
    reference = replace(reference, lights=(replace(light, position=middle),))
    centre, area = quadrature_image(reference), quadrature_image(reference, pixel="area")
    assert not np.isfinite(centre.airlight[1, 1]).all() or centre.airlight[1, 1].max() > 1e6
    assert np.isfinite(area.airlight).all()
    expected, *_ = brute_force(reference, 32)
    # Around the light the airlight is c/rho: the sub-pixel that holds it leaves about a 32nd of the mean open.
    error = np.abs(area.airlight[1, 1] - expected[1, 1])
    assert np.all(error < 3 * area.airlight_se[1, 1] + expected[1, 1] / 32)
    assert np.all(area.airlight_se[1, 1] < 0.04 * area.airlight[1, 1])
