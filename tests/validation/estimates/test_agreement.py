# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import replace
from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

from airlight.reference.monte_carlo.volpath_gaps import CannotTrace
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.scene.read import read_reference
from airlight.validation.estimates import agreement as agreement_module
from airlight.validation.estimates.agreement import MASK_PIXELS, agreement, layer_masks, pixel_angle
from airlight.validation.estimates.monte_carlo import monte_carlo_batches
from tests.helpers.scenes import tiny_scene

pytestmark = pytest.mark.statistical

BUDGET = {"margin": 0.02, "batches": 40, "samples": 64}


@pytest.fixture(scope="module")
def scene(variant):
    return mi.load_dict(tiny_scene(size=(24, 18)))


def false_reference(monkeypatch, change):
    """Let the comparison take a changed image for the reference."""
    import airlight.validation.estimates.agreement

    true = airlight.validation.estimates.agreement.reference_image
    monkeypatch.setattr(
        airlight.validation.estimates.agreement,
        "reference_image",
        lambda *args, **kwargs: change(true(*args, **kwargs)),
    )


def test_volpath_is_left_out_of_scenes_that_it_cannot_trace(monkeypatch):
    """Bodies that touch ended a report, which has no other estimator to take."""

    def compared(scene, *, estimator, **options):
        if estimator == "volpath":
            raise CannotTrace("volpath: 0 m apart")
        return {"airlight": estimator}

    monkeypatch.setattr(agreement_module, "agreement", compared)
    found = agreement_module.agreements(None, {"volpath": 0.01, "single-scatter": 0.01})
    assert found == {"single-scatter airlight": "single-scatter"}


@pytest.mark.claim("volpath-agrees")
def test_volpath_agrees_with_the_reference(scene):
    verdicts = agreement(scene, **BUDGET)
    assert set(verdicts) == {"airlight", "surface"}
    for layer, verdict in verdicts.items():
        assert (verdict.layer, verdict.width, verdict.height, verdict.samples) == (
            layer,
            24,
            18,
            64,
        )
        assert 32 <= verdict.batches <= 40
        statistics = verdict.statistics
        # The half width is 0.7 %: a right reference would be called wrong once in 10 000 seeds,
        # and the seeds are fixed.
        assert statistics.equivalent is True, layer
        assert statistics.rejected == 0
        assert statistics.rejected_blocks == 0
        # 40 batches: the deviation of z is sqrt(39/37) = 1.03. Channels share paths, so some 400
        # values are independent and know it to 1.03/sqrt(800) = 0.036: three of these.
        assert statistics.z_std == pytest.approx(1.03, abs=0.11)
        assert statistics.margin == 0.02
        assert statistics.detectable_bias < 0.05


@pytest.mark.parametrize("layer", ["airlight", "surface"])
@pytest.mark.parametrize("factor", [1.05, 0.95])
def test_reference_that_is_five_per_cent_off_does_not_agree(scene, monkeypatch, layer, factor):
    """In one layer alone; the other one still agrees."""
    false_reference(
        monkeypatch, lambda image: replace(image, **{layer: factor * getattr(image, layer)})
    )
    verdicts = agreement(scene, **BUDGET)
    assert verdicts[layer].statistics.equivalent is False
    assert verdicts[layer].statistics.relative_bias == pytest.approx(1 / factor - 1, abs=0.015)
    (other,) = set(verdicts) - {layer}
    assert verdicts[other].statistics.equivalent is True


def test_reference_that_is_wrong_in_a_corner_is_rejected_there(scene, monkeypatch):
    """A wrong shadow is no bias of the image; the tests of pixels and blocks must find it."""

    def corner(image):
        airlight = image.airlight.copy()
        airlight[:6, :6] *= 1.4
        return replace(image, airlight=airlight)

    false_reference(monkeypatch, corner)
    statistics = agreement(scene, **BUDGET)["airlight"].statistics
    assert statistics.rejected + statistics.rejected_blocks > 0


@pytest.mark.claim("corrected-for-the-epsilon")
def test_correction_for_the_epsilon_is_the_difference_of_the_two_biases(scene):
    """A light path that is shorter by a fraction s is brighter by s sigma_t <r>, <r> its
    mean length over the light.

    The slope comes from a fraction of 1 %, whose square term is half of 0.01 sigma_t <r>, below 1 %
    of it. One bias over the other is the ratio of the two references: no sample counts.
    """
    plain, shorter = reference_image(scene), reference_image(scene, shadow_scale=0.99)
    masks = layer_masks(read_reference(scene), plain)
    for layer, verdict in agreement(scene, **BUDGET).items():
        sums = [getattr(image, layer)[masks[layer]].sum() for image in (plain, shorter)]
        slope = (sums[1] / sums[0] - 1) / 0.01
        assert 0.2 < slope < 2  # sigma_t is 0.31, paths are some metres long
        ratio = (1 + verdict.uncorrected_bias) / (1 + verdict.statistics.relative_bias)
        assert ratio - 1 == pytest.approx(slope * verdict.epsilon, rel=0.02)


@pytest.mark.claim("pixels-beside-a-light")
def test_pixels_near_a_light_are_left_out(scene):
    near = reference_image(scene).light_angle <= MASK_PIXELS * pixel_angle(read_reference(scene))
    verdicts = agreement(scene, **BUDGET)
    assert verdicts["airlight"].masked == near.sum()
    assert 4 <= near.sum() <= 16  # a disc of two pixels' radius
    assert verdicts["surface"].masked == 0


def test_out_of_time_is_said_and_is_no_verdict(scene, own_cache):
    """Two batches are traced whatever the time; they do not decide about a
    bias of one in ten million.
    """
    verdicts = agreement(
        scene, estimator="single-scatter", margin=1e-7, batches=40, samples=4, seconds=0.0
    )
    assert {verdict.batches for verdict in verdicts.values()} == {2}
    assert not verdicts["airlight"].finished
    assert verdicts["airlight"].statistics.equivalent is False


def test_the_time_of_the_pilot_does_not_count(scene, own_cache, monkeypatch):
    """A pilot that takes longer than all the time leaves that time to the batches."""
    now = 0.0

    def traced(scene, estimator, *, first_seed=0, **options):
        nonlocal now
        now += 100.0 if first_seed else 0.0
        return monte_carlo_batches(scene, estimator, first_seed=first_seed, **options)

    def watch():
        begun = now
        return lambda: SimpleNamespace(seconds=now - begun)

    monkeypatch.setattr(agreement_module, "monte_carlo_batches", traced)
    monkeypatch.setattr(agreement_module, "stopwatch", watch)
    verdicts = agreement(scene, margin=1e-7, batches=9, samples=4, seconds=50.0)
    assert now == 100.0
    assert {verdict.batches for verdict in verdicts.values()} == {9}


def test_a_layer_whose_light_is_all_left_out_has_no_verdict(scene, monkeypatch):
    """Its bias was a quotient by zero."""
    none = np.zeros((18, 24), dtype=bool)
    monkeypatch.setattr(
        agreement_module, "layer_masks", lambda *_: {"airlight": none, "surface": ~none}
    )
    assert set(agreement(scene, margin=0.02, batches=2, samples=4)) == {"surface"}
