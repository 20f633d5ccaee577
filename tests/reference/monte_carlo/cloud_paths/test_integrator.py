# SPDX-License-Identifier: BSD-3-Clause
"""Claim: paths through clouds give the light of each order: DISORT's in a slab,
Mitsuba's `volpath` elsewhere.

In clouds with densities the opacity is the sum over the grid, and an even
grid is a homogeneous cloud.
"""

import math
from dataclasses import replace
from functools import reduce

import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import chi2, norm, t

from airlight.errors import InputError
from airlight.realtime.clouds.slab_orders.phases import HenyeyGreensteinPhase
from airlight.reference.monte_carlo.batches import merged
from airlight.reference.monte_carlo.cloud_paths.integrator import cloud_paths_batch
from airlight.reference.monte_carlo.cloud_paths.opacity import seen_clouds
from airlight.reference.monte_carlo.cloud_paths.phases import Tabulated
from airlight.reference.monte_carlo.cloud_paths.walk import _counted_fraction
from airlight.reference.monte_carlo.volpath import volpath_orders_batch
from airlight.reference.scene.clouds import read_clouds
from airlight.validation.scenes.loading import load_scene
from airlight.validation.scenes.meshes import box, grid, placed
from airlight.validation.scenes.parts import camera, mitsuba_mesh, sky, sun
from airlight.validation.slab.radiance import slab_radiance
from tests.helpers.clouds import (
    DROPLETS,
    SUN,
    cloud,
    cloud_scene,
    dense,
    length_inside,
    linear_between,
)

SETS = [("1", (1, 1)), ("2", (2, 2)), ("3-4", (3, 4)), ("5-inf", (5, math.inf))]


def paths(clouds, count, samples, sets=SETS, first=0):
    seen = seen_clouds(clouds).meets
    return reduce(
        merged,
        (
            cloud_paths_batch(clouds, seed, samples, sets=sets, mask=seen)
            for seed in range(first, first + count)
        ),
    )


def ball(sigma_t, albedo, phase, centre=(0.0, 0.0, 0.0), radius=1.3):
    return {
        "type": "sphere",
        "center": list(centre),
        "radius": radius,
        "bsdf": {"type": "null"},
        "interior": {
            "type": "homogeneous",
            "sigma_t": {"type": "rgb", "value": [value / max(sigma_t) for value in sigma_t]},
            "scale": max(sigma_t),
            "albedo": {"type": "rgb", "value": list(albedo)},
            "phase": phase,
            "has_spectral_extinction": len(set(sigma_t)) > 1,
        },
    }


def scene(**parts):
    usual = {
        "type": "scene",
        "sensor": camera((0.3, -6.1, 0.7), (0.1, 0.0, 0.1), fov=43.0, size=(8, 6), in_fog=False),
        "sun": sun((0.3, 0.5, -0.8), (3.1, 2.7, 2.3)),
    }
    return mi.load_dict({name: part for name, part in (usual | parts).items() if part is not None})


def scenes():
    hg = {"type": "hg", "g": 0.6}
    ground = mitsuba_mesh(
        "ground", grid((-9, -9, -1.7), (18, 0, 0), (0, 18, 0), (1, 1)), (0.7, 0.5, 0.3)
    )
    block = mitsuba_mesh(
        "block", grid((0.0, -0.6, -0.6), (1.1, 0.2, 0), (0.1, 0.0, 1.1), (1, 1)), (0.6, 0.6, 0.2)
    )
    table = {"type": "tabphase", "values": "1.0, 0.2, 0.3, 0.9, 5.0"}
    return {
        "sky alone, coloured and absorbing": {
            "ball": ball((0.9, 1.3, 1.9), (0.9, 0.8, 0.6), hg),
            "sky": sky((0.7, 0.9, 1.1)),
            "sun": None,
        },
        "two clouds, a ground and a block inside": {
            "low": ball((2.1,) * 3, (1.0,) * 3, {"type": "rayleigh"}, (0.9, 0.3, -0.4), 0.8),
            "high": ball((1.1,) * 3, (0.97, 0.9, 0.8), table, (-0.7, 0.2, 0.8), 1.1),
            "ground": ground,
            "sky": sky((0.2, 0.3, 0.4)),
        },
        "a surface within, two suns": {
            "ball": ball((1.3,) * 3, (0.95,) * 3, hg),
            "block": block,
            "other": sun((-0.7, 0.1, -0.4), (0.3, 0.9, 1.7)),
        },
    }


