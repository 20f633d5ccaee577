# SPDX-License-Identifier: BSD-3-Clause
"""Claims: two estimators that agree as they are disagree over every injected fault of
the physics of one of them.

The certified scenes find faults that all estimators share, although the estimators agree. The two
methods for a slab, orders and walk, are tested in the same way.
"""

import json
import math
from functools import cache

import numpy as np
import pytest

from airlight.realtime.clouds.slab_orders.phases import HenyeyGreensteinPhase
from airlight.reference.monte_carlo.slab_walk import estimates
from airlight.reference.monte_carlo.slab_walk.scattering import HenyeyGreenstein
from airlight.reference.monte_carlo.slab_walk.walk import Slab
from airlight.reference.quadrature import image as quadrature
from airlight.reference.scene import read
from airlight.validation.certified.files import certified_data
from airlight.validation.slab import moments
from tests.evidence import stages
from tests.evidence.certified.model import load_fog
from tests.evidence.injected import Rewrite, injected, replacements, rewritten
from tests.evidence.mutations import BELOW_THE_MARGIN, MUTATIONS, SHARED

#: Faults that the default tier tries besides those of the quadrature on its stages: 32
#: batches and their own kernels.
QUICK = ("traced-shadow-epsilon",)
QUICK_STAGES = ("many-lights", "two-pens", "own-equation")
ESTIMATORS = ("quadrature", "single-scatter")


def tiered(mutation):
    quick = mutation.stage in QUICK_STAGES and (
        mutation.estimator == "quadrature" or mutation.name in QUICK
    )
    return pytest.param(mutation, id=mutation.name, marks=() if quick else pytest.mark.slow)


@pytest.fixture(scope="module")
def stage_of(variant):
    return cache(stages.stage_of)


@pytest.mark.parametrize(
    "mutation", [*MUTATIONS, *SHARED, BELOW_THE_MARGIN], ids=lambda mutation: mutation.name
)
def test_what_a_fault_names_is_there(variant, mutation):
    """Anyone who moves or rewrites a formula must move its fault: it must not vanish unnoticed."""
    change = mutation.change
    assert rewritten(change) if isinstance(change, Rewrite) else replacements(change)


@pytest.mark.claim("mutations-are-caught")
@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize(
    "name",
    [
        name if name in QUICK_STAGES else pytest.param(name, marks=pytest.mark.slow)
        for name in stages.MARGINS
    ],
)
def test_without_a_fault_they_agree(stage_of, name, estimator):
    """The control of all that follows, by the same code: without it, what could
    not agree would be 'found'.
    """
    found = list(stages.seen(estimator, None, stage_of(name)))
    assert [sighting.layer for sighting in found] == ["airlight", "surface"]
    assert all(sighting.agrees for sighting in found), found


@pytest.mark.claim("mutations-are-caught")
@pytest.mark.claim("area-mutations-are-caught")
@pytest.mark.parametrize("mutation", [tiered(mutation) for mutation in MUTATIONS])
def test_a_fault_is_found(stage_of, mutation):
    found = list(stages.seen(mutation.estimator, mutation, stage_of(mutation.stage)))
    assert not all(sighting.agrees for sighting in found), found


def test_a_fault_below_the_margin_is_not_found(stage_of):
    """The comparison has a margin, and says so: a fifth of it agrees."""
    found = list(stages.seen("quadrature", BELOW_THE_MARGIN, stage_of("many-lights")))
    assert all(sighting.agrees for sighting in found)
    # half width of its interval, 3e-5, and the control's bias
    assert found[0].bias == pytest.approx(-1e-4, abs=5e-5)


def test_a_fault_leaves_nothing_behind(stage_of):
    stage = stage_of("many-lights")
    for mutation in (mutation for mutation in MUTATIONS if mutation.stage == "many-lights"):
        with injected(mutation.change):
            pass
    image = quadrature.quadrature_image(read.read_reference(stage.scene), plan=stages.PLAN)
    assert np.array_equal(image.airlight, stage.image.airlight)
    assert np.array_equal(image.surface, stage.image.surface)


@pytest.mark.slow
@pytest.mark.claim("mutations-are-caught")
def test_volpath_finds_gross_faults_and_no_others(stage_of):
    """32 batches of Mitsuba's path tracer have intervals below its margin of 1 %: it
    must see a fault of 3 %.
    """
    stage = stage_of("many-lights")
    by_name = {mutation.name: mutation for mutation in MUTATIONS}
    assert all(sighting.agrees for sighting in stages.volpath_seen(None, stage, 32))
    for name in (
        "no-four-pi",
        "bright-shadow-segment",
        "forward-is-backward",
        "surface-bright-camera-segment",
    ):
        assert not all(
            sighting.agrees for sighting in stages.volpath_seen(by_name[name], stage, 32)
        ), name


