# SPDX-License-Identifier: BSD-3-Clause
r"""Clouds whose density differs from place to place: the grids of Mitsuba's `heterogeneous` media.

A grid of values with the maximum rho_max gives the extinction

    sigma_t(p) = scale rho_max rho(p),        rho = values / rho_max  in [0, 1],

linear between the centres of voxels (at (i + 1/2)/n of the grid's box, as Mitsuba has it) and
constant beyond the outermost ones. `Clouds.sigma_t` is scale rho_max, the largest extinction: a
bound for code that knows extinctions alone. `Clouds.density` holds rho.

Mitsuba tells Python a volume's values and its box, and not its transform. The transform is
measured. Box and grid have the same middle. A grid of two voxels a side, 0 at one end of an axis
and 1 at the other, has the coordinate along this axis as its value. Such a grid takes the place of
the volume's own for each axis in turn, while it is read at places around the middle. The densities
are then compared with Mitsuba's own at some points, so nothing else can be taken for a grid that is
linear between voxels.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.realtime.memory import check_memory
from airlight.realtime.numerics.array_types import (
    ArrayTypes,
    PerRay,
    aligned_array,
    bytes_of,
    four_numbers,
)
from airlight.realtime.scene.closed_mesh import ClosedMesh

Array = NDArray[np.float64]

# of the grid, by which float32 leaves its sides beside the axes; more far from the origin
_TURNED = 1e-5


@dataclass(frozen=True)
class DensityGrid:
    """The grid of one cloud."""

    values: NDArray[np.float32]  #: rho from 0 to 1, (z, y, x)
    largest: float  #: extinction where rho is 1 [1/m]
    to_grid: Array  #: from places [m] to the unit cube, (3, 4)

    @property
    def voxel(self) -> float:
        """The width of a voxel along its shortest side [m]."""
        sides = np.linalg.norm(np.linalg.inv(self.to_grid[:, :3]), axis=0)
        return float((sides / self.values.shape[::-1]).min())


@dataclass(frozen=True)
class Density:
    """The density of all clouds of a scene, on the device; one without a grid has
    the density 1 everywhere.
    """

    #: four numbers a voxel: rho there, at its neighbour in x, in y, and in both. One read of them
    #: replaces four: with a number a voxel `ray-march` took 2.2 times as long in `smoke` (28
    #: November 2026, two cores, 160 x 120), and with Dr.Jit's `Texture3f`, which holds one grid
    #: alone, 2.0 times (5.5 for 2.7 CPU s, 29 November 2026)
    table: Any
    first: Any  #: by cloud, the number of its first voxel
    counts: tuple[Any, Any, Any]  #: by cloud, voxels along x, y, z
    #: by cloud, twelve numbers: from places [m] to voxels, whole numbers at their centres
    rows: tuple[Any, ...]
    voxel: Any  #: by cloud, the width of a voxel, infinite where there is no grid [m]

    def at(self, point, cloud: PerRay, active: Any = True) -> PerRay:
        """Return rho at places [m] in clouds of some numbers [1]."""
        Float = type(point.x)
        Four = four_numbers(Float)
        # The cell of eight voxel centres around the place, by its first voxel (i, j, k), and the
        # place (u, v, w) in it.
        x, y, z = self.rows_at(point, cloud, active)
        nx, ny, nz = (dr.gather(mi.UInt32, count, cloud, active) for count in self.counts)
        (i, u), (j, v), (k, w) = (
            _cell(place, count) for place, count in ((x, nx), (y, ny), (z, nz))
        )
        voxel = dr.gather(mi.UInt32, self.first, cloud, active) + (k * ny + j) * nx + i
        # A row of the table has four of the eight values: the row at k and the one at k + 1, or the
        # same row again in the last layer.
        near = dr.gather(Four, self.table, voxel, active)
        far = dr.gather(Four, self.table, voxel + dr.select(k + 1 < nz, nx * ny, 0), active)
        four = dr.lerp(near, far, w)
        return dr.lerp(dr.lerp(four.x, four.y, u), dr.lerp(four.z, four.w, u), v)

    def rows_at(self, point, cloud: PerRay, active: Any) -> tuple[Any, Any, Any]:
        """Return places in voxels."""
        Float = type(point.x)
        # The three rows of four of the transform of the cloud.
        row = [dr.gather(Float, number, cloud, active) for number in self.rows]
        x, y, z = (
            dr.fma(
                row[n],
                point.x,
                dr.fma(row[n + 1], point.y, dr.fma(row[n + 2], point.z, row[n + 3])),
            )
            for n in (0, 4, 8)
        )
        return x, y, z

    def mean_above(self, cloud: int, threshold: float) -> float:
        """Return the mean of rho over the voxels of a cloud in which it is above a
        threshold, 1 without any.
        """
        count = int(np.prod([int(count[cloud]) for count in self.counts]))
        voxel = dr.arange(mi.UInt32, count) + int(self.first[cloud])
        # The first of the four numbers of a voxel is its density.
        rho = dr.gather(type(self.table), self.table, 4 * voxel)
        above = rho > threshold
        # In float64: float32 loses the small terms of a sum over millions of voxels.
        total = float(dr.sum(mi.Float64(dr.select(above, rho, 0)))[0])
        fraction = int(dr.count(above)[0])
        return total / fraction if fraction else 1.0


def _cell(place, count) -> tuple[Any, Any]:
    """Return the number of the voxel before a place, and the fraction of the way to the next."""
    Float = type(place)
    inside = dr.clip(place, 0, Float(count - 1))
    number = mi.UInt32(inside)
    return number, inside - Float(number)


def read_cloud_density(medium: Any, mesh: ClosedMesh) -> DensityGrid:
    """Return the grid of a Mitsuba medium within a mesh, which it must
    cover; see `read_density`.
    """
    name = f"the heterogeneous medium of shape '{mesh.name}'"
    grid = read_density(medium, name)
    # Vertices in coordinates of the grid, 0 to 1 inside of it; the hull may reach beyond the grid
    # by a ten-thousandth of it.
    beyond_side = 1e-4
    reach = grid.to_grid[:, :3] @ mesh.vertices.T + grid.to_grid[:, 3:]
    beyond = (reach < -beyond_side) | (reach > 1 + beyond_side)
    if beyond.any():
        vertex = int(np.argmax(beyond.any(axis=0)))
        place = ", ".join(f"{x:.6g}" for x in mesh.vertices[vertex])
        raise InputError(
            f"{name} has a grid that does not cover the shape: vertex {mesh.own[vertex]} at "
            f"({place}) lies beside it; "
            "expected a to_world of the volume whose unit cube holds the shape"
        )
    return grid


def read_density(medium: Any, name: str) -> DensityGrid:
    """Return the grid of a Mitsuba medium.

    Parameters
    ----------
    medium
        A `heterogeneous` medium.
    name
        The name of the medium in messages.

    Raises
    ------
    InputError
        For an extinction that is no grid of one channel, linear between voxels, with finite values
        of 0 or more, and for an albedo that differs from place to place.
    """
    # The extinction is on a grid and nothing else is.
    parameters = mi.traverse(medium)
    if "sigma_t.data" not in parameters:
        raise InputError(
            f"{name} has an extinction that is no grid; expected a 'gridvolume' as sigma_t"
        )
    if "albedo.value.value" not in parameters:
        raise InputError(
            f"{name} has an albedo that differs from place to place; expected one number or "
            "colour: a 'constvolume'"
        )

    # One channel of finite values, at least one of them above 0.
    values = np.array(parameters["sigma_t.data"], dtype=np.float32)
    if values.ndim == 4 and values.shape[3] > 1:
        raise InputError(
            f"{name} has an extinction of {values.shape[3]} channels on its grid; expected one "
            "channel: grey"
        )
    values = values.reshape(values.shape[:3])
    wrong = ~(np.isfinite(values) & (values >= 0))
    if wrong.any():
        z, y, x = (int(index) for index in np.argwhere(wrong)[0])
        raise InputError(
            f"{name} has {values[z, y, x]:g} in voxel ({x}, {y}, {z}), and {int(wrong.sum())} such "
            "in all; expected "
            "finite densities of 0 or more"
        )
    scale, largest = float(np.array(parameters["scale"]).ravel()[0]), float(values.max())
    if not (scale >= 0 and np.isfinite(scale)):
        raise InputError(f"{name} has the scale {scale:g}; expected a finite number of 0 or more")
    if not largest * scale > 0:
        raise InputError(
            f"{name} is empty: its grid is 0 everywhere; expected densities above 0 somewhere"
        )

    # rho is relative to the largest value, which goes into the extinction. The grid has to read as
    # Mitsuba reads it.
    values /= np.float32(largest)
    grid = DensityGrid(values, largest * scale, _transform(medium, name))
    _compare(name, medium, grid)
    return grid


def along_the_axes(grid: DensityGrid, name: str) -> DensityGrid:
    """Return a grid with its values in the order of the axes of coordinates; messages
    call its medium by `name`.

    Raises InputError for a box whose sides are not along the axes.
    """
    sides = grid.to_grid[:, :3]
    axes = np.abs(sides).argmax(axis=1)  # of coordinates, along those of the grid
    along = sides[np.arange(3), axes]
    if np.abs(sides[:, axes] / along - np.eye(3)).max() > _TURNED:
        raise InputError(
            f"{name} has a grid whose box is turned; expected a to_world that scales, moves and "
            "mirrors, and turns by "
            "right angles alone"
        )
    # A mirrored axis of the grid, u, is read from its other end: 1 - u.
    forwards = np.where(along > 0, 0.0, 1.0) + np.sign(along) * grid.to_grid[:, 3]
    order = np.argsort(axes)
    values = np.flip(grid.values, tuple(2 - np.flatnonzero(along < 0)))
    to_grid = np.column_stack([np.diag(np.abs(along[order])), forwards[order]])
    return replace(grid, values=values.transpose(2 - order[::-1]), to_grid=to_grid)


def _transform(medium: Any, name: str) -> Array:
    """Return the transform of the grid of a medium, (3, 4); messages call the medium by `name`."""
    parameters = mi.traverse(medium)
    # Box and grid have the same middle, however the grid is turned (see the module).
    volume = next(part for part in parameters.hierarchy if part.class_name() == "GridVolume")
    low, high = (
        np.array(corner, dtype=np.float64).ravel()
        for corner in (volume.bbox().min, volume.bbox().max)
    )
    middle, size = 0.5 * (low + high), high - low
    # a copy: `parameters` writes into what it has returned
    values = mi.TensorXf(parameters["sigma_t.data"])
    try:
        matrix = _measured(parameters, volume, middle, size)
    finally:
        parameters["sigma_t.data"] = values
        parameters.update()
    if matrix is None:
        raise InputError(
            f"{name} has a grid that is not linear between voxels; expected a 'gridvolume' with "
            "the filter_type "
            "'trilinear'"
        )
    # Mitsuba rounds a coordinate of the grid by so much, as it adds up
    # products with places in float32.
    rounding = float(np.finfo(np.float32).eps) * np.abs(matrix) @ (np.abs(middle) + size)
    along = np.abs(matrix) * size > np.maximum(_TURNED, 4 * rounding)[:, None]
    if along.sum() == 3:  # Along the axes the sides of the box have all digits.
        matrix = np.where(along, np.sign(matrix) / size, 0.0)
    return np.column_stack([matrix, 0.5 - matrix @ middle])


def _measured(parameters: Any, volume: Any, middle: Array, size: Array) -> Array | None:
    """Return the derivatives of the coordinates of a grid by place, (3, 3)
    [1/m]; its values are lost.

    None for a grid that is not linear between voxels.
    """
    # along the axes of coordinates; the values are linear for 0.25 of the grid from its middle
    steps = 0.2 * size
    # A thin grid that is turned is left by a step of its box: the steps are halved up to 20 times,
    # which serves sides of one to a million.
    for _ in range(20):
        offsets = np.concatenate([np.diag(steps), -np.diag(steps)])
        values = np.empty((3, 6))  # by axis of the grid, and by place
        for axis in range(3):
            # A grid of two voxels a side: 0 at one end of this axis and 1 at the other.
            ends = np.indices((2, 2, 2), dtype=np.float32)[2 - axis]
            parameters["sigma_t.data"] = mi.TensorXf(ends[..., None])
            parameters.update()
            values[axis] = _values(volume, middle + offsets)
        # Where a value is 0 or 1 the place lies beyond the outermost centres, and the value is
        # constant there. A step counts if both of its ends are between the centres on all axes.
        linear = ((values > 0) & (values < 1)).all(axis=0).reshape(2, 3).all(axis=0)
        if linear.all():
            # From end to end a value goes from 0 to 1 in half of the grid.
            return (values[:, :3] - values[:, 3:]) / 2 / (2 * steps)
        steps = np.where(linear, steps, steps / 2)
    return None


def _values(volume: Any, places: Array) -> Array:
    """Return the values of a volume of one channel at places [m], (n, 3)."""
    interaction = dr.zeros(mi.Interaction3f, len(places))
    interaction.p = mi.Point3f(places.T)
    return np.array(volume.eval_1(interaction), dtype=np.float64)


def _compare(name: str, medium: Any, grid: DensityGrid) -> None:
    """Refuse a medium whose extinction is another one than the grid's."""
    # 512 places of the unit cube, drawn once for all, and where they are in the scene.
    count = 512
    fraction = np.random.default_rng(1).random((count, 3))
    places = np.linalg.solve(grid.to_grid[:, :3], (fraction.T - grid.to_grid[:, 3:]))
    interaction = dr.zeros(mi.MediumInteraction3f, count)
    interaction.p = mi.Point3f(*(mi.Float(row) for row in places))
    _, _, sigma_t = medium.get_scattering_coefficients(interaction)
    of_grid = grid.largest * density_at(grid.values, fraction)
    worst = float(np.abs(np.array(sigma_t)[0] - of_grid).max()) / grid.largest
    # A grid read well differs by rounding: by 1e-4 of its largest value where voxels are noise.
    if worst > 2e-3:
        raise InputError(
            f"{name} has a grid that is not read as Mitsuba reads it, by {worst:.2g} of its "
            "largest value; expected a "
            "'gridvolume' with the filter_type 'trilinear'"
        )