def check_equal(first, second, least, layers=()):
    """Assert that image means agree; the errors of these layers, or of all that have
    light, are below `least`.
    """
    for layer in second.layers:
        (a, va), (b, vb) = (
            (own.mean(0), own.var(0, ddof=1) / len(own))
            for own in (each.totals[:, each.layers.index(layer)] for each in (first, second))
        )
        z = np.where(va + vb > 0, (a - b) / np.sqrt(np.maximum(va + vb, 1e-300)), 0.0)
        assert np.abs(z).max() < 4, layer
        if layer in layers if layers else a.any():
            assert np.all(np.sqrt(va) < least * a), "too few paths to say anything"


@pytest.mark.slow
@pytest.mark.statistical
@pytest.mark.claim(
    "cloud-paths-are-volpath",
    tolerance="4 standard errors of the image mean, one comparison in 16 000 by chance",
)
@pytest.mark.parametrize(
    "name",
    [
        "sky alone, coloured and absorbing",
        "two clouds, a ground and a block inside",
        "a surface within, two suns",
    ],
)
def test_every_order_is_that_of_volpath(variant, name):
    """Sky, several suns and clouds, phase functions, colours, and surfaces
    below and within clouds.
    """
    clouds = read_clouds(scene(**scenes()[name]))
    # few sets: each compiles a kernel of Mitsuba
    sets, batches = [("1", (1, 1)), ("2-inf", (2, math.inf))], 32
    ours = paths(clouds, batches, 256, sets)
    theirs = reduce(
        merged, (volpath_orders_batch(clouds, seed, 256, sets=sets) for seed in range(batches))
    )
    check_equal(ours, theirs, 0.04)


def slab_rays():
    """Return directions out of the slab, as mu and phi [degrees] of the light that leaves."""
    return [(mu, phi) for mu in (0.15, 0.4, 0.7, 0.95) for phi in (0.0, 65.0, 180.0)]


def slab_clouds():
    """Return the built-in slab, seen along `slab_rays`."""
    clouds = read_clouds(load_scene("cloud-slab", (4, 3)).scene)
    travels = clouds.suns[0].direction
    forward = travels[:2] / np.linalg.norm(travels[:2])
    aside = np.array([-forward[1], forward[0]])
    ways = []
    for mu, phi in slab_rays():
        angle, sine = math.radians(phi), math.sqrt(1 - mu * mu)
        ways.append(
            -np.array([*(sine * (math.cos(angle) * forward + math.sin(angle) * aside)), mu])
        )
    return replace(clouds, direction=np.array(ways), origin=np.array([0.0, 0.0, 311.0]))


def slab_reference(clouds):
    """Return the radiance of the slab along `slab_rays`; another test holds
    `slab_radiance` against DISORT.
    """
    cloud, sun = clouds.clouds[0], clouds.suns[0]
    tau, g = float(cloud.sigma_t[1]) * 291.7, cloud.phase.g
    directions = [(mu, math.radians(phi)) for mu, phi in slab_rays()]
    radiance = slab_radiance(
        tau,
        -sun.direction[2],
        HenyeyGreensteinPhase(g),
        float(cloud.albedo[1]),
        depths=[0.0],
        directions=directions,
    )[0]
    return radiance[:, None] * sun.irradiance


@pytest.mark.statistical
@pytest.mark.claim(
    "cloud-paths-are-disort",
    tolerance="chi-squared of 12 directions, level 1e-4; bias 4 standard errors",
)
def test_the_slab_is_that_of_disort(variant):
    clouds = slab_clouds()
    reference = slab_reference(clouds)
    batches = paths(clouds, 32, 256)
    z = ((batches.mean[0] - reference) / batches.standard_error[0])[:, 1]
    assert np.all(batches.standard_error[0] < 0.06 * reference)
    # A z of 32 batches has the variance 31/29.
    assert chi2.sf((z**2).sum() * 29 / 31, len(z)) > 1e-4
    assert abs(z.sum()) / math.sqrt(len(z)) < 4


