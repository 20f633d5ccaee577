# SPDX-License-Identifier: BSD-3-Clause
"""A scene has Mie's phase function by a table: what the table keeps of it, and that all readers see the same."""

import mitsuba as mi
import numpy as np
import pytest

from analytic.droplets import optics
from realtime.scene.phase import PeakedTable
from realtime.scene.read_scene import read_scene
from reference.quadrature.image import quadrature_image
from reference.scene.read import read_truth
from tests.helpers.frames import render
from validation.estimates.agreement import agreements
from validation.scenes.parts import camera, fog, point_light, tabulated_phase


def table(words, values):
    text = tabulated_phase(words, values)["values"]
    return np.array([float(word) for word in text.split(",")])


@pytest.mark.claim("droplets-in-scenes", tolerance="0.001 of the share and of g, 0.1 % of values from 10 to 30 degrees")
def test_a_table_keeps_the_light_of_the_peak(variant):
    values = table("mie", 2001)
    cosine = np.linspace(-1, 1, len(values))
    full = optics()
    fine = np.linspace(-1, 1, 400_001)
    p = np.interp(fine, cosine, values)
    assert 0.5 * np.trapezoid(p, fine) == pytest.approx(1, abs=1e-9)
    assert 0.5 * np.trapezoid(p * fine, fine) == pytest.approx(full.g, abs=1e-3)
    peak = fine >= np.cos(np.deg2rad(5))
    assert 0.5 * np.trapezoid(p[peak], fine[peak]) == pytest.approx(full.share(0, 5), abs=2e-3)
    angle = np.deg2rad(np.linspace(10, 30, 200))
    assert np.interp(np.cos(angle), cosine, values) == pytest.approx(full(np.cos(angle)), rel=1e-3)


def fog_of(phase, size=(8, 6)):
    return mi.load_dict(
        {
            "type": "scene",
            "fog": fog(0.21, (0.9, 0.9, 0.9), phase),
            "light": point_light((0.7, 3.1, 0.4), (5.0, 4.0, 3.0)),
            "camera": camera((0.1, -2.3, 0.2), (0.6, 1.9, 0.3), fov=47.0, size=size),
        }
    )


@pytest.mark.claim("droplets-in-scenes", tolerance="2e-3 relative: kernels integrate across the kinks of the table")
def test_methods_and_truth_see_the_same_fog_of_droplets(variant):
    scene = fog_of(tabulated_phase("mie", 2001))
    assert isinstance(read_scene(scene).medium.phase, PeakedTable)
    truth = quadrature_image(read_truth(scene), checks=2).airlight.reshape(-1)
    frame = np.array(render(scene, "unshadowed").airlight, dtype=np.float64).T.reshape(-1)
    assert np.sort(frame) == pytest.approx(np.sort(truth), rel=2e-3)


@pytest.mark.claim("droplets-in-scenes", tolerance="1 % bias of Mitsuba's sampling, by its own interval")
@pytest.mark.statistical
def test_mitsuba_sees_the_same_fog_of_droplets(variant):
    margins = {"single-scatter": 0.01, "volpath": 0.01}
    agreed = agreements(fog_of(tabulated_phase("mie", 2001), size=(16, 12)), margins, batches=2048)
    assert len(agreed) == len(margins)
    for estimator, agreement in agreed.items():
        assert agreement.statistics.equivalent, estimator
