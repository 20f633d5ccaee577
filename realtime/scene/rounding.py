# SPDX-License-Identifier: BSD-3-Clause
"""How much of a scene's lengths float32 coordinates lose: a scene in map coordinates is
another one once it is loaded.

Mitsuba holds positions as float32 numbers. A coordinate x is rounded by 2^-24 |x| at most, so
either end of a length d moves by sqrt(3) 2^-24 |x|, and the length changes by

    2 sqrt(3) 2^-24 max |x|/d.

Airlight goes with 1/d, so it is wrong by the same fraction; a bound of the reference holds for the
rounded scene. The lengths are the distances of the camera from each light that has a place, and the
size of the whole scene.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.realtime.transforms import host_matrix

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rounding:
    """The rounding of a length of a scene."""

    what: str  #: such as "light 'lamp' is 2.9 m from the camera"
    farthest: float  #: the largest coordinate of its ends [m]
    relative: float  #: how wrong the length can be [1]

    def __str__(self) -> str:
        return (
            f"{self.what}, and coordinates there are up to {self.farthest:.6g} m, where float32 "
            "numbers "
            f"lie {np.spacing(np.float32(self.farthest)):.2g} m apart: the length is known to "
            f"{100 * self.relative:.1g} %"
        )


def check_rounding(scene: Any) -> None:
    """Refuse a scene too far from its origin.

    Parameters
    ----------
    scene
        An `mi.Scene` with a camera.

    Raises
    ------
    InputError
        Where float32 coordinates change a length by more than 0.1 %.
    """
    largest = 1e-3  # a tenth of the difference at which `compare` calls an image wrong
    worst = _worst(scene)
    if worst is not None and worst.relative > largest:
        middle = ", ".join(f"{value:.0f}" for value in _place(scene.sensors()[0]))
        raise InputError(
            f"{worst}; expected {100 * largest:g} % at most: subtract an offset, such as "
            f"({middle}), everywhere"
        )


def rounding_notes(scene: Any) -> list[str]:
    """Return a note on the rounding of coordinates in an `mi.Scene`, none
    where it does not matter.
    """
    noted = 1e-5  # some ten times the rounding of float32 arithmetic, which methods have anyway
    worst = _worst(scene)
    return [] if worst is None or worst.relative <= noted else [str(worst)]


def _place(plugin: Any) -> Array:
    return host_matrix(plugin.world_transform())[:3, 3]


def _worst(scene: Any) -> Rounding | None:
    """Return the length that the rounding changes most, None without any or without a
    camera, which readers refuse.
    """
    if not scene.sensors():
        return None
    camera = _place(scene.sensors()[0])
    # The distances of lights from the camera, then the size of the whole scene with the camera.
    lengths = [
        _rounding(f"light '{name}' is {{:.3g}} m from the camera", camera, place)
        for name, place in _lights(scene)
    ]
    shapes = [shape.bbox() for shape in scene.shapes()]
    if shapes:
        ends = np.array(
            [[np.ravel(box.min), np.ravel(box.max)] for box in shapes], dtype=np.float64
        )
        low, high = (
            np.minimum(ends[:, 0].min(axis=0), camera),
            np.maximum(ends[:, 1].max(axis=0), camera),
        )
        lengths.append(_rounding("the scene is {:.3g} m large", low, high))
    return max(lengths, key=lambda each: each.relative, default=None)


def _lights(scene: Any) -> Iterator[tuple[str, Array]]:
    """Yield the names and places of lights that have one [m]."""
    for emitter in scene.emitters():
        if emitter.class_name() == "PointLight":  # its transform may say nothing of its place
            yield emitter.id(), np.array(mi.traverse(emitter)["position"], dtype=np.float64).ravel()
        elif emitter.class_name() == "SpotLight":
            yield emitter.id(), _place(emitter)
    for shape in scene.shapes():
        if shape.is_emitter():
            box = shape.bbox()
            yield shape.id(), 0.5 * (np.ravel(box.min) + np.ravel(box.max)).astype(np.float64)


def _rounding(what: str, first: Array, second: Array) -> Rounding:
    length = float(np.linalg.norm(second - first))
    farthest = float(max(np.abs(first).max(), np.abs(second).max()))
    # Ends in one place have no length to lose; what lies on a ray is refused for that.
    # Both ends move by sqrt(3) times the rounding of a float32 number, 2^-24 of the coordinate.
    relative = 2 * np.sqrt(3) * 2.0**-24 * farthest / length if length > 0 else 0.0
    return Rounding(what.format(length), farthest, float(relative))
