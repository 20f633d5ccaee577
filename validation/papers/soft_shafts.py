# SPDX-License-Identifier: BSD-3-Clause
"""Figures 4.7, 4.8, 4.19 and 5.8 of Ali 2016 measured again, in `fence`, with `soft-shafts`.

The source prints no equation, no scene and no table of errors; the method is reconstructed
from captions. It gives:

* Fig. 5.8: R1 150 samples along each ray, R2 32, R3 32 and a Gaussian, R4 32
  and the bilateral filter;
* Fig. 4.8: 3 light samples with hd = 3, hr = 0.5;
* Fig. 4.19: 4, 8, 16, 32 taps.

Errors are those of airlight plus surface, as root mean square over the mean, against the quadrature, and in the
*penumbra*: where the visible surface gets more than 0.02 and less than 0.98 of the light that it would get without
occluders. Both lights of this fraction are sums over the same sixteen points of the area light, so that a surface that
sees all of the light has the fraction 1. The 95 % interval of a ratio of two errors comes from a jackknife
over vertical strips of the image.

*At equal time* R2 and R3 get more steps, so many that by the times of R1 and R2 (linear in the
steps) they take as long as R4. *Edges* is the median, over the hundredth of the penumbra where the
reference is steepest, of the gradient over that of the reference. *Flicker* is the root mean square
of the second difference of frames in time, of a light that moves in equal steps, over that of the
exact sum over the points for the same frames, in the penumbra of the first.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from airlight.realtime.frame.image import render_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.methods.interface.method import Method
from airlight.realtime.scene.read_scene import Scene, read_scene
from airlight.reference.quadrature.reference import reference_image
from airlight.validation.arrays import Array, Bools
from airlight.validation.clock import time_in_turns
from airlight.validation.papers.claims import INTERVAL, Figure, Figures, quartiles
from airlight.validation.scenes.loading import load_scene
from airlight.validation.statistics.samples import LEVEL, student_quantile
from airlight.validation.study.configuration import (
    SHARED_POINTS,
    Configuration,
    Parameters,
    prepared,
)
from airlight.validation.study.frame_times import moved_light
from airlight.validation.timing import Timing

SCENE, SIZE = "fence", (200, 152)  #: of the frames [pixels]; the source prints none
POINTS = 64

STEPS, MANY = 32, 150
TAPS = (4, 8, 16, 32)

_STRIPS = 16  # of the jackknife

#: Names and values of parameters, beside the defaults: 5 points on a ring, uniform
#: steps, hd = 5, hr = 0.5.
RENDERINGS: Mapping[str, Parameters] = {
    "R1": {"steps": MANY, "filter": "none"},
    "R2": {"steps": STEPS, "filter": "none"},
    "R3": {"steps": STEPS, "filter": "gauss"},
    "R4": {"steps": STEPS},
}
VARIANTS: Mapping[str, Parameters] = {
    "3 points": {"points": 3, "hd": "3"},
    "16 points": {"points": 16},
    "scale 2": {"scale": 2},
    "hd auto": {"guide": "depth", "hd": "auto", "surfaces": "ray"},
    "shared points": SHARED_POINTS,
}


@dataclass(frozen=True)
class Reference:
    """The quadrature of the scene."""

    image: Array  #: airlight plus surface, (height, width, 3) [W/(m^2 sr)]
    penumbra: Bools  #: (height, width)

    def error(self, image: Array, left_out: int | None = None) -> float:
        """Return the relative RMSE of an image in the penumbra; without the strip `left_out`, if
        one is given.
        """
        where = self.penumbra
        if left_out is not None:
            # Strips are of equal width; each column belongs to one of them.
            where = where & (np.arange(where.shape[1]) * _STRIPS // where.shape[1] != left_out)
        expected = self.image[where]
        return float(np.sqrt(np.mean((image[where] - expected) ** 2)) / np.mean(expected))

    def ratio(self, above: Array, below: Array) -> Figure:
        """Return the error of an image over that of another, with its 95 % interval."""
        whole = self.error(above) / self.error(below)
        # Jackknife over n strips: the variance of the ratio is (n - 1)/n times the sum of squared
        # deviations of the ratios without one strip, which is (n - 1) times their variance.
        # Student's quantile has n - 1 degrees of freedom.
        rest = [self.error(above, strip) / self.error(below, strip) for strip in range(_STRIPS)]
        half = student_quantile(0.5 + LEVEL / 2, _STRIPS - 1) * float(
            np.sqrt((_STRIPS - 1) * np.var(rest))
        )
        return Figure(whole, whole - half, whole + half, INTERVAL)

    def edges(self, image: Array) -> float:
        """Return the median gradient of an image over the reference's, at the steepest
        hundredth of the penumbra.
        """
        # Gradients of the green channel.
        shown, true = (np.hypot(*np.gradient(picture[..., 1])) for picture in (image, self.image))
        steep = self.penumbra & (true > np.quantile(true[self.penumbra], 0.99))
        return float(np.median(shown[steep] / true[steep]))


def soft_shafts(size: tuple[int, int] = SIZE, *, seconds: float = 0.3) -> Figures:
    """Return errors, ratios of errors, edges, flicker and rates by the names of the renderings."""
    scene, reference = shafts_scene(size)
    times = timings(scene, RENDERINGS, seconds)
    # The renderings of Fig. 4.19; the best of the smaller counts is compared with the largest.
    taps: dict[str, Parameters] = {f"{count} taps": {"steps": count} for count in TAPS}
    chosen = {**RENDERINGS, **_at_equal_time(times), **VARIANTS, **taps}
    images = {name: rendered(scene, values) for name, values in chosen.items()}
    errors = {name: reference.error(image) for name, image in images.items()}
    fewer = min((f"{count} taps" for count in TAPS[:-1]), key=errors.__getitem__)
    ratio = {name: partial(reference.ratio, image) for name, image in images.items()}
    return {
        **{f"{name} error": error for name, error in errors.items()},
        **{f"{name} flicker": each for name, each in _flicker(scene, reference).items()},
        "R4 edges": reference.edges(images["R4"]),
        "R4 fps": quartiles(times["R4"].rate),
        "R4 over R1": ratio["R4"](images["R1"]),
        "R4 over R2": ratio["R4"](images["R2, equal time"]),
        "R4 over R3": ratio["R4"](images["R3, equal time"]),
        "3 points over 16": ratio["3 points"](images["16 points"]),
        "32 taps over fewer": ratio["32 taps"](images[fewer]),
    }


def shafts_scene(size: tuple[int, int]) -> tuple[Scene, Reference]:
    """Return the scene, with its quadrature and its penumbra."""
    loaded = load_scene(SCENE, size).scene
    scene, reference = read_scene(loaded), reference_image(loaded)
    image = np.asarray(reference.airlight + reference.surface, dtype=np.float64)
    return scene, Reference(image, penumbra(scene))


def penumbra(scene: Scene) -> Bools:
    """Return where the visible surface gets a part of the light, with and without
    occluders from the same points.
    """
    # Both lights are sums over the same sixteen points: where the surface sees the whole light, the
    # fraction is 1.
    points = 16  # the same with and without occluders
    surface = render_frame(prepared(scene, _exact(points))).surface
    bare = frame_renderer(scene, _WithoutShadows, points=points, pattern="sobol")
    unshadowed = np.asarray(render_frame(bare).surface, dtype=np.float64)[..., 1]
    # A surface that faces away from the light is in no penumbra.
    reached = unshadowed > 0
    fraction = np.where(reached, surface[..., 1], 0) / np.where(reached, unshadowed, 1)
    return (fraction > 0.02) & (fraction < 0.98)


@dataclass(frozen=True)
class _WithoutShadows(Method):
    """No airlight, and all light reaches the surfaces."""

    name = "without-shadows"
    provides_visibility = True
    uses_kernel = False

    def airlight(self, view, light, state, kernel):
        """Return no airlight, and that the light reaches every surface."""
        return type(view.medium.albedo)(0), True


def _exact(points: int = POINTS) -> Configuration:
    # Sobol's sequence: the columns of a grid would fall together behind upright bars.
    return Configuration("shadow-planes", "exact", (("points", points), ("pattern", "sobol")))


def _configuration(values: Parameters) -> Configuration:
    return Configuration("soft-shafts", None, tuple(values.items()))


def rendered(scene: Scene, values: Parameters) -> Array:
    """Return airlight plus surface of a rendering [W/(m^2 sr)]."""
    frame = render_frame(prepared(scene, _configuration(values)))
    return np.asarray(frame.airlight + frame.surface, dtype=np.float64)


def timings(scene: Scene, chosen: Mapping[str, Parameters], seconds: float) -> dict[str, Timing]:
    """Return the times of renderings after the light moved, measured in turns, by name."""
    works = [moved_light(prepared(scene, _configuration(values))) for values in chosen.values()]
    return dict(
        zip(chosen, time_in_turns(works, seconds=seconds * len(works), least=3), strict=True)
    )


def _at_equal_time(times: Mapping[str, Timing]) -> dict[str, Parameters]:
    """Return R2 and R3 with so many steps that they take the time of R4."""
    ms = {name: timing.median_ms for name, timing in times.items()}
    # The time is linear in the steps: what one more step costs is the difference of R1 and R2 over
    # that of their steps.
    a_step = max((ms["R1"] - ms["R2"]) / (MANY - STEPS), 1e-6)
    more = {name: round(max(ms["R4"] - ms[name], 0.0) / a_step) for name in ("R2", "R3")}
    return {
        f"{name}, equal time": {**RENDERINGS[name], "steps": STEPS + more[name]} for name in more
    }


def _flicker(scene: Scene, reference: Reference) -> dict[str, float]:
    """Return the flicker of R2 and R4 over that of the exact sum over the points."""
    (light,) = scene.area_lights
    across = light.across / np.linalg.norm(light.across)
    # The light moves along its first edge, by equal steps.
    path = [
        # five frames; the light goes 0.02 m from one to the next
        replace(scene, area_lights=(replace(light, middle=light.middle + step * 0.02 * across),))
        for step in range(5)
    ]

    def second_difference(chosen: Configuration) -> float:
        renderer = prepared(scene, chosen)
        # Frames of one renderer: only the light changes.
        images = [render_frame(replace(renderer, scene=now)) for now in path]
        frames = np.array(
            [(each.airlight + each.surface)[reference.penumbra] for each in images],
            dtype=np.float64,
        )
        return float(np.sqrt(np.mean(np.diff(frames, 2, axis=0) ** 2)))

    # A light that moves evenly has a second difference of its own, which the exact sum shows.
    smooth = second_difference(_exact())
    return {
        name: second_difference(_configuration(RENDERINGS[name])) / smooth for name in ("R2", "R4")
    }
