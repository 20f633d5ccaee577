# SPDX-License-Identifier: BSD-3-Clause
r"""The choice of the triangles of a mesh on which light samples lie: by what
the triangles send to a ray, or to a surface point.

A triangle of area a and unit normal n about the point c sends to a ray in a clear medium, as
one point at its middle,

    a int max(0, n . (x - c)) / |x - c|^3 dx  =  a [q s / (h^2 r) - p / r],    r^2 = h^2 + s^2,

s the distance along the ray from the foot of c, h the height of c over it, q + p s = n . (x - c),
between the ends of the part of the ray that is before the triangle. The area of the triangle is
added to h^2: a triangle that the ray meets then sends a finite amount. To a surface point it sends
a max(0, n . (x - c)) / |x - c|^3.

Triangles are chosen in proportion to this, and a fifth of them by area, so that every triangle that
sends something has a chance; weights divide by the chance itself. In a mesh of many triangles a
group of neighbours is chosen so, and then a triangle of the group by area.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airlight.reference.scene.area_light import ReferenceAreaLight, triangle_normals

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Choice:
    """Triangles for samples of each ray or point, row by row, (rows * samples, ...)."""

    corners: Array  #: counter-clockwise from the side that emits, (..., 3, 3) [m]
    normal: Array  #: unit, (..., 3)
    area: Array  #: [m^2]
    chance: Array  #: with which a triangle was chosen [1]
    square: Array  #: points of the unit square, spread over it within each triangle, (..., 2)
    #: whether it is so close to its ray, or point, that its points differ in what they send
    near: NDArray[np.bool_]


def choose_for_rays(
    light: ReferenceAreaLight, origin: Array, direction: Array, distance: Array, square: Array
) -> Choice:
    """Choose triangles for samples of rays; the parameters are those of
    `light_samples.samples_for_rays`.
    """
    mesh = _Mesh(light)
    way = mesh.centre - origin
    foot = direction @ way.T
    square_height = np.maximum(np.sum(way * way, axis=1) - foot**2, 0.0)
    p = direction @ mesh.normal.T
    q = foot * p - np.sum(way * mesh.normal, axis=1)  # n . (foot - c)
    # The ends of the ray in s, cut at the plane of the triangle: the part before it counts.
    begin, end = -foot, distance[:, None] - foot
    with np.errstate(divide="ignore", invalid="ignore"):
        zero = -q / p
    begin = np.where(p > 0, np.maximum(begin, zero), begin)
    end = np.where(p < 0, np.minimum(end, zero), end)
    softened = square_height + mesh.area

    def until(s: Array) -> Array:
        # The antiderivative q s/(h^2 r) - p/r. Unbounded rays end at `far` [m], whose square is
        # finite.
        far = 1e15
        r = np.sqrt(softened + np.minimum(np.abs(s), far) ** 2)
        return q * np.clip(s, -far, far) / (softened * r) - p / r

    # A ray in parallel to the plane, p = 0, is before it as a whole or not at all.
    worth = np.where(
        (end > begin) & ((p != 0) | (q > 0)), mesh.area * (until(end) - until(begin)), 0.0
    )
    return mesh.chosen(worth, square_height, square)


def choose_for_points(light: ReferenceAreaLight, place: Array, square: Array) -> Choice:
    """Choose triangles for samples of surface points; the parameters are those
    of `light_sections.sections_for_points`.
    """
    mesh = _Mesh(light)
    way = place[:, None] - mesh.centre
    r2 = np.sum(way * way, axis=2)
    above = np.einsum("rgi,gi->rg", way, mesh.normal)
    worth = mesh.area * np.maximum(above, 0.0) / (r2 + mesh.area) ** 1.5
    return mesh.chosen(worth, r2, square)


def choose_by_area(light: ReferenceAreaLight, square: Array) -> Choice:
    """Choose triangles for samples that are to serve all rays, in proportion to their power."""
    mesh = _Mesh(light)
    return mesh.chosen(np.zeros((1, len(mesh.area))), np.full((1, len(mesh.area)), np.inf), square)


class _Mesh:
    """The groups of neighbours among the triangles of a light."""

    def __init__(self, light: ReferenceAreaLight):
        self.triangles = light.triangles
        double = triangle_normals(light.triangles)
        self.areas = 0.5 * np.linalg.norm(double, axis=1)
        self.normals = double / (2 * self.areas[:, None])
        count = len(self.areas)
        # At most 512 groups of neighbours, which follow each other in `triangles`; a small mesh has
        # one triangle in each. A group has the area, the mean place and the mean normal of its
        # triangles, and the mean normal is the shorter the more they are bent to each other.
        self.begin = np.arange(0, count, -(-count // 512))
        self.area = np.add.reduceat(self.areas, self.begin)
        middle = self.areas[:, None] * light.triangles.mean(axis=1)
        self.centre = np.add.reduceat(middle, self.begin) / self.area[:, None]
        self.normal = np.add.reduceat(0.5 * double, self.begin) / self.area[:, None]
        self.below = np.concatenate([[0.0], np.cumsum(self.areas)])

    def chosen(self, worth: Array, square_distance: Array, square: Array) -> Choice:
        """Return a choice of triangles by what groups are worth to each row, (rows, groups)."""
        rows, samples = len(worth), square.shape[-2]
        total = worth.sum(axis=1, keepdims=True)
        # A fifth of the samples goes by area; all of them where no group sends anything.
        part = np.where(total > 0, 0.8, 0.0)
        chance = (
            part * worth / np.where(total > 0, total, 1.0)
            + (1 - part) * self.area / self.area.sum()
        )
        ends = np.cumsum(chance, axis=1)
        ends /= ends[:, -1:]
        # One search for all rows: the cumulated chances of row k are moved to between k and k + 1.
        # The rest of the coordinate within the chosen group is spread over 0 to 1 again.
        row = np.arange(rows)[:, None]
        group = np.searchsorted(
            (ends + row).ravel(), (square[..., 0] + row).ravel(), side="right"
        ).reshape(rows, samples)
        group = np.clip(group - row * len(self.area), 0, len(self.area) - 1)
        its_chance = np.take_along_axis(chance, group, axis=1)
        first = np.take_along_axis(ends, group, axis=1) - its_chance
        rest = np.clip((square[..., 0] - first) / its_chance, 0.0, 1.0)
        # Within the group by area: `below` is the area of all triangles before one.
        low = self.below[self.begin[group]]
        wanted = low + rest * self.area[group]
        last = np.append(self.begin[1:], len(self.areas))[group] - 1
        number = np.clip(
            np.searchsorted(self.below, wanted, side="right") - 1, self.begin[group], last
        )
        rest = np.clip((wanted - self.below[number]) / self.areas[number], 0.0, 1.0)
        its_chance = its_chance * self.areas[number] / self.area[group]
        # As near as three sides of the group: nine areas in the square of a distance.
        near = np.take_along_axis(square_distance, group, axis=1) < 9.0 * self.area[group]
        within = np.stack([rest, np.broadcast_to(square[..., 1], rest.shape)], axis=-1)
        number = number.ravel()
        return Choice(
            self.triangles[number],
            self.normals[number],
            self.areas[number],
            its_chance.ravel(),
            within.reshape(-1, 2),
            near.ravel(),
        )


def places_in(corners: Array, square: Array) -> Array:
    """Return points of triangles, (n, 3, 3), evenly for points of the unit
    square, (n, 2), as (n, 3) [m].
    """
    # The distance from the first corner goes as a root, since the width of a triangle grows from
    # there: equal areas for equal areas of the square.
    root = np.sqrt(square[:, :1])
    across = root * square[:, 1:]
    return (1 - root) * corners[:, 0] + (root - across) * corners[:, 1] + across * corners[:, 2]
