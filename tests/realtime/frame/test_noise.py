# SPDX-License-Identifier: BSD-3-Clause
"""Runs and frames of a noisy method: other random numbers in each, the same in each repetition, frozen or not."""

from dataclasses import dataclass, replace
from itertools import pairwise

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import kstest

from realtime.errors import InputError
from realtime.frame.incremental import next_frame
from realtime.frame.renderer import frame_renderer, image_frame, render_frame
from realtime.methods.interface.method import Layers, Method
from realtime.numerics.noise import pcg4d
from realtime.scene.read_scene import read_scene
from tests.helpers.scenes import tiny_scene

STILL = {"camera_moved": False, "geometry_moved": False, "light_moved": False}


@dataclass(frozen=True)
class Speckle(Method):
    """Random numbers as an image."""

    name = "speckle"
    uses_kernel = False
    noisy = True

    def render(self, view, state, kernel):
        """Return three of the four numbers of every ray."""
        return Layers(type(view.medium.albedo)(*view.uniform()[:3]))


@dataclass(frozen=True)
class Unfrozen(Speckle):
    """The same, not recorded."""

    frozen = False


@pytest.fixture
def scene(variant):
    return read_scene(mi.load_dict(tiny_scene(size=(24, 18))))


def frames(renderer, count):
    """Return the airlight of frames of a scene in which nothing moves."""
    cache, images = None, []
    for _ in range(count):
        stages, cache = next_frame(renderer, renderer.scene, cache, **STILL)
        images.append(image_frame(renderer, stages).airlight)
    return images


@pytest.mark.claim("noise-seeds", tolerance="none: bit by bit")
def test_a_frozen_method_draws_the_noise_of_an_unfrozen_one_anew_in_each_frame(scene):
    frozen, unfrozen = (frame_renderer(scene, method) for method in (Speckle, Unfrozen))
    images = frames(frozen, 3)
    assert frozen.stages.render.n_recordings == 1
    assert min(np.mean(a != b) for a, b in pairwise(images)) > 0.99
    np.testing.assert_array_equal(images, frames(unfrozen, 3))
    np.testing.assert_array_equal(images[2], render_frame(replace(unfrozen, frame=2)).airlight)


@pytest.mark.claim("noise-seeds", tolerance="none: bit by bit")
def test_two_runs_differ_and_one_run_repeats(scene):
    renderer = frame_renderer(scene, Speckle)
    first, second, again = (render_frame(replace(renderer, run=run)).airlight for run in (0, 1, 0))
    assert np.mean(first != second) > 0.99
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(first, render_frame(frame_renderer(scene, Speckle)).airlight)


def test_a_method_that_does_not_say_that_it_is_noisy_is_told_so(scene):
    @dataclass(frozen=True)
    class Silent(Speckle):
        noisy = False

    with pytest.raises(InputError, match="`noisy` = True"):
        render_frame(frame_renderer(scene, Silent))


def test_numbers_of_pixels_frames_runs_and_streams_are_even_and_independent(variant):
    """Kolmogorov and Smirnov's test of 65 536 numbers, and the correlation of each with the one before, at 1e-4."""
    pixel, count = dr.arange(mi.UInt32, 2**16), 2**16
    for words in ((pixel, 3, 5, 0), (7, pixel, 5, 0), (7, 3, pixel, 0), (7, 3, 5, pixel)):
        numbers = [np.array(mi.Float(word >> 8)) * 2.0**-24 for word in pcg4d(*words)]
        for values in numbers:
            assert kstest(values, "uniform").pvalue > 1e-4
            assert abs(np.corrcoef(values[1:], values[:-1])[0, 1]) < 3.9 / np.sqrt(count)
        assert np.max(np.abs(np.corrcoef(numbers) - np.eye(4))) < 3.9 / np.sqrt(count)
