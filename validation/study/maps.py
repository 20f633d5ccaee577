# SPDX-License-Identifier: BSD-3-Clause
"""The error of a shadow map against its size, and the flicker under a light that moves.

**The order of the error.** With N texels on a side a shadow edge lies within a texel of its place in the map, an angle
of O(1/N) as seen from the light. A camera ray that crosses the edge enters or leaves the light too early or too late by
that angle over the sine of the angle between ray and edge, both as seen from the light. So the airlight of *every* ray
that crosses a shadow edge is wrong by O(1/N), of either sign: the root of the mean square falls as 1/N, order 1.
Whether edges are steps or ramps does not matter; what is smooth between them is known to O(1/N^2) where the map is
interpolated, O(1/N) where it is not.

Rays that graze a shadow add to this. At a distance of delta from touching a smooth outline the part of a ray that is
hidden has a length of sqrt(delta), and misplacing the outline by epsilon changes it by about epsilon / sqrt(delta). The
mean square, the integral of epsilon^2 / delta from epsilon on, is epsilon^2 log(1/epsilon): the root still falls with
order 1, but for the root of a logarithm, and over sizes of N the slope is 1 - 1 / (2 log N): 0.9 at 128. A straight
edge that the camera sees edge-on hides the rays within epsilon of it whole: there the order is 1/2. Occluders that are
thinner than a texel do not converge before the map resolves them.

**Upright walls.** Where rays have found the jumps on the edges of texels
(`realtime.methods.light_volumes.jump_search`) the edge of a shadow is known to epsilon = 1/64 of a texel, or to
O(1/N^2) where it is a smooth outline between two sides. What is left of order 1 has a constant that is smaller by as
much. Corners of outlines lie within a texel, which has the wrong shape there: a share of O(1/N) of the rays that cross
the edge is wrong by O(1/N), a root mean square of O(N^(-3/2)). So the order lies between 1 and 3/2; occluders that are
thinner than a texel and smooth ones that are met at a grazing angle take from it as above.

**The order of the flicker.** An edge in the map stays where it is while the light moves by less than a texel, and then
jumps by one. Let the light move by m texels a frame, m = N step / 2 at a step in radians. For m < 1 a share m of the
edges jumps in a frame, by O(1/N) each: their root mean square is sqrt(m) / N, and at a given step it falls as
N^(-1/2). For m >= 1 the errors of consecutive frames have nothing to do with each other: the flicker is sqrt(2) times
the error of a frame and falls as 1/N.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import linregress

from analytic.errors import InputError
from realtime.frame.renderer import render_frame
from realtime.scene.lights import Light
from realtime.scene.read_scene import Scene, read_scene
from reference.quadrature.image import quadrature_image
from reference.scene.read import TruthLight, TruthScene, read_truth
from validation.estimates.quadrature import truth_image
from validation.metrics.errors import Metrics, error_metrics
from validation.scenes.animation import animate
from validation.scenes.registry import Animation
from validation.study.configuration import Configuration, configuration, prepared

Array = NDArray[np.float64]
Progress = Callable[[int, int, str], None]

SIZES = (32, 64, 128, 256, 512, 1024, 2048, 4096)  #: of shadow maps [texels]


@dataclass(frozen=True)
class Slope:
    """The slope of a straight line through the logarithms of errors and sizes: error ~ size^-order."""

    order: float  #: NaN for fewer than two errors above 0
    standard_error: float  #: of the order, from the scatter about the line; NaN for fewer than three errors above 0


@dataclass(frozen=True)
class MapErrors:
    """Errors of the airlight by size of the shadow map."""

    configuration: Configuration  #: with the parameters that all sizes share
    sizes: tuple[int, ...]  #: [texels]
    metrics: tuple[Metrics, ...]  #: by size, against the quadrature truth
    slope: Slope  #: of the relative RMSE

    @property
    def errors(self) -> tuple[float, ...]:
        """Relative RMSE by size."""
        return tuple(error.relative_rmse for error in self.metrics)


@dataclass(frozen=True)
class MapFlicker:
    """Flicker of the airlight by size of the shadow map."""

    configuration: Configuration  #: with the parameters that all sizes share
    sizes: tuple[int, ...]  #: [texels]
    texels: tuple[float, ...]  #: by size, how many texels a shadow moves from frame to frame
    flicker: tuple[float, ...]  #: by size, RMS of the image's change less the truth's, over the truth's mean
    errors: tuple[float, ...]  #: by size, RMSE of all frames over the truth's mean
    truth_change: float  #: RMS of the truth's own change over its mean
    nonfinite: int  #: pixels that are left out, because some image has NaN or infinity there
    slope: Slope  #: of the flicker


def fitted_slope(sizes: ArrayLike, errors: ArrayLike) -> Slope:
    """Return the order at which relative errors fall with the texels along an edge of the map, both (n,).

    It is that of least squares of the logarithms; errors that are not positive and finite are left out.
    """
    n, e = np.asarray(sizes, dtype=np.float64), np.asarray(errors, dtype=np.float64)
    counts = (e > 0) & np.isfinite(e)
    if counts.sum() < 2:
        return Slope(math.nan, math.nan)
    line = linregress(np.log(n[counts]), np.log(e[counts]))
    return Slope(-float(line.slope), float(line.stderr) if counts.sum() > 2 else math.nan)


def map_errors(
    scene,
    method: str,
    *,
    kernel: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    sizes: Sequence[int] = SIZES,
    progress: Progress | None = None,
) -> MapErrors:
    """Measure the error of a method in an `mi.Scene`, at its own size, against the size of its shadow map [texels].

    Other errors of the method, such as that of the steps of a marcher, must be well below the error of the largest
    map. A method without shadow maps is refused.
    """
    shared, by_size = _configurations(method, kernel, parameters, sizes)
    read, truth = read_scene(scene), truth_image(scene).airlight
    metrics = []
    for number, (size, chosen) in enumerate(by_size.items()):
        if progress is not None:
            progress(number, len(by_size), f"{shared.label}, map {size}")
        metrics.append(error_metrics(truth, render_frame(prepared(read, chosen)).airlight))
    slope = fitted_slope(list(by_size), [error.relative_rmse for error in metrics])
    return MapErrors(shared, tuple(by_size), tuple(metrics), slope)


def map_flicker(
    scene,
    method: str,
    *,
    kernel: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    sizes: Sequence[int] = SIZES,
    frames: int = 9,
    step: float = 1e-3,
    about: tuple[float, float, float] | None = None,
    progress: Progress | None = None,
) -> MapFlicker:
    """Measure the flicker of the airlight under a slowly circling light, against the size of the shadow map.

    Parameters
    ----------
    scene, method, kernel, parameters, sizes, progress
        As for `map_errors`.
    frames
        Number of frames, at least 2.
    step
        By how much the light turns from frame to frame [rad], rounded to a whole fraction of a turn. As seen from the
        light, what stands in the middle of its circle moves by this angle: `MapFlicker.texels` of 2 / size each.
    about
        A point on the axis of the circle, (3,) [m]; None: the middle of the scene.

    Raises
    ------
    InputError
        As `map_errors`, and for fewer than two frames or a step that is not above 0 and below a radian.
    """
    if frames < 2:
        raise InputError(f"frames: got {frames}, wanted at least 2: flicker is the difference between frames")
    if not 0 < step < 1:
        raise InputError(f"step: got {step:g}, wanted an angle above 0 and below 1 [rad]")
    shared, by_size = _configurations(method, kernel, parameters, sizes)
    turn = round(2 * np.pi / step)
    read, known = read_scene(scene), read_truth(scene)
    total = 1 + len(by_size)
    if progress is not None:
        progress(0, total, "quadrature")
    truth = np.stack([_truth_of(known, moved) for moved in _frames(read, about, turn, frames)])
    images = []
    for number, (size, chosen) in enumerate(by_size.items()):
        if progress is not None:
            progress(1 + number, total, f"{shared.label}, map {size}, moving light")
        images.append(_rendered(read, chosen, _frames(read, about, turn, frames)))
    finite = np.isfinite(np.stack([truth, *images])).all(axis=(0, 1, 4))
    truth = truth[:, finite]
    errors = [image[:, finite] - truth for image in images]
    mean = float(truth.mean())
    flicker = tuple(_rms(np.diff(error, axis=0)) / mean for error in errors)
    return MapFlicker(
        configuration=shared,
        sizes=tuple(by_size),
        texels=tuple(np.pi / turn * size for size in by_size),
        flicker=flicker,
        errors=tuple(_rms(error) / mean for error in errors),
        truth_change=_rms(np.diff(truth, axis=0)) / mean,
        nonfinite=int(np.sum(~finite)),
        slope=fitted_slope(list(by_size), flicker),
    )


def _configurations(
    method: str, kernel: str | None, parameters: Mapping[str, Any] | None, sizes: Sequence[int]
) -> tuple[Configuration, dict[int, Configuration]]:
    """Return the configuration that all sizes share, and that of every size."""
    if not sizes:
        raise InputError("sizes: got none, wanted at least one size of a shadow map, for example 512")
    values = dict(parameters or {})
    if "map" in values:
        raise InputError(
            f"parameters: got map={values['map']}, wanted it in `sizes`: this study varies the size of the map"
        )
    by_size = {size: configuration(method, kernel, values | {"map": size}) for size in sizes}
    return configuration(method, kernel, values), by_size


def _frames(scene: Scene, about: tuple[float, float, float] | None, turn: int, frames: int) -> Iterator[Scene]:
    """Yield the first frames of a turn of the lights."""
    return islice(animate(scene, Animation(moves=("light",), about=about), turn), frames)


def _truth_of(known: TruthScene, moved: Scene) -> Array:
    """Return the true airlight, (height, width, 3), with the lights at the places of a moved scene."""
    near = [light for light in moved.lights if light.w]
    far = [light for light in moved.lights if not light.w]
    lights = tuple(_truth_light(light, there) for light, there in zip(known.lights, near, strict=True))
    turned = zip(known.directional, far, strict=True)
    directional = tuple(replace(light, direction=_axis(there)) for light, there in turned)
    return quadrature_image(replace(known, lights=lights, directional=directional)).airlight


def _truth_light(known: TruthLight, light: Light) -> TruthLight:
    position = np.array(light.position, dtype=np.float64).reshape(3)
    if light.axis is None:
        return replace(known, position=position)
    return replace(known, position=position, axis=_axis(light))


def _axis(light: Light) -> Array:
    high, low = (np.array(part, dtype=np.float64).reshape(3) for part in (light.axis, light.axis_low))
    axis = high + low
    return axis / np.linalg.norm(axis)


def _rendered(scene: Scene, chosen: Configuration, frames: Iterator[Scene]) -> Array:
    """Return the airlight of frames, (frames, height, width, 3)."""
    renderer = prepared(scene, chosen)
    images = [render_frame(replace(renderer, scene=moved)).airlight for moved in frames]
    return np.array(images, dtype=np.float64)


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
