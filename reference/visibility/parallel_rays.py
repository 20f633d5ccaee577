# SPDX-License-Identifier: BSD-3-Clause
"""The planes that camera rays span with the direction of a directional light.

Along the ray o + x w (x the distance, w of unit length) let u be the unit vector towards the light. In the plane of
both, with

    u = c w + s a,    c = w . u,    s > 0,    a the unit vector across the ray, on the light's side,

a point o + z w + y a has the coordinates (z, y); the ray is y = 0, and the leg from its point x to the light is
(x + c l, s l), l >= 0. So what lies at (z, y) can only be on the leg of

    x = z - y c/s,    where y >= 0:

everything that shadows or dims a directional light is brought down to the ray by this one linear map. The cosine of the
scattering angle is that between the light's way, -u, and the way to the camera, -w: c, the same all along the ray.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference.scene.directional_light import DirectionalLight

Array = NDArray[np.float64]

_SMALLEST_SINE = 1e-12  # a ray this close to the light's direction [rad] is as good as one beside it


@dataclass(frozen=True)
class ParallelRays:
    """Camera rays from one point in the planes that they span with the direction of a directional light."""

    origin: Array  #: where all begin [m], (3,)
    direction: Array  #: unit, (n, 3)
    across: Array  #: unit vector a across the ray, on the light's side, (n, 3)
    cosine: Array  #: c, also that of the scattering angle, (n,)
    sine: Array  #: s, (n,)
    first: Array  #: distance at which the part that is looked at begins, (n,) [m]
    last: Array  #: where it ends, finite; there is none where last <= first, (n,) [m]

    @property
    def to_light(self) -> Array:
        """The unit vectors towards the light, (n, 3): all alike, but for rounding."""
        return self.cosine[:, None] * self.direction + self.sine[:, None] * self.across

    @property
    def ends(self) -> tuple[Array, Array]:
        """Shares of [first, last] between which a ray is looked at: 0 to 1, or nothing."""
        return np.zeros(len(self.first)), np.where(self.last > self.first, 1.0, 0.0)

    def distance(self, ray: NDArray[np.int64], share: Array) -> Array:
        """Return the distances at shares of the way from `first` to `last` of rays of these numbers [m]."""
        first, last = self.first[ray], self.last[ray]
        return np.where(share >= 1, last, first + share * (last - first))


def parallel_rays(origin: Array, direction: Array, light: DirectionalLight, ends: tuple[Array, Array]) -> ParallelRays:
    """Return camera rays in their planes with a light, to be looked at between two distances [m].

    Parameters
    ----------
    origin
        Where all rays begin [m], (3,).
    direction
        Unit vectors, (n, 3).
    light
        The directional light.
    ends
        Distances between which the rays are looked at, (n,) each [m].

    Notes
    -----
    Valid for all directions. A ray towards the light or away from it lies in many planes: any is as good.
    """
    towards = -light.direction
    cosine = direction @ towards
    rest = towards - cosine[:, None] * direction
    sine = np.linalg.norm(rest, axis=1)
    helper = np.cross(direction, np.where(np.abs(direction[:, :1]) < 0.5, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]))
    helper /= np.linalg.norm(helper, axis=1, keepdims=True)
    beside = sine > _SMALLEST_SINE
    across = np.where(beside[:, None], rest / np.maximum(sine, _SMALLEST_SINE)[:, None], helper)
    first, last = (np.where(ends[1] > ends[0], end, 0.0) for end in ends)
    return ParallelRays(origin, direction, across, cosine, np.maximum(sine, _SMALLEST_SINE), first, last)
