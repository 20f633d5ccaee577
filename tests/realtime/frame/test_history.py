# SPDX-License-Identifier: BSD-3-Clause
"""Frames of noisy methods: other random numbers in each, and the mean with the frames before."""

from dataclasses import dataclass, replace
from itertools import pairwise

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import kstest

from airlight.errors import InputError
from airlight.realtime.frame.image import image_frame, render_frame
from airlight.realtime.frame.incremental import next_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.methods.history import with_history
from airlight.realtime.methods.interface.method import Layers, Method
from airlight.realtime.methods.registry import METHODS, find_method
from airlight.realtime.numerics.noise import PATTERNS, Noise, blue_mask, pcg4d
from airlight.realtime.parameters import parameter
from airlight.realtime.scene.read_scene import read_scene
from tests.helpers.frames import relative_rmse
from tests.helpers.scenes import tiny_scene
from tests.realtime.methods.froxel_fog.test_method import lamp_above

# Random numbers -----------------------------------------------------------------------------------


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
def noisy_scene(variant):
    return read_scene(mi.load_dict(tiny_scene(size=(24, 18))))


def still_frames(renderer, count):
    """Return the airlight of still_frames of a noisy_scene in which nothing moves."""
    cache, images = None, []
    for _ in range(count):
        stages, cache = next_frame(renderer, renderer.scene, cache, **STILL)
        images.append(image_frame(renderer, stages).airlight)
    return images


@pytest.mark.claim("noise-seeds", tolerance="none: bit by bit")
def test_a_frozen_method_draws_the_noise_of_an_unfrozen_one_anew_in_each_frame(noisy_scene):
    frozen, unfrozen = (frame_renderer(noisy_scene, method) for method in (Speckle, Unfrozen))
    images = still_frames(frozen, 3)
    assert frozen.stages.render.n_recordings == 1
    assert min(np.mean(a != b) for a, b in pairwise(images)) > 0.99
    np.testing.assert_array_equal(images, still_frames(unfrozen, 3))
    np.testing.assert_array_equal(images[2], render_frame(replace(unfrozen, frame=2)).airlight)


@pytest.mark.claim("noise-seeds", tolerance="none: bit by bit")
def test_two_runs_differ_and_one_run_repeats(noisy_scene):
    renderer = frame_renderer(noisy_scene, Speckle)
    first, second, again = (render_frame(replace(renderer, run=run)).airlight for run in (0, 1, 0))
    assert np.mean(first != second) > 0.99
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(
        first, render_frame(frame_renderer(noisy_scene, Speckle)).airlight
    )


def test_a_method_that_does_not_say_that_it_is_noisy_is_told_so(noisy_scene):
    @dataclass(frozen=True)
    class Silent(Speckle):
        noisy = False

    with pytest.raises(InputError, match="`noisy` = True"):
        render_frame(frame_renderer(noisy_scene, Silent))


