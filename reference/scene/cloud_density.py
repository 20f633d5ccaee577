# SPDX-License-Identifier: BSD-3-Clause
"""The density of a `heterogeneous` cloud for the reference: Mitsuba's own volume, over its largest value."""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from reference.scene.density_grid import grid_values

Array = NDArray[np.float64]

_FRACTION = 0.125  # of a voxel, between the places at which a density is summed up along a ray
_BEYOND = 1e-4  # how far a shape may reach beyond its grid, as a fraction of that


@dataclass(frozen=True)
class CloudDensity:
    """The varying density of a cloud."""

    medium: Any  #: Mitsuba's
    largest: float  #: extinction [1/m]
    voxel: float  #: width of the grid's voxels along their shortest side, of one along the axes [m]

    def at(self, point, active: Any = True) -> Any:
        """Return the extinction at places [m] over the largest one, 0 to 1."""
        place = dr.zeros(mi.MediumInteraction3f, dr.width(point))
        place.p = point
        _, _, sigma_t = self.medium.get_scattering_coefficients(place, active)
        return dr.clip(sigma_t[0] / self.largest, 0, 1)

    def along(self, origin: Array, way: Array, begin: Array, length: Array) -> Array:
        """Return the integral of the density over stretches of rays [m].

        `origin`: where all rays start, (3,) [m]; `way`: unit directions, (n, 3); `begin`, `length`: where stretches
        begin, and how long they are, (n,) [m].

        The midpoint rule with steps of an eighth of a voxel; Mitsuba's values are in float32.
        """
        if not len(way):
            return np.zeros(0)
        count = np.maximum(np.ceil(length / (_FRACTION * self.voxel)), 1.0)
        start = origin + way * begin[:, None]
        first, step = mi.Point3f(start.T), mi.Vector3f((way * (length / count)[:, None]).T)
        steps = mi.UInt32(count.astype(np.uint32))

        def add(number, total):
            return number + 1, total + mi.Float64(self.at(first + step * (mi.Float(number) + 0.5)))

        state = (dr.zeros(mi.UInt32, len(way)), dr.zeros(mi.Float64, len(way)))
        _, total = dr.while_loop(state=state, cond=lambda number, total: number < steps, body=add)
        return np.asarray(np.array(total) * (length / count))


def read_cloud_density(shape: Any, name: str) -> CloudDensity:
    """Return the density within a shape; messages call its medium by `name`.

    Raises InputError for an extinction that is no grid of one channel with finite values of 0 or more, not all 0,
    around the shape.
    """
    medium = shape.interior_medium()
    parameters = mi.traverse(medium)
    for key, what in (("sigma_t.data", "a grid as its extinction"), ("albedo.value.value", "one albedo everywhere")):
        if key not in parameters:
            raise InputError(f"{name} is heterogeneous without {what}; the reference of clouds wants one")
    values, low, high = grid_values(medium, name)
    box = shape.bbox()
    margin = _BEYOND * (high - low)
    if np.any(np.array(box.min).ravel() < low - margin) or np.any(np.array(box.max).ravel() > high + margin):
        raise InputError(
            f"{name} has a grid that does not cover the shape: it reaches from {_words(low)} to {_words(high)}; wanted "
            "a to_world of the volume whose unit cube holds the shape"
        )
    voxel = float(((high - low) / values.shape[2::-1]).min())
    return CloudDensity(medium, float(values.max()), voxel)


def _words(point: Array) -> str:
    return f"({', '.join(f'{x:.6g}' for x in point)})"
