# SPDX-License-Identifier: BSD-3-Clause
"""Directional lights of the reference, such as the sun: direction and irradiance."""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.reference.scene.colours import colour
from airlight.reference.scene.transforms import SAME, matrix_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DirectionalLight:
    """A directional light."""

    direction: Array  #: unit vector in which its light travels
    irradiance: Array  #: on a surface that faces it [W/m^2], RGB
    emitter: "mi.Emitter"


def is_directional(emitter: "mi.Emitter") -> bool:
    """Return whether an emitter is a directional light."""
    return bool(emitter.class_name() == "DirectionalEmitter")


def read_directional(emitter: "mi.Emitter") -> DirectionalLight:
    """Read a directional light: its direction from the transform, its irradiance from Mitsuba's
    answer at a point.

    Raises InputError for a transform that scales the direction.
    """
    # Mitsuba's light travels along the image of the axis z.
    axis = matrix_of(emitter.world_transform())[:3, 2]
    length = float(np.linalg.norm(axis))
    if abs(length - 1) > SAME:
        raise InputError(
            f"light '{emitter.id()}' has a to_world that scales its direction by {length:g}, by "
            "which Mitsuba multiplies its light on surfaces; expected no scale: remove it, or give "
            "'direction' instead of 'to_world'"
        )
    _, arriving = emitter.sample_direction(dr.zeros(mi.Interaction3f), mi.Point2f(0.5))
    irradiance = colour(arriving, f"light '{emitter.id()}': its irradiance")
    return DirectionalLight(axis / length, irradiance, emitter)
