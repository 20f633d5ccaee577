# SPDX-License-Identifier: BSD-3-Clause
"""Jittered samples are noisy and not biased: the mean of runs is the reference
within its standard error.

Protects the claim on methods with noise.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t as student

from airlight.realtime.frame.image import render_frame
from airlight.realtime.methods.interface.method import View
from airlight.realtime.methods.registry import find_method
from tests.helpers.frames import reference_of, renderer
from tests.helpers.scenes import spot, tiny_scene

SIZE, RUNS = (16, 12), 64
#: Level of each of five tests: one right method in 2000 is called biased.
LEVEL = 1e-4
CASES = {
    "march-white": ("ray-march", {"steps": 3, "jitter": "white"}),
    "march-blue": ("ray-march", {"steps": 3, "jitter": "blue", "spacing": "uniform"}),
    "equi-angular": ("equi-angular", {}),
    "equi-angular-blue": ("equi-angular", {"samples": 4, "jitter": "blue"}),
    "reservoirs": ("docs/examples/reservoirs.py:Reservoirs", {"candidates": 6}),
    "march-ign": ("ray-march", {"steps": 3, "jitter": "ign", "animate": "golden"}),
}


def lamps():
    """A ball and six lamps of unequal power, and a spot, so that there are
    tables of two structures.
    """
    rng = np.random.default_rng(61)
    more = {
        f"lamp-{number}": {
            "type": "point",
            "position": [*rng.uniform(-1.9, 1.9, 2), rng.uniform(1.7, 3.1)],
            "intensity": {
                "type": "rgb",
                "value": (rng.uniform(0.3, 5.3) * np.array([1.0, 0.9, 0.7])).tolist(),
            },
        }
        for number in range(5)
    }
    return tiny_scene(size=SIZE, spot=spot()) | more


def biases(method, parameters, scene, runs=RUNS):
    """Return by run the relative bias of the image and of its four quarters, (runs, 5)."""
    made, reference = (
        renderer(scene, find_method(method), **parameters),
        reference_of(scene).airlight,
    )
    half = SIZE[1] // 2, SIZE[0] // 2
    parts = [
        np.s_[:, :],
        *(
            np.s_[rows, columns]
            for rows in (np.s_[: half[0]], np.s_[half[0] :])
            for columns in (np.s_[: half[1]], np.s_[half[1] :])
        ),
    ]
    found = []
    for run in range(runs):
        image = render_frame(replace(made, run=run)).airlight.astype(float)
        found.append([image[part].sum() / reference[part].sum() - 1 for part in parts])
    return np.array(found)


def least_p(found):
    """Return the least of the p-values of Student's test that the means are 0."""
    runs = len(found)
    return 2 * student.sf(
        np.max(np.abs(found.mean(0)) / (found.std(0, ddof=1) / np.sqrt(runs))), runs - 1
    )


@pytest.mark.claim(
    "noise-unbiased",
    tolerance="Student's test of 64 runs at 1e-4 each, of the image and its quarters",
)
@pytest.mark.parametrize("case", CASES)
def test_the_mean_of_runs_is_the_reference(variant, case):
    method, parameters = CASES[case]
    found = biases(method, parameters, lamps() if "march" not in case else tiny_scene(size=SIZE))
    assert np.all(found.std(0) > 0)
    assert least_p(found) > LEVEL


def test_a_bias_of_the_midpoints_is_found_by_the_same_test(variant):
    """Without jitter three steps are wrong by more than the noise of 64 runs hides."""
    scene = tiny_scene(size=SIZE)
    noise = biases(*CASES["march-white"], scene)
    fixed = biases("ray-march", {"steps": 3}, scene, runs=1)
    assert least_p(noise + fixed) < 1e-6


@pytest.mark.parametrize("method", ["equi-angular", "ray-march"])
def test_frames_go_on_by_the_golden_ratio_where_they_are_asked_to(variant, method):
    """The first frame is that of the pattern itself."""
    scene, noisy = tiny_scene(size=SIZE), {"jitter": "white"}
    own, golden = (
        renderer(scene, find_method(method), **noisy, **more)
        for more in ({}, {"animate": "golden"})
    )
    frames = [
        [render_frame(replace(made, frame=number)).airlight for number in range(8)]
        for made in (own, golden)
    ]
    np.testing.assert_array_equal(frames[0][0], frames[1][0])
    # Eight samples a ray that lie evenly are nearer to the integral than eight by chance.
    reference = reference_of(scene).airlight
    errors = [np.abs(np.mean(each, axis=0) - reference).mean() for each in frames]
    assert errors[1] < 0.7 * errors[0]


def test_surfaces_are_lit_by_many_lights_as_they_are_by_each(variant):
    """A method that is given all lights at once has the surfaces of one that is
    given one after the other.
    """
    many, each = (
        render_frame(renderer(lamps(), method)).surface for method in ("equi-angular", "ray-march")
    )
    assert np.max(each) > 0
    np.testing.assert_allclose(many, each, rtol=1e-5, atol=1e-7)


def test_the_largest_random_number_draws_no_dark_light(variant, monkeypatch):
    """Of 64 samples the last has the fraction (63 + c)/64 of the power, which float32 rounds to 1;
    the last light of the table is switched off.
    """
    largest = 1 - 2.0**-24
    monkeypatch.setattr(View, "pattern", lambda self, *words, **how: type(self.distance)(largest))
    off = {"type": "point", "position": [0.5, 0.9, 1.9], "intensity": {"type": "rgb", "value": 0.0}}
    scene = tiny_scene(size=(8, 6), ball=None, floor=None, off=off)
    frame = render_frame(renderer(scene, find_method("equi-angular"), samples=64))
    assert np.isfinite(frame.airlight).all()
    assert frame.airlight.min() > 0
