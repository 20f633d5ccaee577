# SPDX-License-Identifier: BSD-3-Clause
r"""Media around the camera whose extinction differs from place to place:
height fog and density grids.

**Height fog** is a `heterogeneous` medium without sides whose extinction is a volume of type
`heightfog`. The plugin (`validation.scenes.height_fog`) gives its numbers. Each estimator derives
for itself what follows from them.

**A density grid** is a `heterogeneous` medium with a `gridvolume`. Values sit at the centres of
voxels, (i + 1/2)/n of the box of `to_world`. Between centres the extinction is trilinear, in the
outer half voxels constant across the faces, beyond the box 0. Mitsuba tells Python the values and
the box of the volume, and not which side of the box is which axis of the grid. Extinctions at
random places, most of them in dense voxels, are therefore compared with Mitsuba's for each way in
which the grid can lie in the box, mirrored and turned by right angles. One must agree, so that no
other filter, wrap mode or transform is taken for this.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import permutations, product

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.analytic.phase import PhaseFunction
from airlight.errors import InputError

Array = NDArray[np.float64]

NO_EXTINCTION = (
    "the medium has an extinction that differs from place to place, and this asks for one number; "
    "expected a medium of type 'homogeneous'"
)


@dataclass(frozen=True, kw_only=True)
class VaryingMedium:
    """A medium of one albedo and one phase function; its subclass says its density."""

    albedo: Array  #: RGB
    phase: PhaseFunction
    largest: Array  #: a bound of the extinction, RGB [1/m]
    plugin: "mi.Medium"

    @property
    def sigma_t(self) -> Array:
        """Raise InputError: code that asks for one extinction is for homogeneous media."""
        raise InputError(NO_EXTINCTION)


@dataclass(frozen=True, kw_only=True)
class HeightMedium(VaryingMedium):
    """A medium whose density depends on height alone."""

    #: extinction at the base [1/m], base [m], scale height [m]
    layers: tuple[tuple[float, float, float], ...]
    constant: float  #: extinction everywhere between floor and cap [1/m]
    clamped: bool  #: whether layers are constant below their bases
    floor: float  #: [m]
    cap: float  #: [m]
    up: Array  #: unit vector, (3,): heights are along it


def is_height_fog(medium: "mi.Medium | None") -> bool:
    """Return whether a medium is height fog."""
    return medium is not None and "sigma_t.H_1" in mi.traverse(medium)


def read_height_fog(medium: "mi.Medium", albedo: Array, phase: PhaseFunction) -> HeightMedium:
    """Read height fog with an albedo, RGB, and a phase function that were read before."""
    parameters = mi.traverse(medium)
    scale = float(parameters["scale"])
    # The numbers of the volume plugin by the last words of their names. A layer without density is
    # left out.
    number = {
        key.rpartition(".")[2]: np.array(value, dtype=np.float64).ravel()
        for key, value in parameters
        if key.startswith("sigma_t.")
    }
    layers = tuple(
        (scale * sigma_t, float(number[f"z_{i}"][0]), float(number[f"H_{i}"][0]))
        for i in "12"
        if (sigma_t := float(number[f"sigma_{i}"][0])) > 0
    )
    # Mitsuba's majorant bounds the density along all rays.
    largest = np.array(
        medium.get_majorant(dr.zeros(mi.MediumInteraction3f)), dtype=np.float64
    ).reshape(-1)
    return HeightMedium(
        layers=layers,
        constant=scale * float(number["sigma_0"][0]),
        clamped=bool(number["clamped"][0]),
        floor=float(number["floor"][0]),
        cap=float(number["cap"][0]),
        up=number["up"],
        albedo=albedo,
        phase=phase,
        largest=np.array(np.broadcast_to(largest, 3)),
        plugin=medium,
    )


@dataclass(frozen=True, kw_only=True)
class GridMedium(VaryingMedium):
    """A medium in a box along the axes, with an extinction on a grid."""

    values: Array  #: extinction at the centres of voxels, (z, y, x) [1/m]
    low: Array  #: corner of the box, (3,) [m]
    high: Array  #: the opposite corner, (3,) [m]

    def crossed(self, origin: Array, direction: Array) -> tuple[Array, Array]:
        """Return the distances at which rays enter and leave the box, (n,) [m];
        equal where they miss it.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.stack([(corner - origin) / direction for corner in (self.low, self.high)])
        # Along a face: within both planes or beyond one.
        inside = (origin >= self.low) & (origin <= self.high)
        near = np.where(direction == 0, np.where(inside, -np.inf, np.inf), ends.min(axis=0)).max(
            axis=-1
        )
        far = np.where(direction == 0, np.where(inside, np.inf, -np.inf), ends.max(axis=0)).min(
            axis=-1
        )
        # A box behind the ray's beginning is missed, too.
        meets = (far > near) & (far > 0)
        return np.where(meets, np.maximum(near, 0.0), 0.0), np.where(meets, far, 0.0)

    def extinction(self, point: Array) -> Array:
        """Return the extinction at places, (n, 3) [m], 0 out of the box, (n,) [1/m]."""
        inside = np.all((point >= self.low) & (point <= self.high), axis=-1)
        return np.where(inside, _trilinear(self.values, self.voxels(point)), 0.0)

    def voxels(self, point: Array) -> Array:
        """Return places in voxels from the centre of the first, (n, 3)."""
        return (point - self.low) * self.voxels_per_metre - 0.5

    @property
    def voxels_per_metre(self) -> Array:
        """Voxels along each axis over the side of the box, (3,) [1/m]."""
        return np.array(self.values.shape[::-1]) / (self.high - self.low)