@pytest.mark.slow
def test_agreement_is_blind_to_what_all_fraction(stage_of):
    stage = stage_of("many-lights")
    mutation = next(mutation for mutation in SHARED if mutation.name == "camera-mirrored")
    with injected(mutation.change):
        changed = stages.stage_of("many-lights")
    assert not np.array_equal(changed.image.airlight, stage.image.airlight)
    assert all(sighting.agrees for sighting in stages.seen("quadrature", mutation, changed))


@pytest.fixture(scope="module")
def certified(variant):
    """Two certified scenes without a symmetry that would hide a fault of the camera."""
    scenes = json.loads(certified_data().read_text())["scenes"]
    chosen = [scene for scene in scenes if scene["name"] in ("box-floor", "soft-spot")]
    return [
        (
            load_fog(scene["mitsuba"]),
            np.array([pixel["radiance"] for pixel in scene["pixels"]], dtype=float),
        )
        for scene in chosen
    ]


def furthest(certified):
    """Return the largest difference between the quadrature and the certified radiance,
    over the largest of these.
    """
    images = [
        quadrature.quadrature_image(read.read_reference(scene)).airlight.reshape(-1, 3)
        for scene, _ in certified
    ]
    return max(
        np.abs(image - known).max() / known.max() for image, (_, known) in zip(images, certified)
    )


@pytest.mark.parametrize("mutation", SHARED, ids=lambda mutation: mutation.name)
def test_the_certified_scenes_find_what_all_fraction(certified, mutation):
    assert furthest(certified) < 1e-9  # the tolerance of the integrals, 1e-10, and twelve digits
    with injected(mutation.change):
        assert furthest(certified) > 1e-3


TAU, MU0, ALBEDO, DEPTH = 1.5, 0.6, 0.8, 0.5
SETS = [(1, 1), (2, 2), (3, math.inf)]
MOMENTS = "airlight.validation.slab.moments"
WALK = "airlight.reference.monte_carlo.slab_walk.walk"

FAULTS = {
    "four pi": (MOMENTS, "albedo / (4 * np.pi)", "albedo / 4"),
    "order off by one": (MOMENTS, "all_[first - 1 : last_]", "all_[max(first - 2, 0) : last_]"),
    "the rest from the wrong order": (MOMENTS, "slab.rest(fields_)", "slab.rest(slab.beam())"),
    "first moment without what is travelled": (
        MOMENTS,
        "sources_[[A0, A1]] + lengths_ * light_[[B1, B0]]",
        "sources_[[A0, A1]]",
    ),
    "modes of the azimuth exchanged": (
        MOMENTS,
        "lengths_ * light_[[B1, B0]]",
        "lengths_ * light_[[B0, B1]]",
    ),
    "second moment by half": (MOMENTS, "2 * lengths_ * light_[[A1]]", "lengths_ * light_[[A1]]"),
    "absorbed once too often": (
        WALK,
        "rows.append(row * weight_)",
        "rows.append(row * weight_ * slab.albedo)",
    ),
    "passages for fluence": (WALK, "(moments_ / np.abs(w_)).sum(-1)", "moments_.sum(-1)"),
    "no azimuth": (WALK, "2 * np.pi * random.random(count_)", "np.pi * random.random(count_)"),
    "distance from the axis": (WALK, "x_ * x_ + at_y * at_y", "x_ * x_"),
}


def computed():
    slab = moments.SlabOrders(
        TAU, MU0, HenyeyGreensteinPhase(0.5), ALBEDO, depths=[DEPTH], streams=16
    )
    sets, _ = moments.order_sets(slab, SETS)
    place = int(np.argmin(np.abs(slab.panels.edges - DEPTH)))
    rows = [
        row
        for up, down, fluence in sets
        for row in (up[:, 0] / MU0, down[:, -1] / MU0, fluence[:, place])
    ]
    return np.array(
        [
            [amount, first / amount, math.sqrt(abs(second / amount))]
            for amount, first, second in rows
        ]
    )


def walked():
    slab = Slab(TAU, MU0, ALBEDO, HenyeyGreenstein(0.5), [DEPTH])
    exits = estimates.slab_estimate(slab, SETS, photons=60_000, seed=11).exits
    return np.moveaxis(exits.reshape(2, -1, 3), 0, -1)


def largest_z(values, photons):
    return np.abs((values - photons[..., 0]) / photons[..., 1]).max()


@pytest.mark.statistical
def test_both_sides_agree_as_they_are():
    assert largest_z(computed(), walked()) < 4.5


@pytest.mark.statistical
@pytest.mark.claim(
    "slab-orders-are-photons",
    tolerance="each of ten faults moves a number by 6 standard errors or more",
)
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_seen(fault):
    with injected(Rewrite(*FAULTS[fault])):
        assert largest_z(computed(), walked()) > 6
