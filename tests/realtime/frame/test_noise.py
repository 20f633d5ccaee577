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
from realtime.numerics.noise import PATTERNS, Noise, blue_mask, pcg4d
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


def pattern(kind, *, run=0, frame=0, golden=False, size=64):
    """Return a pattern of size x size pixels, or of one pixel in many runs."""
    many = not isinstance(run, int)
    pixel = dr.full(mi.UInt32, 7, len(run)) if many else dr.arange(mi.UInt32, size * size)
    noise = Noise(mi.UInt32(run), mi.UInt32(frame), blue_mask())
    found = np.array(noise.pattern(kind, golden=golden, pixel=pixel, place=(pixel // size, pixel % size)), dtype=float)
    return found if many else found.reshape(size, size)


def low_share(values):
    """Return the mean of the spectrum below an eighth of a cycle per pixel; 1 for white noise."""
    power = np.abs(np.fft.fft2(values - values.mean())) ** 2 / values.size / values.var()
    frequency = np.hypot(*np.meshgrid(*(np.fft.fftfreq(side) for side in values.shape), indexing="ij"))
    return power[(frequency > 0) & (frequency < 1 / 8)].mean()


@pytest.mark.claim(
    "noise-patterns", tolerance="Kolmogorov and Smirnov at 1e-4; low share of the spectrum below 0.1 if blue"
)
def test_patterns_are_even_over_the_runs_and_in_the_image(variant):
    for kind in PATTERNS:
        assert kstest(pattern(kind, run=np.arange(4096, dtype=np.uint32)), "uniform").pvalue > 1e-4
        one, other, later = pattern(kind), pattern(kind, run=1), pattern(kind, frame=1)
        assert np.mean(one != other) > 0.99
        assert np.mean(one != later) > 0.99
        moved = pattern(kind, frame=3, golden=True) - one
        np.testing.assert_allclose(moved % 1, 3 * (np.sqrt(5) - 1) / 2 % 1, atol=2**-22)
    assert low_share(pattern("white")) > 0.8
    assert low_share(pattern("blue")) < 0.1
    nine = np.array([np.roll(pattern("ign"), (i, j), (0, 1)) for i in range(3) for j in range(3)])[:, 2:, 2:]
    # The nine of any 3 x 3 pixels lie about evenly: the widest gap between white ones is 0.31 in the mean.
    gaps = np.diff(np.sort(nine, axis=0), axis=0, append=np.sort(nine, axis=0)[:1] + 1)
    assert np.mean(gaps.max(0)) < 0.2
