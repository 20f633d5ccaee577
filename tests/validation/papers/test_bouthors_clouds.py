# SPDX-License-Identifier: BSD-3-Clause
"""Claim: Figs 8, 11 and 12 of Bouthors 2008 again are what the slab, light paths and collectors say."""

import math

import mitsuba as mi
import numpy as np
import pytest

from realtime.clouds.slab_orders.phases import HenyeyGreensteinPhase
from realtime.scene.read_scene import read_scene
from reference.monte_carlo.slab_walk.scattering import HenyeyGreenstein
from reference.scene.clouds import read_clouds
from tests.helpers.clouds import cloud, cloud_scene
from tests.helpers.transport_formula import use_formula
from validation.canonical.errors import transport_at
from validation.papers import bouthors_clouds, bouthors_transport
from validation.scenes.parts import placed
from validation.scenes.solids import box
from validation.slab.phases import PhasePair

pytestmark = pytest.mark.usefixtures("variant")

PAIR = PhasePair("hg:0.5", HenyeyGreensteinPhase(0.5), lambda: HenyeyGreenstein(0.5))
OVERHEAD = {"type": "directional", "direction": [0.0, 0.0, -1.0], "irradiance": {"type": "rgb", "value": [3, 3, 3]}}


def test_light_by_direction_is_the_computation_and_photons_find_it():
    edges = np.linspace(0, np.pi, 9)
    angles = (edges[1:] + edges[:-1]) / 2
    plane, means = bouthors_transport._computed(PAIR, 2.0, [0.0, 1.1], angles, edges)
    sun = np.full(angles.size, math.cos(math.radians(25)))
    at = transport_at(
        PAIR.deterministic, 1.0, np.full(angles.size, 2.0), np.full(angles.size, 1.1), np.cos(angles), 0 * angles, sun
    )[0]
    np.testing.assert_allclose(plane[:, 1], at, rtol=2e-3)
    walked = bouthors_transport._walked(PAIR, 2.0, [0.0, 1.1], edges, 20_000)
    mean, error = (each[:4, 1, ::-1, 0] for each in (walked.radiance, walked.radiance_error))
    z = (mean - means[:4, 1]) / error
    # 32 numbers, whose mean square spreads by a quarter; those of a set's neighbouring bins hang together.
    assert 0.5 < np.sqrt(np.mean(z**2)) < 1.6


def test_sets_with_too_little_light_are_not_compared():
    exact, none = np.array([1.0, 2.0, 4.0]), np.zeros(3)
    given = exact, 1.01 * exact, np.array([1.5, 3.0, 4.0]), exact + 0.2, np.full(3, 0.1), exact
    seen = bouthors_transport._differences(np.ones(3), *given)
    assert seen["table_p95"] == pytest.approx(0.01)
    assert seen["fit_p50"] == pytest.approx(0.5)
    assert seen["photons_z"] == pytest.approx(2.0)
    assert set(bouthors_transport._differences(none, *given).values()) == {None}


def test_the_noise_of_the_truth_is_no_error_of_the_method():
    random = np.random.default_rng(5)
    truth = random.uniform(1, 3, (60, 80, 3))
    error = np.full(truth.shape, 0.5)
    noisy = truth + 0.5 * random.normal(size=truth.shape)
    assert bouthors_clouds._difference(truth, noisy, error)["rmse"] < 0.03
    apart = bouthors_clouds._difference(1.1 * truth + 0.3, noisy, error)
    assert apart["light"] == pytest.approx(1.1 + 0.3 / 2, abs=0.01)
    exact = np.sqrt(np.mean((0.1 * truth + 0.3) ** 2)) / truth.mean()
    assert apart["rmse"] == pytest.approx(exact, rel=0.1)


def test_what_another_part_shades_is_found():
    """A plate hangs over the right half of a slab: there, and nowhere else, the sun's way leaves and enters again."""
    slab, plate = (
        placed(box((300.3, 200.1, 20.7)), (0.0, 0.0, -80.3)),
        placed(box((150.9, 220.3, 9.1)), (75.0, 0.0, 70.1)),
    )
    scene = cloud_scene((24, 18), sun=OVERHEAD, slab=cloud("slab", slab), plate=cloud("plate", plate))
    clouds = read_clouds(mi.load_dict(scene))
    there, shaded = bouthors_clouds._shaded(clouds)
    depth = (-70.0 - clouds.origin[2]) / clouds.direction[:, 2]  # on the lit face of the slab
    x = clouds.origin[0] + depth * clouds.direction[:, 0]
    first = clouds.scene.ray_intersect(
        mi.Ray3f(mi.Point3f(np.broadcast_to(clouds.origin, clouds.direction.shape).T), mi.Vector3f(clouds.direction.T))
    )
    on_slab = there & (np.array(first.p.z) < 0)
    assert 20 < shaded.sum() < there.sum() - 20
    clear = on_slab & (np.abs(x) > 2) & (np.abs(np.array(first.p.z) + 70) < 1)
    np.testing.assert_array_equal(shaded[clear], (x > 0)[clear])
    assert not shaded[there & (np.array(first.p.z) > 60)].any()


def test_on_a_slab_both_searches_end_at_one_collector(monkeypatch):
    use_formula(monkeypatch)
    monkeypatch.setattr(bouthors_clouds, "_ASIDE", 40.0)
    slab = placed(box((2500.0, 2500.0, 143.7)), (3.1, 0.2, -90.0))
    scene = mi.load_dict(cloud_scene(origin=(30.83, -400.91, 257.03), sun=OVERHEAD, slab=cloud("slab", slab)))
    left, right = (bouthors_clouds._searched_from(read_scene(scene), aside) for aside in (-40.0, 40.0))
    for (one, light, width), (other, *_) in zip(left, right, strict=True):
        seen = width > 0
        assert seen.sum() > 20
        assert (np.linalg.norm(one - other, axis=-1)[seen] < 0.02 * width[seen]).all()
        assert (light[seen] > 0).any()


def test_the_sun_alone_shines_and_the_cut_medium_is_thinner():
    whole, cut = (bouthors_clouds._in_the_sun("cumulus", (8, 6), peak) for peak in (None, 0.444))
    full, thin = (read_scene(each.scene) for each in (whole, cut))
    assert len(full.lights) == len(thin.lights) == 1
    ratio = float(np.array(thin.medium.clouds.sigma_t[0])[0] / np.array(full.medium.clouds.sigma_t[0])[0])
    assert ratio == pytest.approx(1 - 0.99997 * 0.444, rel=1e-5)
