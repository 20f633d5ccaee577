# SPDX-License-Identifier: BSD-3-Clause
"""An oracle of light volumes with upright walls: `tests.evidence.oracles.light_volume` for the
height fields of `realtime.methods.light_volumes.texel_walls`, in the same variables.

The borders of texels cut a ray into pieces of one texel each. On a border the height is a step,
where the side has a wall, or linear. In a texel with walls a line p a + q b + r c = 0 divides two
planes, which may differ from the borders too; a ray that is lit at one end of its piece and not at
the other crosses at the first change of sign of f: on the border, before the line, on it, behind
it, or on the other border. In a texel without walls the line is the diagonal, the planes meet on
it, and f may change its sign twice.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tests.evidence.oracles.height_field import Array, HeightField, Index, Path, by_ray, zero_angle


@dataclass(frozen=True)
class _Texels:
    """Texels that pieces of rays lie in; triples c0, cx, cy stand for c0 + cx x + cy
    y in texels of the face.
    """

    walled: NDArray[np.bool_]
    line: Array  # (3, ...), above 0 in the second part
    first: Array  # height over the first part
    second: Array

    def height(self, second: NDArray[np.bool_], x: Array, y: Array) -> Array:
        """Return the height at points by the plane of one of the parts."""
        return np.where(second, _value(self.second, x, y), _value(self.first, x, y))


def walled_parts(
    field: HeightField, face: int, path: Path, ends: tuple[Array, Array], stops: NDArray[np.bool_]
) -> tuple[Index, Array, Array]:
    """Return what is lit between two angles within a face."""
    low, high = ends[0][:, None], ends[1][:, None]
    lines = _borders(field.size).T
    theta = np.clip(zero_angle(path.normal @ lines, path.direction @ lines), low, high)
    order = np.argsort(theta, axis=1)
    theta = np.take_along_axis(theta, order, axis=1)
    f = np.where(
        (theta > low) & (theta < high),
        _above_border(field, face, path, theta, order),
        _above(field, face, path, theta),
    )
    theta = np.concatenate([low, theta, high], axis=1)
    f = np.concatenate([_above(field, face, path, low), f, _above(field, face, path, high)], axis=1)
    row, angle = _crossings(field, face, path, theta, f, stops)
    # The first crossing of a ray opens an interval if the ray begins in the
    # dark, and so on in turns.
    first = np.searchsorted(row, np.arange(len(f)))
    opens = (np.arange(len(row)) - first[row]) % 2 == np.where(f[row, 0] >= 0, 1, 0)
    lit = f[:, 0] >= 0
    begins, finishes = (
        np.flatnonzero(lit),
        np.flatnonzero(lit ^ (np.bincount(row, minlength=len(f)) % 2 == 1)),
    )
    ray, begin = by_ray(begins, ends[0][begins], row[opens], angle[opens])
    _, end = by_ray(finishes, ends[1][finishes], row[~opens], angle[~opens])
    return ray, begin, end


def _crossings(
    field: HeightField, face: int, path: Path, theta: Array, f: Array, stops: NDArray[np.bool_]
):
    """Return the rays of all crossings, in order, and the angles."""
    start, end = theta[:, :-1], theta[:, 1:]
    texels = _texels_at(field, face, *_texel_of(field.size, _at(path, 0.5 * (start + end))))
    # c0 + cx x + cy y, times c, is linear in the direction.
    half = 0.5 * field.size
    c0, cx, cy = texels.line
    rows = half * cx, half * cy, c0 + half * (cx + cy)
    cosine, sine = (
        sum(p * v[:, i, None] for i, p in enumerate(rows)) for v in (path.normal, path.direction)
    )
    middle = zero_angle(cosine, sine)
    passes = (middle > start) & (middle < end)
    middle = np.where(passes, middle, end)
    side = np.cos(0.5 * (start + middle)) * cosine + np.sin(0.5 * (start + middle)) * sine > 0
    behind_side = side ^ passes

    def f_at(angle: Array, second: NDArray[np.bool_]) -> Array:
        return _f(path, angle, texels.height(second, *_place(field.size, _at(path, angle))))

    walled = texels.walled
    values = [
        f_at(start, side),
        f_at(middle, side),
        f_at(middle, behind_side),
        f_at(end, behind_side),
    ]
    lit = [value >= 0 for value in (f[:, :-1], *values, f[:, 1:])]
    enters, early, jump, late, leaves = (a != b for a, b in pairwise(lit))
    # A ray crosses a texel with walls at its first change if it is lit at one end only, and at the
    # first two if it ends there, whatever the sign at its end.
    changes = np.stack([enters, early, jump, late, leaves])
    first = changes & (np.cumsum(changes, axis=0) == 1)
    changes[4] = False
    two = changes & (np.cumsum(changes, axis=0) <= 2)
    taken = np.where((end >= theta[:, -1:]) & stops[:, None], two, first & (lit[0] != lit[-1]))
    # Without walls the two triangles meet, and the values on the borders are theirs.
    smooth = np.stack(
        [np.zeros_like(early), early, np.zeros_like(early), late, np.zeros_like(early)]
    )
    taken = np.where(walled, taken, smooth)
    angles = (
        start,
        _zero_between(start, middle, *values[:2]),
        middle,
        _zero_between(middle, end, *values[2:]),
        end,
    )
    parts = []
    for which, angle in zip(taken, angles, strict=True):
        row, column = np.nonzero(which)
        parts.append((row, column, angle[row, column]))
    row, column, angle = (np.concatenate(columns) for columns in zip(*parts, strict=True))
    order = np.lexsort((angle, column, row))
    return row[order], angle[order]


def _zero_between(start: Array, end: Array, f1: Array, f2: Array) -> Array:
    """Return where f is 0 between two angles."""
    f1, f2, delta = np.abs(f1), np.abs(f2), end - start
    return np.asarray(start + np.arctan2(f1 * np.sin(delta), f1 * np.cos(delta) + f2))


def _borders(size: int) -> Array:
    """Return (p, q, r) of the lines p a + q b + r c = 0 along x = i, then y = i, inside
    a face, (2 size - 2, 3).
    """
    half, border = 0.5 * size, np.arange(1.0, size)
    zero, level = np.zeros(size - 1), np.full(size - 1, half)
    rows = (
        np.stack([level, zero, half - border], axis=1),
        np.stack([zero, level, half - border], axis=1),
    )
    return np.concatenate(rows)


def _at(path: Path, theta: Array) -> tuple[Array, Array, Array]:
    cosine, sine = np.cos(theta), np.sin(theta)
    a, b, c = (
        cosine * path.normal[:, i, None] + sine * path.direction[:, i, None] for i in range(3)
    )
    return a, b, c


def _place(size: int, at: tuple[Array, Array, Array]) -> tuple[Array, Array]:
    """Return x and y [texels]."""
    a, b, c = at
    return 0.5 * size * (a / c + 1), 0.5 * size * (b / c + 1)


def _texel_of(size: int, at: tuple[Array, Array, Array]) -> tuple[Index, Index]:
    column, row = (
        np.clip(np.floor(coordinate), 0, size - 1).astype(np.int64)
        for coordinate in _place(size, at)
    )
    return column, row


def _f(path: Path, theta: Array, height: Array) -> Array:
    """Return f of points at theta over a height, as in `tests.evidence.oracles.light_volume`."""
    _, _, c = _at(path, theta)
    return np.asarray(np.cos(theta) - path.height[:, None] * c * height)


def _above(field: HeightField, face: int, path: Path, theta: Array) -> Array:
    """Return f of points within texels."""
    at = _at(path, theta)
    texels = _texels_at(field, face, *_texel_of(field.size, at))
    x, y = _place(field.size, at)
    return _f(path, theta, texels.height(_value(texels.line, x, y) > 0, x, y))


def _above_border(field: HeightField, face: int, path: Path, theta: Array, number: Index) -> Array:
    """Return f of points on borders, which have the numbers of their lines in `_borders`."""
    assert field.walls is not None
    size = field.size
    x, y = _place(size, _at(path, theta))
    across_x = number < size - 1
    line = 1 + np.where(across_x, number, number - (size - 1))
    along = np.where(across_x, y, x)
    first = np.clip(np.floor(along), 0, size - 1).astype(np.int64)
    row, column = np.where(across_x, first, line), np.where(across_x, line, first)
    low = field.heights[face][row, column]
    high = field.heights[face][row + across_x, column + ~across_x]
    # on the left, or at the bottom
    place = field.walls[face][row, column, np.where(across_x, 2, 0)]
    along = along - first
    step = np.where(along < place, low, high)
    return _f(path, theta, np.where(np.isnan(place), low + along * (high - low), step))


def _value(numbers: Array, x: Array, y: Array) -> Array:
    return np.asarray(numbers[0] + numbers[1] * x + numbers[2] * y)


def _texels_at(field: HeightField, face: int, column: Index, row: Index) -> _Texels:
    """Return the parts of texels."""
    assert field.walls is not None
    heights = field.heights[face]
    s00, s10, s01, s11 = (heights[row + j, column + i] for j in (0, 1) for i in (0, 1))
    walls = np.moveaxis(field.walls[face][row, column], -1, 0)
    bottom, top, left, right = walls
    has = ~np.isnan(walls)
    ones, zeros = np.ones_like(s00), np.zeros_like(s00)
    corners = {(0, 0): s00, (1, 0): s10, (0, 1): s01, (1, 1): s11}
    # In local coordinates from 0 to 1: no wall or one, then two across from each
    # other, then two that meet.
    line, first, second = _through(
        (0, ones, -ones), (s00, s11 - s01, s01 - s00), (s00, s10 - s00, s11 - s10)
    )
    across = has[2] & has[3]
    line, first, second = _replace(
        across,
        (line, first, second),
        ((-left, left - right, ones), (s00, s10 - s00, zeros), (s01, s11 - s01, zeros)),
    )
    across = has[0] & has[1]
    line, first, second = _replace(
        across,
        (line, first, second),
        ((-bottom, ones, bottom - top), (s00, zeros, s01 - s00), (s10, zeros, s11 - s10)),
    )
    for i, j in corners:
        x, y = (bottom, top)[j], (left, right)[i]
        meet = has[j] & ~has[1 - j] & has[2 + i] & ~has[3 - i]
        # Through (x, j) and (i, y), with the corner (i, j) on its negative side.
        per_x, per_y = 1 / (x - i), 1 / (y - j)
        other, beside, over = corners[1 - i, 1 - j], corners[i, 1 - j], corners[1 - i, j]
        run, rise = (other - beside) * (1 - 2 * i), (other - over) * (1 - 2 * j)
        plane = other - run * (1 - i) - rise * (1 - j), run, rise
        new = (-1 - i * per_x - j * per_y, per_x, per_y), (corners[i, j], zeros, zeros), plane
        line, first, second = _replace(meet, (line, first, second), new)
    line, first, second = (
        np.stack([c[0] - c[1] * column - c[2] * row, c[1], c[2]]) for c in (line, first, second)
    )
    return _Texels(has.any(axis=0), line, first, second)


def _through(*triples) -> list[Array]:
    return [np.stack(np.broadcast_arrays(*triple)) for triple in triples]


def _replace(where: NDArray[np.bool_], old, new) -> list[Array]:
    """Return triples of numbers, replaced in some texels."""
    return [np.where(where, triple, kept) for kept, triple in zip(old, _through(*new), strict=True)]
