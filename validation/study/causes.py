# SPDX-License-Identifier: BSD-3-Clause
r"""The error of an image by its causes: differences of renders, which add up to the whole.

A method says which of its parameters make errors
(`realtime.methods.interface.method.Method.error_causes`). They are taken away one on top of the
other: R_0 is the image as asked for, R_1 that without the first cause, and so on to R_n, the best
that the method can do. E is the exact sum over the same light samples, by `shadow-planes` with the
kernel `exact`, and T the reference. Then

    R_0 - T = (R_0 - R_1) + (R_1 - R_2) + ... + (R_n - E) + (E - T),

pixel by pixel: by its causes, the rest, and the light samples in place of the light's extent. In a
scene without area lights E is the reference. If the method says that its last cause is all
that is left, that takes the rest.

With <a, b> the mean of a b over pixels and channels, the *fraction* of a part P in
the error D = R_0 - T is

    <P, D> / <D, D>,

so that the fractions add up to 1. A fraction below 0 is of a part that hides others.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from airlight.realtime.methods.interface.method import method_parameters
from airlight.realtime.methods.registry import find_method
from airlight.realtime.parameters import values
from airlight.realtime.scene.read_scene import Scene
from airlight.validation.arrays import Array
from airlight.validation.columns import column
from airlight.validation.study.configuration import Configuration

REST, POINTS = "rest", "light samples"


@dataclass(frozen=True, kw_only=True)
class ErrorPart:
    """A part of an error, or the whole."""

    cause: str = column("error by")
    without: str = column("gone with", meaning="values of parameters, 'exact sum' or 'reference'")
    relative_rmse: float | None = column("rel. RMSE", meaning="over the mean of the reference")
    relative_bias: float | None = column("rel. bias", meaning="over the mean of the reference")
    fraction: float | None = column(
        "fraction of the whole", meaning="in the square of the whole error"
    )
    image: Array  #: signed, (height, width, 3) [W/(m^2 sr)]


def decompose(
    scene: Scene,
    chosen: Configuration,
    reference: Array,
    airlight: Callable[[Configuration], Array],
) -> list[ErrorPart]:
    """Return the whole error of a configuration, and the parts by its causes, which add up to it.

    The reference is that at pixel centres, (height, width, 3) [W/(m^2 sr)]; `airlight` renders a
    configuration in the scene to such an image.
    """
    # R_0 to R_n: each image is without one more cause. A last cause without a configuration is the
    # name of the rest.
    images, named = [airlight(chosen)], [("whole", "reference")]
    rest, last = REST, chosen
    for cause, without in _configurations(chosen, (scene.camera.width, scene.camera.height)):
        if without is None:
            rest = cause
            break
        named.append((cause, _changes(last, without)))
        images.append(airlight(without))
        last = without
    # E and T: where there is no area light, the light samples are no cause, and T stands for both.
    if scene.area_lights:
        points = method_parameters(find_method(chosen.method), dict(chosen.parameters))[1]
        named.append((rest, "exact sum"))
        images.append(
            airlight(Configuration("shadow-planes", "exact", tuple(values(points).items())))
        )
    named.append((POINTS if scene.area_lights else rest, "reference"))
    images = [np.asarray(image, dtype=np.float64) for image in (*images, reference)]
    # The parts are differences of neighbours, and add up to the whole pixel by pixel.
    whole = images[0] - images[-1]
    parts = [whole, *(before - after for before, after in pairwise(images))]
    return [
        _part(*words, part, whole, images[-1]) for words, part in zip(named, parts, strict=True)
    ]


def _configurations(
    chosen: Configuration, size: tuple[int, int]
) -> Iterator[tuple[str, Configuration | None]]:
    """Yield the causes that matter, and the configuration without each and those before
    it; None for the exact sum.
    """
    if chosen.kernel not in (None, "exact"):
        chosen = replace(chosen, kernel="exact")
        yield "kernel", chosen
    method = find_method(chosen.method)
    parameters, _ = method_parameters(method, dict(chosen.parameters))
    for cause, better in parameters.error_causes(size):
        if better is None:
            yield cause, None
            return
        now = values(parameters)
        changes = {name: value for name, value in better.items() if now[name] != value}
        if changes:
            chosen = replace(chosen, parameters=tuple((dict(chosen.parameters) | changes).items()))
            parameters = replace(parameters, **changes)
            yield cause, chosen


def _changes(before: Configuration, after: Configuration) -> str:
    known = dict(before.parameters)
    words = [
        f"{name}={value}"
        for name, value in after.parameters
        if name not in known or known[name] != value
    ]
    return ", ".join([f"kernel={after.kernel}"] * (before.kernel != after.kernel) + words)


def _part(cause: str, without: str, image: Array, whole: Array, reference: Array) -> ErrorPart:
    mean, square = float(reference.mean()), float(np.mean(whole * whole))
    rmse, bias = float(np.sqrt(np.mean(image * image))), float(image.mean())
    return ErrorPart(
        cause=cause,
        without=without,
        relative_rmse=rmse / mean if mean > 0 else None,
        relative_bias=bias / mean if mean > 0 else None,
        fraction=float(np.mean(image * whole)) / square if square > 0 else None,
        image=image,
    )