@pytest.mark.slow
@pytest.mark.statistical
@pytest.mark.claim(
    "cloud-paths-standard-errors",
    tolerance="95 % intervals of 32 batches hold DISORT's radiance: 91 to 98 %",
)
def test_standard_errors_cover_the_reference_as_often_as_they_say(variant):
    """24 runs of 12 directions: 288 intervals, of which 88.7 % to 98 % hold by chance
    at a level of 1e-4 or so.
    """
    clouds = slab_clouds()
    reference = slab_reference(clouds)[:, 1]
    held = []
    for run in range(24):
        batches = paths(clouds, 32, 64, first=1000 + 32 * run)
        z = (batches.mean[0][:, 1] - reference) / batches.standard_error[0][:, 1]
        held.append(np.abs(z) < t.ppf(0.975, 31))
    fraction = np.mean(held)
    spread = math.sqrt(0.95 * 0.05 / np.size(held))
    # batches of 64 paths are skewed
    assert abs(fraction - 0.95) < norm.ppf(1 - 5e-5) * spread + 0.005


def test_order_one_is_its_integral(variant):
    """P/(4 pi) mu0/(mu + mu0) (1 - exp(-tau (1/mu + 1/mu0))), seen from above."""
    clouds = slab_clouds()
    mu0, g = -clouds.suns[0].direction[2], clouds.clouds[0].phase.g
    tau = float(clouds.clouds[0].sigma_t[1]) * 291.7
    batches = paths(clouds, 8, 256)
    for (mu, phi), mean, error in zip(
        slab_rays(), batches.mean[2][:, 1], batches.standard_error[2][:, 1], strict=True
    ):
        cosine = -mu * mu0 + math.sqrt((1 - mu * mu) * (1 - mu0 * mu0)) * math.cos(
            math.radians(phi)
        )
        p = (1 - g * g) / (1 + g * g - 2 * g * cosine) ** 1.5
        light = p / (4 * math.pi) * mu0 / (mu + mu0) * -math.expm1(-tau * (1 / mu + 1 / mu0))
        assert mean == pytest.approx(light * clouds.suns[0].irradiance[1], abs=6 * error)
        assert error < 0.04 * mean


def test_layers_add_up_and_seeds_give_the_same_numbers(variant):
    loaded = scene(cloud=ball((1.1,) * 3, (1.0,) * 3, {"type": "isotropic"}))
    clouds = read_clouds(loaded)
    one, two = paths(clouds, 2, 16), paths(clouds, 2, 16)
    np.testing.assert_array_equal(one.mean, two.mean)
    assert one.layers == (
        "airlight",
        "surface",
        "airlight_1",
        "airlight_2",
        "airlight_3_4",
        "airlight_5_inf",
        "surface_straight",
    )
    np.testing.assert_allclose(one.mean[2:6].sum(0), one.mean[0], rtol=1e-6, atol=1e-12)
    assert not one.mean[1].any()
    few = paths(clouds, 2, 16, sets=SETS[1:2])
    np.testing.assert_array_equal(few.mean[2], one.mean[3])
    np.testing.assert_allclose(few.mean[0], one.mean[0], rtol=1e-6, atol=1e-12)


def test_a_transparent_shape_without_a_medium_takes_no_part(variant):
    """A ball of nothing around the cloud, between it and the camera, the sun and the sky."""
    parts = {"cloud": ball((1.1,) * 3, (0.9,) * 3, {"type": "isotropic"}), "sky": sky((0.2,) * 3)}
    nothing = {"type": "sphere", "radius": 2.0, "bsdf": {"type": "null"}}
    alone, around = (read_clouds(scene(**parts, **more)) for more in ({}, {"nothing": nothing}))
    (first, second), found = (
        [seen_clouds(clouds) for clouds in (alone, around)],
        [paths(clouds, 2, 16).mean for clouds in (alone, around)],
    )
    np.testing.assert_array_equal(first.transmittance, second.transmittance)
    np.testing.assert_array_equal(first.distance, second.distance)
    assert found[0][0].any()
    assert not found[1][1].any()  # nothing is no surface
    np.testing.assert_allclose(found[1], found[0], rtol=1e-6)