def test_numbers_of_pixels_frames_runs_and_streams_are_even_and_independent(variant):
    """Kolmogorov and Smirnov's test of 65 536 numbers, and the correlation of each with
    the one before, at 1e-4.
    """
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
    found = np.array(
        noise.pattern(kind, golden=golden, pixel=pixel, place=(pixel // size, pixel % size)),
        dtype=float,
    )
    return found if many else found.reshape(size, size)


def low_fraction(values):
    """Return the mean of the spectrum below an eighth of a cycle per pixel; 1 for white noise."""
    power = np.abs(np.fft.fft2(values - values.mean())) ** 2 / values.size / values.var()
    frequency = np.hypot(
        *np.meshgrid(*(np.fft.fftfreq(side) for side in values.shape), indexing="ij")
    )
    return power[(frequency > 0) & (frequency < 1 / 8)].mean()


@pytest.mark.claim(
    "noise-patterns",
    tolerance="Kolmogorov and Smirnov at 1e-4; low fraction of the spectrum below 0.1 if blue",
)
def test_patterns_are_even_over_the_runs_and_in_the_image(variant):
    for kind in PATTERNS:
        assert kstest(pattern(kind, run=np.arange(4096, dtype=np.uint32)), "uniform").pvalue > 1e-4
        one, other, later = pattern(kind), pattern(kind, run=1), pattern(kind, frame=1)
        assert np.mean(one != other) > 0.99
        assert np.mean(one != later) > 0.99
        moved = pattern(kind, frame=3, golden=True) - one
        np.testing.assert_allclose(moved % 1, 3 * (np.sqrt(5) - 1) / 2 % 1, atol=2**-22)
    assert low_fraction(pattern("white")) > 0.8
    assert low_fraction(pattern("blue")) < 0.1
    nine = np.array([np.roll(pattern("ign"), (i, j), (0, 1)) for i in range(3) for j in range(3)])[
        :, 2:, 2:
    ]
    # The nine of any 3 x 3 pixels lie about evenly: the widest gap between white
    # ones is 0.31 in the mean.
    gaps = np.diff(np.sort(nine, axis=0), axis=0, append=np.sort(nine, axis=0)[:1] + 1)
    assert np.mean(gaps.max(0)) < 0.2


# The mean with the frames before ------------------------------------------------------------------


MOVED = {"camera_moved": True}


@dataclass(frozen=True)
class Painted(Speckle):
    """A pattern on the surfaces, as bright as the lamp; the sky is black."""

    noisy = False

    def render(self, view, state, kernel):
        """Return waves at the surface points."""
        there = dr.isfinite(view.distance)
        point = view.at(dr.select(there, view.distance, 0))
        waves = 1.5 + dr.sin(2 * point)
        return Layers(
            dr.select(there, view.lights[0].intensity * type(view.medium.albedo)(waves), 0)
        )


def scene():
    return read_scene(mi.load_dict(tiny_scene(size=(24, 18), lamp=lamp_above())))


def frames(method, steps, *, run=0, **parameters):
    """Return the airlight of frames of scenes that follow one another, each with what moved."""
    renderer = replace(frame_renderer(steps[0][0], method, **parameters), run=run)
    cache, images = None, []
    for now, moved in steps:
        stages, cache = next_frame(renderer, now, cache, **(STILL | moved))
        images.append(image_frame(replace(renderer, scene=now), stages).airlight)
    return np.array(images, dtype=np.float64)


def darker(now, fraction):
    return replace(
        now,
        lights=tuple(replace(light, intensity=light.intensity * fraction) for light in now.lights),
    )


def shifted_camera(now, vector):
    return replace(
        now, camera=replace(now.camera, origin=now.camera.origin + type(now.camera.origin)(*vector))
    )


@pytest.mark.claim("history-alpha-one", tolerance="none: bit by bit")
@pytest.mark.parametrize(
    ("reproject", "clamp"), [("none", "none"), ("surface", "range"), ("surface", "variance")]
)
def test_with_alpha_one_nothing_changes(variant, reproject, clamp):
    now = scene()
    steps = [(now, {}), (now, {}), (shifted_camera(now, (0.1, 0.0, 0.0)), MOVED)]
    plain = frames(Speckle, steps)
    found = frames(with_history(Speckle), steps, alpha=1.0, reproject=reproject, clamp=clamp)
    np.testing.assert_array_equal(found, plain)


@pytest.mark.claim(
    "history-noise", tolerance="1e-6, rounding of 40 sums; four standard errors of 10 368 values"
)
def test_at_rest_frames_are_averaged_exponentially_and_noise_falls(variant):
    alpha, runs, steps = 0.2, 8, [(scene(), {})] * 40
    noise, mean = [], []
    for run in range(runs):
        plain, found = (
            frames(m, steps, run=run, **p) for m, p in ((Speckle, {}), (SPECKLE, {"alpha": alpha}))
        )
        expected = plain[0]
        for image in plain[1:]:
            expected = (1 - alpha) * expected + alpha * image
        np.testing.assert_allclose(found[-1], expected, atol=1e-6)
        noise.append(plain[-1] - 0.5)
        mean.append(found[-1] - 0.5)
    count = np.size(mean)
    # The variance of a variance of normal numbers is 2/n of its square; that of even ones is less.
    assert np.mean(np.square(mean)) * 12 == pytest.approx(
        alpha / (2 - alpha), rel=4 * np.sqrt(2 / count)
    )
    assert np.mean(np.square(noise)) * 12 == pytest.approx(1, rel=4 * np.sqrt(2 / count))


SPECKLE = with_history(Speckle)


@pytest.mark.claim(
    "history-ghost", tolerance="1e-4 relative: 1 - alpha to the power of the frames since"
)
def test_the_ghost_of_a_light_that_changed_fades_like_a_power(variant):
    bright = scene()
    dark = darker(bright, 0.25)
    steps = [(bright, {})] + [(dark, {})] * 5
    images = frames(with_history(Painted), steps, alpha=0.3)
    exact = frames(Painted, steps[1:2])[0]
    left = images[0] - exact
    for number, image in enumerate(images):
        ghost = np.sum((image - exact) * left) / np.sum(left**2)
        assert ghost == pytest.approx(0.7**number, rel=1e-4)


@pytest.mark.claim("history-clamp", tolerance="1e-6 relative of the brightest of nine pixels")
def test_a_clamp_leaves_no_light_brighter_than_the_pixels_around(variant):
    bright = scene()
    steps = [(bright, {}), (darker(bright, 0.05), {})]
    exact = frames(Painted, steps)[1]
    around = np.pad(exact, ((1, 1), (1, 1), (0, 0)), mode="edge")
    nine = np.array([around[i : i + 18, j : j + 24] for i in range(3) for j in range(3)])
    for clamp, most in (("range", nine.max(0)), ("variance", nine.mean(0) + nine.std(0))):
        found = frames(with_history(Painted), steps, alpha=0.1, clamp=clamp)[1]
        assert np.all(found <= (0.9 * np.maximum(most, 0) + 0.1 * exact) * (1 + 1e-5) + 1e-7)
    assert np.any(frames(with_history(Painted), steps, alpha=0.1)[1] > 2 * nine.max(0))


@pytest.mark.claim(
    "history-surface",
    tolerance="a tenth of the error of the same pixel: the blur of bilinear weights",
)
def test_surfaces_are_followed_where_the_camera_moves(variant):
    now = scene()
    steps = [(now, {}), (shifted_camera(now, (0.31, 0.0, 0.0)), MOVED)]
    exact = frames(Painted, steps)[1]
    followed, stayed = (
        frames(with_history(Painted), steps, alpha=0.1, reproject=reproject)[1]
        for reproject in ("surface", "none")
    )
    assert relative_rmse(followed, exact) < 0.1 * relative_rmse(stayed, exact)


def test_what_the_last_frame_did_not_see_starts_anew(variant):
    now = scene()
    away = shifted_camera(now, (0.0, 60.0, 0.0))
    steps = [(darker(now, 4.0), {}), (away, MOVED)]
    found = frames(with_history(Painted), steps, reproject="surface")[1]
    np.testing.assert_array_equal(found, frames(Painted, steps)[1])


@pytest.mark.claim("froxel-jitter", tolerance="below 0.8 of the error of a frame alone")
def test_frames_that_sample_elsewhere_come_closer_to_a_finer_grid(variant):
    now, grid = scene(), {"width": 24, "height": 18, "slices": 12, "far": 6.1}
    froxels = METHODS["froxel-fog"]
    fine = frames(froxels, [(now, {})], **(grid | {"slices": 384}))[0]
    alone = frames(froxels, [(now, {})], **grid)[0]
    many = frames(
        find_method("froxel-fog+history"), [(now, {})] * 128, alpha=0.03, jitter="frames", **grid
    )[-1]
    assert relative_rmse(many, fine) < 0.8 * relative_rmse(alone, fine)


def test_history_has_a_name_and_refuses_parameters_of_its_own_names():
    method = find_method("ray-march+history")
    assert (method.name, method.__mro__[1]) == ("ray-march+history", METHODS["ray-march"])
    assert method(jitter="white").noisy
    assert not method().noisy

    @dataclass(frozen=True)
    class Taken(Speckle):
        alpha: float = parameter(0.5, "a fraction")

    with pytest.raises(InputError, match=r"speckle\+history: the method has a parameter 'alpha'"):
        with_history(Taken)
    with pytest.raises(InputError, match="a shader keeps its own frames"):
        find_method("fog.glsl+history")
