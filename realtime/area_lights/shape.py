# SPDX-License-Identifier: BSD-3-Clause
"""The record of a light with extent.

Every point of its surface sends the same radiance Le into all directions of the half space before it. An element dA
has the intensity Le cos dA in a direction at an angle whose cosine to the normal is cos, and the power pi Le dA.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

KINDS = ("rectangle", "disk", "sphere")


@dataclass(frozen=True)
class AreaLight:
    """A light with extent, on the host, in float64.

    A point of a rectangle or disk is middle + u across + v up, u and v from -1 to 1, for a disk with u^2 + v^2 <= 1.
    """

    name: str  #: of its shape
    kind: str  #: of `KINDS`
    middle: Array  #: (3,) [m]
    across: Array  #: half of one side, or a radius, (3,) [m]
    up: Array  #: half of the other side, or another radius at a right angle, (3,) [m]
    normal: Array  #: of a rectangle or disk, which shine on this side alone; a unit vector (3,)
    radiance: Array  #: Le, RGB (3,) [W/(m^2 sr)]
    opaque: bool  #: whether its shape is black, ends camera rays and shadows other lights; else it is nothing but light

    @property
    def radius(self) -> float:
        """Of a disk or sphere [m]."""
        return float(np.linalg.norm(self.across))

    @property
    def area(self) -> float:
        """What shines [m^2]."""
        across, up = float(np.linalg.norm(self.across)), float(np.linalg.norm(self.up))
        return {"rectangle": 4.0, "disk": math.pi, "sphere": 4 * math.pi}[self.kind] * across * up

    @property
    def power(self) -> Array:
        """Radiant flux pi Le A, RGB (3,) [W]."""
        return math.pi * self.area * self.radiance


def turned_area_light(light: AreaLight, about: Array, turn: Array) -> AreaLight:
    """Return a light turned about a point (3,) [m] by a rotation matrix (3, 3)."""
    middle = about + turn @ (light.middle - about)
    return replace(light, middle=middle, across=turn @ light.across, up=turn @ light.up, normal=turn @ light.normal)