def test_a_direction_that_both_draw_with_no_density_has_no_light(variant):
    """At its end a table is 0, and the random number 0 draws this end: 0/0 of the light."""
    fraction = _counted_fraction(mi.Float([0.0, 2.0, 0.0]), mi.Float([0.0, 1.0, 1.0]), 0.5)
    np.testing.assert_allclose(np.array(fraction), [0.0, 0.8, 0.0], rtol=1e-6)
    # No table is negative where rounding has a direction beyond forward.
    beyond = Tabulated(np.array([1.5, 1.5, 0.0])).value(mi.Float(0.0), mi.Float(1 + 1e-6))
    assert np.array(beyond).min() == 0


# Clouds with densities ----------------------------------------------------------------------------


LOW, HIGH = np.array([-91.3, -73.9, -52.7]), np.array([111.7, 79.3, 61.1])
ROUGH = np.random.default_rng(5).random((9, 8, 7)) ** 3


def clouds_of(medium=None, **parts):
    mesh = placed(box(tuple(HIGH - LOW - 2.6)), tuple(0.5 * (LOW + HIGH)))
    scene = cloud_scene(
        sun=SUN, sky=sky((0.06, 0.11, 0.2)), box=cloud("box", mesh, medium), **parts
    )
    return read_clouds(mi.load_dict(scene))


def rough(**changes):
    return dense(
        changes.pop("values", ROUGH), LOW, HIGH, **{"sigma_t": 0.0517, "albedo": 0.96} | changes
    )


@pytest.mark.statistical
@pytest.mark.claim(
    "hypertexture-reference",
    tolerance="4 standard errors of the image mean, one comparison in 16 000 by chance",
)
def test_an_even_grid_is_a_homogeneous_cloud(variant):
    """Half the largest density everywhere but in a corner without cloud:
    flights end where nothing is.
    """
    values = np.full((40, 40, 40), 0.5)
    values[0, 0, 0] = 1.0  # beyond the box except for a fraction of 1e-5 of a voxel
    even = paths(clouds_of(rough(values=values)), 24, 256)
    homogeneous = paths(
        clouds_of(DROPLETS | {"sigma_t": 0.5 * 0.0517, "albedo": 0.96}), 24, 256, first=100
    )
    check_equal(even, homogeneous, 0.02, ("airlight", "airlight_1"))


def test_opacity_is_the_sum_over_the_grid(variant):
    clouds = clouds_of(rough())
    mesh = placed(box(tuple(HIGH - LOW - 2.6)), tuple(0.5 * (LOW + HIGH)))
    seen = seen_clouds(clouds)
    checked = 0
    for way, found in zip(clouds.direction, seen.transmittance):
        length = length_inside(mesh, clouds.origin, way)
        if not length:
            continue
        near = (np.where(way > 0, LOW + 1.3, HIGH - 1.3) - clouds.origin) / way
        places = near.max() + length * (np.arange(8000) + 0.5) / 8000
        rho = linear_between(ROUGH, LOW, HIGH, clouds.origin + places[:, None] * way)
        assert found[0] == pytest.approx(math.exp(-0.0517 * length * rho.mean()), rel=1e-3)
        checked += 1
    assert checked > 20


@pytest.mark.claim("hypertexture-refused", tolerance="none: an error and its words")
def test_what_is_no_density_is_refused_by_name(variant):
    wrong = ROUGH.copy()
    wrong[3, 2, 1] = -1e-3
    coloured = {
        "type": "gridvolume",
        "grid": mi.VolumeGrid(np.full((2, 2, 2, 3), 0.5, dtype=np.float32)),
    }
    thin = mi.ScalarTransform4f().translate(LOW.tolist()).scale([5.0, 7.0, 9.0])
    small = {"sigma_t": rough()["sigma_t"] | {"to_world": thin}}
    cases = [
        (rough(values=wrong), "densities below 0 or not finite"),
        (rough(values=np.where(wrong < 0, np.nan, wrong)), "densities below 0 or not finite"),
        (rough(values=0 * ROUGH), "is 0 everywhere"),
        (rough() | {"sigma_t": 0.3}, "without a grid as its extinction"),
        (rough() | {"sigma_t": coloured}, "a grid of 3 channels"),
        (rough() | {"albedo": rough()["sigma_t"]}, "without one albedo everywhere"),
        (rough() | small, "does not cover the shape"),
    ]
    for medium, words in cases:
        with pytest.raises(InputError, match=words) as refusal:
            clouds_of(medium)
        assert "the medium of shape 'box'" in str(refusal.value)
        assert "\n" not in str(refusal.value)
