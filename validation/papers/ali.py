# SPDX-License-Identifier: BSD-3-Clause
"""Figures 4.8, 4.9, 4.19 and 5.8 of Ali 2016 measured again, in `fence`, with `soft-shafts`.

The source prints no equation, no scene and no table of errors; the method is reconstructed from captions. It gives:

* Fig. 5.8: R1 150 samples along each ray, R2 32, R3 32 and a Gaussian, R4 32 and the bilateral filter;
* Figs. 4.8, 4.9: 3 light points with hd = 3, 5 with hd = 5, hr = 0.5;
* Fig. 4.19: 4, 8, 16, 32 taps;
* the abstract: 74 frames a second, without resolution, scene or processor.

Errors are those of airlight plus surface, as root mean square over the mean, against the exact sum over `TRUTH_POINTS`
points of the light by `shadow-planes`, and in the *penumbra*: where the share of the light that reaches the visible
surface is above 0.02 and below 0.98. That of the sum itself is some thousandths of these.

*At equal time* R2 and R3 get more steps, so many that by the times of R1 and R2 (linear in the steps) they take as long
as R4. *Edges kept* is the median, over the hundredth of the penumbra where the truth is steepest, of the gradient over
that of the truth. *Flicker* is the root mean square of the second difference of frames in time, of a light that moves
in equal steps, over that of the truth of the same frames, in the penumbra of the first.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from realtime.frame.renderer import render_frame, run_cast_and_shade
from realtime.scene.read_scene import Scene, read_scene
from validation.configurations.methods import SHARED_POINTS, Configuration, prepared
from validation.configurations.timing import Timing, moved_light, time_in_turns
from validation.scenes.loading import load_scene

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

SCENE, SIZE = "fence", (800, 600)  #: of the frames [pixels]; the source prints none
TRUTH_POINTS = 64
FPS = 74.0  #: of the abstract
STEPS, MANY = 32, 150
TAPS = (4, 8, 16, 32)
_FRAMES, _TRAVEL = 5, 0.02  # of the flicker: frames, and how far the light goes from one to the next [m]

#: Names and values of parameters, beside the defaults: 5 points on a ring, uniform steps, hd = 5, hr = 0.5.
RENDERINGS: Mapping[str, dict[str, Any]] = {
    "R1": {"steps": MANY, "filter": "none"},
    "R2": {"steps": STEPS, "filter": "none"},
    "R3": {"steps": STEPS, "filter": "gauss"},
    "R4": {"steps": STEPS},
}
VARIANTS: Mapping[str, dict[str, Any]] = {
    "3 points, hd 3": {"points": 3, "hd": "3"},
    "5 points, hd 5": {},
    "16 points, hd 5": {"points": 16},
    "scale 2": {"scale": 2},
    "hd auto": {"guide": "depth", "hd": "auto", "surfaces": "ray"},
    "shared points": dict(SHARED_POINTS),
}


@dataclass(frozen=True)
class ShaftsTruth:
    """The exact sum over the points of the light."""

    image: Array  #: airlight plus surface, (height, width, 3) [W/(m^2 sr)]
    penumbra: NDArray[np.bool_]  #: (height, width)

    def error(self, image: Array) -> float:
        """Return the relative RMSE of an image in the penumbra."""
        return _relative_rmse(image[self.penumbra], self.image[self.penumbra])


@dataclass(frozen=True)
class ShaftsRow:
    """One picture: its error, and how long a frame takes after the light moved."""

    name: str
    parameters: tuple[tuple[str, Any], ...]
    error: float  #: of airlight plus surface in the penumbra, relative RMSE [1]
    edges: float  #: gradient at the steepest edges over that of the truth [1]
    timing: Timing | None = None
    image: Array | None = None  #: airlight plus surface [W/(m^2 sr)]; not in JSON


@dataclass(frozen=True)
class ShaftsStudy:
    """What is measured of Ali 2016."""

    size: tuple[int, int]
    rows: tuple[ShaftsRow, ...]  #: R1 to R4, R2 and R3 at the time of R4, variants, taps
    flicker: Mapping[str, float]  #: by name of the row
    truth: ShaftsTruth

    def row(self, name: str) -> ShaftsRow:
        """Return the row of a name."""
        return next(row for row in self.rows if row.name == name)


def shafts_study(
    size: tuple[int, int] = SIZE, *, seconds: float = 0.6, points: int = TRUTH_POINTS, progress: Progress | None = None
) -> ShaftsStudy:
    """Measure the figures of Ali 2016 again.

    Parameters
    ----------
    size
        Of the frames [pixels].
    seconds
        To spend on the timings of each row [s].
    points
        Of the truth.
    progress
        Callback with the share done and what comes next, or None.
    """

    def step(share: float, what: str) -> None:
        if progress is not None:
            progress(share, what)

    scene = read_scene(load_scene(SCENE, size).scene)
    step(0.0, "truth")
    truth = shafts_truth(scene, points)
    step(0.3, "R1 to R4")
    rows = _timed_rows(scene, truth, RENDERINGS, seconds)
    step(0.5, "at equal time")
    rows += _timed_rows(scene, truth, _at_equal_time(rows), seconds)
    step(0.6, "variants")
    rows += _timed_rows(scene, truth, VARIANTS, seconds)
    taps = {f"{count} taps": {"steps": count} for count in TAPS}
    rows += tuple(_row(scene, truth, name, values) for name, values in taps.items())
    step(0.8, "flicker")
    return ShaftsStudy(size, rows, _flicker(scene, truth, points), truth)


def shafts_truth(scene: Scene, points: int) -> ShaftsTruth:
    """Return the exact sum over light points, and the penumbra of a scene."""
    frame = render_frame(prepared(scene, _exact(points)))
    few = prepared(scene, Configuration("soft-shafts", None, (("points", 16), ("pattern", "sobol"), ("map", 4))))
    _, by_light = run_cast_and_shade(few)
    lanes = np.array(sum(by_light[0]), dtype=np.float64).T
    unshadowed = np.empty_like(lanes)
    unshadowed[np.array(few.pixel)] = lanes
    unshadowed = unshadowed.reshape(frame.surface.shape)[..., 1]
    reached = unshadowed > 0
    share = np.where(reached, frame.surface[..., 1], 0) / np.where(reached, unshadowed, 1)
    image = np.asarray(frame.airlight + frame.surface, dtype=np.float64)
    return ShaftsTruth(image, (share > 0.02) & (share < 0.98))


def _exact(points: int) -> Configuration:
    # Sobol's sequence: the columns of a grid would fall together behind upright bars.
    return Configuration("shadow-planes", "exact", (("points", points), ("pattern", "sobol")))


def _configuration(values: Mapping[str, Any]) -> Configuration:
    return Configuration("soft-shafts", None, tuple(values.items()))


def _row(scene: Scene, truth: ShaftsTruth, name: str, values: Mapping[str, Any]) -> ShaftsRow:
    frame = render_frame(prepared(scene, _configuration(values)))
    image = np.asarray(frame.airlight + frame.surface, dtype=np.float64)
    return ShaftsRow(name, tuple(values.items()), truth.error(image), kept_edges(image, truth), image=image)


def _timed_rows(
    scene: Scene, truth: ShaftsTruth, chosen: Mapping[str, Mapping[str, Any]], seconds: float
) -> tuple[ShaftsRow, ...]:
    rows = [_row(scene, truth, name, values) for name, values in chosen.items()]
    works = [moved_light(prepared(scene, _configuration(values))) for values in chosen.values()]
    timings = time_in_turns(works, seconds=seconds * len(works), least=3)
    return tuple(replace(row, timing=timing) for row, timing in zip(rows, timings, strict=True))


def _at_equal_time(rows: tuple[ShaftsRow, ...]) -> dict[str, dict[str, Any]]:
    """Return R2 and R3 with as many steps as take the time of R4."""
    times = {row.name: row.timing.median_ms for row in rows if row.timing is not None}
    a_step = max((times["R1"] - times["R2"]) / (MANY - STEPS), 1e-6)
    more = {name: max(times["R4"] - times[name], 0.0) / a_step for name in ("R2", "R3")}
    return {
        f"{name} at the time of R4": RENDERINGS[name] | {"steps": STEPS + round(more[name])} for name in ("R2", "R3")
    }


def kept_edges(image: Array, truth: ShaftsTruth) -> float:
    """Return the median gradient of an image over that of the truth, at the steepest hundredth of the penumbra."""
    own, true = (np.hypot(*np.gradient(picture[..., 1])) for picture in (image, truth.image))
    steep = truth.penumbra & (true > np.quantile(true[truth.penumbra], 0.99))
    return float(np.median(own[steep] / true[steep]))


def _flicker(scene: Scene, truth: ShaftsTruth, points: int) -> dict[str, float]:
    """Return the flicker of R1 to R4 and of the variant with shared points over that of the truth."""
    (light,) = scene.area_lights
    across = light.across / np.linalg.norm(light.across)
    path = [
        replace(scene, area_lights=(replace(light, middle=light.middle + step * _TRAVEL * across),))
        for step in range(_FRAMES)
    ]

    def second_difference(chosen: Configuration) -> float:
        renderer = prepared(scene, chosen)
        images = [render_frame(replace(renderer, scene=now)) for now in path]
        frames = np.array([(image.airlight + image.surface)[truth.penumbra] for image in images], dtype=np.float64)
        return float(np.sqrt(np.mean(np.diff(frames, 2, axis=0) ** 2)))

    chosen = {name: _configuration(values) for name, values in RENDERINGS.items()}
    chosen["shared points"] = _configuration(VARIANTS["shared points"])
    smooth = second_difference(_exact(points))
    return {name: second_difference(configuration) / smooth for name, configuration in chosen.items()}


def _relative_rmse(image: Array, truth: Array) -> float:
    return float(np.sqrt(np.mean((image - truth) ** 2)) / np.mean(truth))