def is_grid(medium: "mi.Medium | None") -> bool:
    """Return whether a medium has an extinction on a grid; a medium of type `homogeneous` has no
    box, whatever its extinction.
    """
    return (
        medium is not None and not medium.is_homogeneous() and "sigma_t.data" in mi.traverse(medium)
    )


def read_grid(medium: "mi.Medium", albedo: Array, phase: PhaseFunction) -> GridMedium:
    """Read a grid around the camera with an albedo, RGB, and a phase function that were read
    before.

    Raises InputError for a grid that `grid_values` refuses, or whose extinctions in Mitsuba differ
    from those of `GridMedium`.
    """
    name = f"medium '{medium.id()}'"
    values, low, high = grid_values(medium, name)
    largest = np.full(3, values.max())
    grid = GridMedium(
        values=values,
        low=low,
        high=high,
        albedo=albedo,
        phase=phase,
        largest=largest,
        plugin=medium,
    )
    # Random places in the box: 512 even ones, and, since a grid may be empty nearly everywhere, 64
    # in voxels that are drawn by their values. These 64 are repeated for each way in which the grid
    # can lie in the box.
    random = np.random.default_rng(1)
    even = random.random((512, 3))
    voxel = random.choice(values.size, 64, p=values.ravel() / values.sum())
    dense = np.stack(np.unravel_index(voxel, values.shape), axis=1) + random.random((64, 3))
    dense /= values.shape
    ends = product((0.0, 1.0), repeat=3)
    ways = [np.abs(end - dense[:, order]) for end, order in product(ends, permutations(range(3)))]
    fraction = np.concatenate([even, *ways])
    # Mitsuba's extinctions there.
    interaction = dr.zeros(mi.MediumInteraction3f, len(fraction))
    interaction.p = mi.Point3f((low + fraction * (high - low)).T)
    expected = np.array(medium.get_scattering_coefficients(interaction)[2], dtype=np.float64)[0]
    # The grid as it lies in the box: the first way that agrees, since all ways that agree give the
    # same extinctions. 2e-3 of the largest value is for Mitsuba's places, rounded in float32.
    least = np.inf
    for turned in _turned(values):
        difference = (
            np.abs(expected - _trilinear(turned, fraction * turned.shape[::-1] - 0.5)).max()
            / values.max()
        )
        if difference <= 2e-3:
            return replace(grid, values=turned)
        least = min(least, float(difference))
    raise InputError(
        f"{name} has a grid that is not read as Mitsuba reads it, by {least:.2g} of its largest "
        "value; expected a 'gridvolume' with filter_type 'trilinear', wrap_mode 'clamp' and a "
        "to_world that scales, moves, mirrors and turns by right angles"
    )


def _turned(values: Array) -> Iterator[Array]:
    """Yield a grid with its axes in every order, each forwards or backwards; unchanged first."""
    ways = (slice(None), slice(None, None, -1))
    for order in permutations(range(3)):
        for way in product(ways, repeat=3):
            yield values.transpose(order)[way]


def grid_values(medium: "mi.Medium", name: str) -> tuple[Array, Array, Array]:
    """Return the extinctions of a medium with a grid, (z, y, x) [1/m], and two opposite corners of
    its box, (3,) [m].

    Raises InputError, in which the medium is called `name`, for a grid of several channels, for
    values that are not finite or below 0, and for a grid that is 0 everywhere.
    """
    parameters = mi.traverse(medium)
    values = np.array(parameters["sigma_t.data"], dtype=np.float64)
    if values.ndim > 3 and values.shape[3] != 1:
        raise InputError(
            f"{name} has a grid of {values.shape[3]} channels; expected a grid of one: grey "
            "extinction"
        )
    # The medium's scale multiplies its volume.
    values = values.reshape(values.shape[:3]) * float(np.array(parameters["scale"]).ravel()[0])
    if not np.isfinite(values).all() or values.min() < 0:
        raise InputError(
            f"{name} has densities below 0 or not finite; expected finite ones of 0 or more"
        )
    if not values.max() > 0:
        raise InputError(
            f"{name} has a grid that is 0 everywhere; expected densities above 0 somewhere"
        )
    box = next(part for part in parameters.hierarchy if part.class_name() == "GridVolume").bbox()
    low, high = (np.array(corner, dtype=np.float64).ravel() for corner in (box.min, box.max))
    return values, low, high


def _trilinear(values: Array, place: Array) -> Array:
    """Return the values of a grid (z, y, x) at places in voxels, (n, 3)."""
    # Beyond the outermost centres values are those of the centres; the last cell begins one voxel
    # before the end.
    most = np.array(values.shape[::-1]) - 1
    place = np.clip(place, 0, most)
    cell = np.minimum(place.astype(np.int64), np.maximum(most - 1, 0))
    total = np.zeros(len(place))
    for corner in np.ndindex(2, 2, 2):
        x, y, z = np.minimum(cell + corner, most).T
        total += np.where(corner, place - cell, 1 - (place - cell)).prod(axis=1) * values[z, y, x]
    return total
