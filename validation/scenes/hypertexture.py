# SPDX-License-Identifier: BSD-3-Clause
r"""Hypertexture (Perlin and Hoffert 1989; Bouthors et al. 2008, section 8): a cloud's
density by distance and noise.

With D the distance from the surface into the cloud, 0 on it, the density is

    rho(p) = S(D(p) + noise(p)),

S a sigmoid from 0 to 1. Here S is 3 u^2 - 2 u^3 between two depths, so that it is 0 and 1 exactly
outside them: the core is homogeneous, and where the first depth is above all of the noise, the
surface is empty.

The noise is a sum of octaves of gradient noise (Perlin 1985, with the fade of Perlin 2002):
gradients of unit length at the points with whole coordinates, by a hash of these and a seed
(Jarzynski and Olano 2020), their planes blended by 6 t^5 - 15 t^4 + 10 t^3. It is continuous with
its first two derivatives, 0 at the whole points, and below sqrt(3)/2.
"""

import numpy as np
from numpy.typing import NDArray

from airlight.validation.arrays import Array, Bools, Index
from airlight.validation.scenes.meshes import Mesh

NOISE_BOUND = 0.75**0.5  #: of one octave: half the diagonal of a cell, between its corners' planes


def hypertexture(
    mesh: Mesh,
    voxels: int,
    *,
    cells: float,
    amplitude: float,
    depths: tuple[float, float],
    margin: float,
    seed: int,
) -> tuple[NDArray[np.float32], Array, Array]:
    """Return rho from 0 to 1 in a mesh, (z, y, x), and the corners of the box of
    its voxels, (3,) each [m].

    The distance is computed on every second voxel, and linear between these; it takes seconds.

    The mesh is closed; `voxels` is their number along each axis, in a box with a `margin` around
    the mesh [m]. The four octaves of noise have `cells` as the size of the first, the largest value
    `amplitude` [m], and the `seed`; without noise the density rises from 0 to 1 between two
    `depths` [m].
    """
    from scipy.ndimage import map_coordinates

    low, high = mesh[0].min(axis=0) - margin, mesh[0].max(axis=0) + margin
    # The distance varies slowly: every second voxel is enough, an eighth of the queries.
    coarse = voxels // 2
    sparse = grid_points(low, high, (coarse,) * 3)
    within = inside(mesh, sparse)
    distance = np.zeros(within.shape)
    distance[within] = distance_into(mesh, sparse[within])
    # The centres of the fine voxels in coordinates of the coarse grid, whose first centre is 0.
    place = (np.arange(voxels) + 0.5) * (coarse / voxels) - 0.5
    depth = map_coordinates(
        distance, np.meshgrid(place, place, place, indexing="ij"), order=1, mode="nearest"
    )
    # Noise is needed only where it can change the density: deeper than the last depth plus the
    # largest noise the density is 1 whatever the noise is. Outside the mesh the depth is 0 and
    # stays so.
    edge = (depth > 0) & (depth < depths[1] + amplitude)
    depth[edge] += amplitude * octaves(grid_points(low, high, (voxels,) * 3)[edge], cells, 4, seed)
    return sigmoid(depth, *depths).astype(np.float32), low, high


def gradient_noise(points: Array, seed: int) -> Array:
    """Return one octave of gradient noise at points (n, 3) in cells of size 1,
    (n,), within `NOISE_BOUND`.

    The gradients of all cells of the box around the points are in memory.
    """
    cell = np.floor(points)
    offset = points - cell
    low = cell.min(axis=0).astype(np.int64)
    counts = tuple(int(n) for n in cell.max(axis=0).astype(np.int64) - low + 2)
    # All corners of all cells of the box, one more than cells along each axis.
    lattice = np.stack(np.unravel_index(np.arange(np.prod(counts)), counts), axis=1) + low
    gradients = _gradients(lattice, seed)
    first = np.ravel_multi_index(tuple((cell.astype(np.int64) - low).T), counts)
    # Perlin's 6 t^5 - 15 t^4 + 10 t^3: its first two derivatives are 0 at both ends.
    fade = offset**3 * (offset * (6 * offset - 15) + 10)
    total = np.zeros(len(points))
    for corner in np.ndindex(2, 2, 2):
        gradient = gradients[first + np.ravel_multi_index(corner, counts)]
        weight = np.where(corner, fade, 1 - fade).prod(axis=1)
        # Each corner adds the plane through 0 at the corner with its gradient, weighted by the fade
        # of all three axes.
        total += weight * np.einsum("ij,ij->i", gradient, offset - corner)
    return total


def octaves(points: Array, size: float, count: int, seed: int) -> Array:
    """Return noise at points (n, 3) [m], (n,), within -1 and 1.

    The cells of the first octave have the `size` [m]; those of each next are half as
    large and count half as much.
    """
    weights = 0.5 ** np.arange(count)
    total = np.zeros(len(points))
    for octave, weight in enumerate(weights):
        total += weight * gradient_noise(points * (2**octave / size), seed + octave)
    # The largest possible sum is scaled to 1; seeds of octaves differ so that they are not copies.
    return total / (weights.sum() * NOISE_BOUND)


def sigmoid(depth: Array, empty: float, full: float) -> Array:
    """Return S: 0 up to the depth `empty` [m], 1 from the depth `full` [m] on."""
    u = np.clip((depth - empty) / (full - empty), 0.0, 1.0)
    return np.asarray(u * u * (3 - 2 * u))


