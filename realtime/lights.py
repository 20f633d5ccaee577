# SPDX-License-Identifier: BSD-3-Clause
"""Point and spot lights as Dr.Jit values."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Light:
    """A light at a point. The arrays hold one entry and are opaque, so a light that moves recompiles nothing."""

    kind: str  #: 'point' or 'spot'
    soft: bool  #: spot: the intensity falls off between beam and cut-off; else constant inside the cone
    position: Any  #: three-vector [m]
    intensity: Any  #: radiant intensity on the axis [W/sr], RGB
    axis: Any = None  #: spot: unit vector from the light along its axis
    cutoff: Any = None  #: spot: half angle beyond which there is no light [rad]
    cos_cutoff: Any = None
    cos_beam: Any = None  #: spot: cosine of the half angle up to which the intensity is full
    inverse_transition: Any = None  #: soft spot: 1 / (cutoff - beam) [1/rad]
