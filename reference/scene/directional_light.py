# SPDX-License-Identifier: BSD-3-Clause
"""Directional lights of the reference, such as the sun: direction and irradiance, read from Mitsuba."""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DirectionalLight:
    """A directional light."""

    direction: Array  #: unit vector in which its light travels
    irradiance: Array  #: on a surface that faces it [W/m^2], RGB
    emitter: Any  #: Mitsuba's


def is_directional(emitter) -> bool:
    """Return whether an emitter of Mitsuba is a directional light."""
    return bool(emitter.class_name() == "DirectionalEmitter")


def read_directional(emitter) -> DirectionalLight:
    """Read a directional emitter: its direction from the transform, its irradiance by asking at a point."""
    matrix = np.array(emitter.world_transform().matrix, dtype=np.float64).reshape(4, 4)
    _, arriving = emitter.sample_direction(dr.zeros(mi.Interaction3f), mi.Point2f(0.5))
    irradiance = np.array(arriving, dtype=np.float64).reshape(-1)
    return DirectionalLight(matrix[:3, 2] / np.linalg.norm(matrix[:3, 2]), np.broadcast_to(irradiance, 3), emitter)
