# SPDX-License-Identifier: BSD-3-Clause
"""Claim: paths through clouds with densities give the light of each order, and the opacity is the sum over the grid."""

import math
from functools import reduce

import mitsuba as mi
import numpy as np
import pytest

from analytic.errors import InputError
from reference.monte_carlo.batches import merged
from reference.monte_carlo.cloud_paths.integrator import cloud_paths_batch
from reference.monte_carlo.cloud_paths.opacity import seen_clouds
from reference.scene.clouds import read_clouds
from tests.helpers.clouds import DROPLETS, SUN, cloud, cloud_scene, dense, length_inside, linear_between
from validation.scenes.meshes import box, placed
from validation.scenes.parts import sky

LOW, HIGH = np.array([-91.3, -73.9, -52.7]), np.array([111.7, 79.3, 61.1])
ROUGH = np.random.default_rng(5).random((9, 8, 7)) ** 3
SETS = [("1", (1, 1)), ("2", (2, 2)), ("3-4", (3, 4)), ("5-inf", (5, math.inf))]


def clouds_of(medium=None, **parts):
    mesh = placed(box(tuple(HIGH - LOW - 2.6)), tuple(0.5 * (LOW + HIGH)))
    scene = cloud_scene(sun=SUN, sky=sky((0.06, 0.11, 0.2)), box=cloud("box", mesh, medium), **parts)
    return read_clouds(mi.load_dict(scene))


def rough(**changes):
    return dense(changes.pop("values", ROUGH), LOW, HIGH, **{"sigma_t": 0.0517, "albedo": 0.96} | changes)


def paths(clouds, batches, sets, samples=256, first=0):
    seen = seen_clouds(clouds).meets
    seeds = range(first, first + batches)
    return reduce(merged, (cloud_paths_batch(clouds, seed, samples, sets=sets, seen=seen) for seed in seeds))


def check_equal(first, second):
    for layer in second.layers:
        (a, va), (b, vb) = (
            (own.mean(0), own.var(0, ddof=1) / len(own))
            for own in (each.totals[:, each.layers.index(layer)] for each in (first, second))
        )
        z = np.where(va + vb > 0, (a - b) / np.sqrt(np.maximum(va + vb, 1e-300)), 0.0)
        assert np.abs(z).max() < 4, layer
        if layer in ("airlight", "airlight_1", "airlight_2_inf"):
            assert np.all(np.sqrt(vb) < 0.02 * b), "too few paths to say anything"


@pytest.mark.statistical
@pytest.mark.claim(
    "hypertexture-reference", tolerance="4 standard errors of the image mean, one comparison in 16 000 by chance"
)
def test_an_even_grid_is_a_homogeneous_cloud(variant):
    """Half the largest density everywhere but in a corner without cloud: flights end where nothing is."""
    values = np.full((40, 40, 40), 0.5)
    values[0, 0, 0] = 1.0  # beyond the box but for a share of 1e-5 of a voxel
    even = paths(clouds_of(rough(values=values)), 24, SETS)
    homogeneous = paths(clouds_of(DROPLETS | {"sigma_t": 0.5 * 0.0517, "albedo": 0.96}), 24, SETS, first=100)
    check_equal(even, homogeneous)


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
    coloured = {"type": "gridvolume", "grid": mi.VolumeGrid(np.full((2, 2, 2, 3), 0.5, dtype=np.float32))}
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