def grid_points(low: Array, high: Array, counts: tuple[int, int, int]) -> Array:
    """Return the centres of the voxels of a box, (z, y, x, 3) [m], Mitsuba's
    order; `counts` along x, y, z.
    """
    along = [
        first + (last - first) * (np.arange(n) + 0.5) / n
        for first, last, n in zip(low, high, counts, strict=True)
    ]
    z, y, x = np.meshgrid(along[2], along[1], along[0], indexing="ij")
    return np.stack([x, y, z], axis=-1)


def inside(mesh: Mesh, points: Array) -> Bools:
    """Return which points of a lattice, as of `grid_points`, lie within
    a closed mesh, (z, y, x).
    """
    vertices, faces = mesh
    x, y, z = points[0, 0, :, 0], points[0, :, 0, 1], points[:, 0, 0, 2]
    corners = vertices[faces]
    # Columns may lie on edges of a regular mesh: a little beside it they meet
    # one face, not two or none.
    x, y = x + 1e-7 * (x[1] - x[0]), y + 1.7e-7 * (y[1] - y[0])
    # The columns of the lattice whose x and y lie within the bounding rectangle of each triangle:
    # `_low` is the first of them, `_high` the one after the last.
    ends = [np.searchsorted(columns, corners[:, :, axis]) for axis, columns in enumerate((x, y))]
    (x_low, x_high), (y_low, y_high) = ((end.min(axis=1), end.max(axis=1)) for end in ends)
    triangle = np.repeat(np.arange(len(faces)), (x_high - x_low) * (y_high - y_low))
    # One entry for each pair of a triangle and a column of its rectangle; `number` counts the pairs
    # within a triangle, row by row.
    number = np.arange(len(triangle)) - np.searchsorted(triangle, triangle)
    column = x_low[triangle] + number % np.maximum(x_high - x_low, 1)[triangle]
    row = y_low[triangle] + number // np.maximum(x_high - x_low, 1)[triangle]
    place = np.stack([x[column], y[row]], axis=1)
    a, b, c = (corners[triangle, corner] for corner in range(3))
    # Barycentric weights: a column passes through the triangle if the three areas have one sign,
    # and they weight the corners' heights at the crossing.
    areas = [
        _twice_area(first[:, :2], second[:, :2], place)
        for first, second in ((b, c), (c, a), (a, b))
    ]
    whole = np.sum(areas, axis=0)
    crosses = np.logical_or(
        np.all(np.array(areas) > 0, axis=0), np.all(np.array(areas) < 0, axis=0)
    )
    height = np.sum(
        [area * corner[:, 2] for area, corner in zip(areas, (a, b, c))], axis=0
    ) / np.where(crosses, whole, 1.0)
    # A line upwards leaves the mesh where it meets a face from inside: as many times as
    # it entered it, plus one.
    leaves = np.zeros((len(z) + 1, len(y), len(x)), dtype=np.int64)
    below = np.searchsorted(z, height[crosses])
    np.add.at(
        leaves, (below, row[crosses], column[crosses]), np.sign(whole[crosses]).astype(np.int64)
    )
    # Summed from the top: at a voxel the sum is the number of exits above it minus the number of
    # entries, which is 1 inside and 0 outside.
    return np.asarray(leaves[::-1].cumsum(axis=0)[::-1][1:] > 0)


def distance_into(mesh: Mesh, points: Array) -> Array:
    """Return the distance of points, (n, 3) [m], from a mesh, (n,) [m].

    It is the distance of the nearest of points on the mesh, 11 m apart at most: 0.5 m too long at a
    depth of 40 m.
    """
    from scipy.spatial import cKDTree

    vertices, faces = mesh
    corners = vertices[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    # Triangles with long edges get a finer lattice of points: edges are cut into `count` parts,
    # each shorter than 11 m.
    parts = np.ceil(longest / 11.0).astype(np.int64)
    samples = []
    for count in np.unique(parts):
        i, j = (
            index.ravel()
            for index in np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
        )
        weights = np.stack([i, j, count - i - j], axis=1)[i + j <= count] / count
        samples.append(np.einsum("wc,tcx->twx", weights, corners[parts == count]).reshape(-1, 3))
    return np.asarray(cKDTree(np.unique(np.concatenate(samples), axis=0)).query(points)[0])


def _gradients(cell: Index, seed: int) -> Array:
    """Return unit vectors by whole coordinates, (n, 3): `pcg3d` of Jarzynski and Olano
    2020, in wrapping integers.
    """
    v = (cell + np.array([seed, 3 * seed + 1, 7 * seed + 5])).astype(np.uint32)
    # The hash: a linear congruential step, then two rounds that mix the three coordinates.
    v = v * np.uint32(1664525) + np.uint32(1013904223)
    for _ in range(2):
        for axis in range(3):
            v[:, axis] += v[:, (axis + 1) % 3] * v[:, (axis + 2) % 3]
        v ^= v >> np.uint32(16)
    # Uniform on the sphere: height and azimuth are uniform (Archimedes). 2^-31 takes 32 bits to the
    # range from 0 to 2.
    height = (v[:, 0] + 0.5) * 2.0**-31 - 1
    angle = v[:, 1] * (2.0**-31 * np.pi)
    across = np.sqrt(1 - height**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), height], axis=1)


def _twice_area(first: Array, second: Array, place: Array) -> Array:
    """Return twice the signed area of triangles in the plane, (n,)."""
    to_first, to_second = first - place, second - place
    return np.asarray(to_first[:, 0] * to_second[:, 1] - to_first[:, 1] * to_second[:, 0])
