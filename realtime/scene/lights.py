# SPDX-License-Identifier: BSD-3-Clause
"""Point, spot and directional lights as Dr.Jit values.

A directional light is at infinity. What it lights is media with bounds; the middle of a face across it, where these
end, stands for its place (`realtime.scene.directional_extent`).
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from realtime.numerics.array_types import ArrayTypes, is_single


@dataclass(frozen=True)
class Cone:
    """A cone about the axis of a spot, by its half angle."""

    cos: Any
    square_sin: Any
    square_sin_low: Any  #: what rounding took from `square_sin`


@dataclass(frozen=True)
class Face:
    """A rectangle across a directional light where the media end, and the media before it."""

    across: Any  #: half of one side, a three-vector [m]
    up: Any  #: half of the other [m]
    depth: Any  #: how far before it there are no shapes any more [m]
    media: Any  #: middles of balls whose hull holds the media, several entries [m]
    radii: Any  #: their radii [m]
    back: Any  #: how far from the middle of the media there are none, in any direction [m]


@dataclass(frozen=True)
class Light:
    """A light. The arrays hold one entry and are opaque, so a light that moves recompiles nothing."""

    kind: str  #: 'point', 'spot' or 'directional'
    soft: bool  #: spot: the intensity falls off between beam and cut-off; else constant inside the cone
    position: Any  #: three-vector; directional: the middle of `face` [m]
    intensity: Any  #: radiant intensity on the axis [W/sr], RGB; directional: irradiance of a plane across it [W/m^2]
    axis: Any = None  #: spot: unit vector from the light along its axis; directional: in which the light travels
    axis_low: Any = None  #: spot, directional: what rounding took from `axis`
    cutoff: Any = None  #: spot: half angle beyond which there is no light [rad]
    cone: Any = None  #: spot: the `Cone` of the cut-off
    beam: Any = None  #: soft spot: the `Cone` in which the intensity is full
    inverse_transition: Any = None  #: soft spot: 1 / (cutoff - beam) [1/rad]
    face: Any = None  #: directional: the `Face` through which all light of the media comes

    @property
    def cos_cutoff(self) -> Any:
        """Cosine of the half angle beyond which there is no light."""
        return self.cone.cos if self.cone else None


def spot_fields(axis, cutoff: float, beam: float, types: ArrayTypes) -> dict[str, Any]:
    """Return the fields of a `Light` that only a spot has.

    Parameters
    ----------
    axis
        Unit vector from the light along its axis, in float64.
    cutoff, beam
        Half angles beyond which there is no light, and up to which the intensity is full [rad].
    types
        Of the arrays.
    """
    axis = np.asarray(axis, dtype=np.float64)
    high, low = with_low(axis, types)
    fields = {
        "axis": types.vector(*(float(one) for one in high)),
        "axis_low": types.vector(*(float(one) for one in low)),
        "cutoff": types.scalar(cutoff),
        "cone": _cone(cutoff, types),
    }
    if beam < cutoff:
        fields |= {"beam": _cone(beam, types), "inverse_transition": types.scalar(1 / (cutoff - beam))}
    return fields


def with_low(values, types: ArrayTypes):
    """Return float64 values as they are in a precision, and what rounding takes from them, in float64."""
    values = np.asarray(values, dtype=np.float64)
    high = values.astype(np.float32 if is_single(types.scalar) else np.float64).astype(np.float64)
    return high, values - high


def _cone(angle: float, types: ArrayTypes) -> Cone:
    square, low = with_low(math.sin(angle) ** 2, types)
    return Cone(types.scalar(math.cos(angle)), types.scalar(float(square)), types.scalar(float(low)))