def density_at(values: NDArray[np.float32], fraction: Array) -> Array:
    """Return the values of a grid (z, y, x) at places in the unit cube, (n, 3)."""
    counts = np.array(values.shape[::-1])
    # Places in voxels, whole numbers at their centres, constant beyond the outermost ones.
    place = np.clip(fraction * counts - 0.5, 0, counts - 1)
    cell = np.minimum(place.astype(np.int64), np.maximum(counts - 2, 0))
    offset = place - cell
    total = np.zeros(len(fraction))
    for corner in np.ndindex(2, 2, 2):
        # Trilinear: each of the eight corners of the cell by the product of its three weights.
        x, y, z = np.minimum(cell + corner, counts - 1).T
        total += np.where(corner, offset, 1 - offset).prod(axis=1) * values[z, y, x]
    return total


def density_on_device(grids: list[DensityGrid | None], types: ArrayTypes) -> Density:
    """Return the density of clouds on the device.

    Parameters
    ----------
    grids
        By cloud its grid, None for a homogeneous one.
    types
        Array types to compute with.

    Raises
    ------
    InputError
        For more voxels than Dr.Jit counts, or than memory holds.
    """
    shapes = [(1, 1, 1) if grid is None else grid.values.shape for grid in grids]
    first = np.cumsum([0, *(math.prod(shape) for shape in shapes)])
    words, advice = f"density grids of {first[-1]} voxels in all", "use coarser grids"
    if 4 * first[-1] >= 2**32:
        raise InputError(f"{words}; expected fewer than {2**30}, which Dr.Jit can count: {advice}")

    # Four numbers on the device and on the way there, the grid itself, and a copy of it.
    check_memory(words, int(first[-1]) * (4 * bytes_of(types.scalar) + 6 * 4), advice)

    table = np.empty((first[-1], 4), dtype=np.float32)
    counts, rows, voxels = [], [], []
    for grid, shape, begin in zip(grids, shapes, first, strict=False):
        values = np.ones(shape, dtype=np.float32) if grid is None else grid.values
        count = shape[::-1]
        # Each voxel has its neighbours beside it, itself in their place at the end of a row.
        corners = table[begin : begin + values.size].reshape(*shape, 4)
        for number, (down, along) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
            y, x = (
                np.minimum(np.arange(n) + step, n - 1)
                for n, step in zip(shape[1:], (down, along), strict=True)
            )
            np.take(values[:, y], x, axis=2, out=corners[..., number])
        # From places to voxels, whole numbers at their centres; a homogeneous cloud has one
        # voxel, wherever one asks.
        to_grid = np.zeros((3, 4)) if grid is None else grid.to_grid
        to_voxels = to_grid * np.array(count)[:, None]
        to_voxels[:, 3] -= 0.5
        counts.append(count)
        rows.append(to_voxels.ravel())
        voxels.append(np.inf if grid is None else grid.voxel)
    density = Density(
        aligned_array(types.scalar, table.ravel()),
        aligned_array(mi.UInt32, first[:-1].astype(np.uint32)),
        tuple(aligned_array(mi.UInt32, column) for column in np.array(counts, dtype=np.uint32).T),
        tuple(aligned_array(types.scalar, column) for column in np.array(rows).T),
        types.scalar(voxels),
    )
    dr.make_opaque(density.table, density.first, density.counts, density.rows, density.voxel)
    return density
