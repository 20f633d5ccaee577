# SPDX-License-Identifier: BSD-3-Clause
"""Means over the areas of pixels: sub-pixels that are cut where the image has edges, with an error estimate.

A pixel is a square of the film. On a square two rules are compared: the value at its middle, right for what is linear,
and the mean over Gauss's 2 x 2 points, right for what is cubic,

    offsets from the middle: +-1/(2 sqrt 3) of the side.

The mean of the four points is the value. Where these five rays and those through the corners are not alike (another
number of lit intervals, another depth, a surface that is lit for some) an edge runs through the square; a straight edge
cannot cross a square without parting its corners. What an edge leaves open is about the spread of the nine values, for
each such square on its own: their variances spread^2/12 add up. Elsewhere the difference of the two rules is an upper
estimate of the error, and these add up as they are. Squares that carry more than their share of what their pixel may be
wrong by are cut in four, `_LEVELS` times at most. The last squares take a random point in each quarter instead of
Gauss's: on an edge along the rows of the film all squares would be wrong the same way, and errors would not average.

Near a light the radiance grows as one over the distance to it on the film, which a mean over an area forgives: the
squares around the light are cut to the last level, and the error falls as their size.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from reference.intervals import Certificate
from reference.quadrature import Progress, RayValues, TruthImage, image_of, ray_values
from reference.scene import TruthScene

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Bools = NDArray[np.bool_]

_LEVELS = 5  # squares of 1/32 of a pixel
_CHUNK = 1 << 17  # rays at once
_DEPTH = 0.05  # neighbouring depths that differ by more are of two surfaces, or of one seen edge-on
_FLOOR = 1e-3  # of the mean of the image: below this a pixel's error need not be small relative to it
_SIGMAS = 3.0  # standard deviations of what edges leave open
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])  # in units of half a side
_POINTS = np.concatenate([[[0.0, 0.0]], _CORNERS / np.sqrt(3)])  # the middle, then Gauss's
_GRID = 2 ** (_LEVELS + 1)  # corners of all squares are whole numbers in this fraction of a pixel


@dataclass(frozen=True)
class _Squares:
    """Squares of the film, and what the two rules gave for their share of the mean over the pixel."""

    pixel: Index  #: number of the pixel, (n,)
    middle: Array  #: in units of pixels, (n, 2)
    size: Array  #: side in units of pixels, (n,)
    value: Array  #: airlight, then surface, (n, 6) [W/(m^2 sr)]
    error: Array  #: estimate of its error, a standard deviation where an edge runs through, (n, 6)
    bound: Array  #: bound of the airlight integrals, (n, 3)
    edge: Bools  #: whether an edge runs through it, (n,)


def film_directions(sensor, positions: Array, size: tuple[int, int]) -> Array:
    """Return the unit directions through positions on the film, (n, 3), in float64.

    Parameters
    ----------
    sensor
        A perspective sensor of Mitsuba.
    positions
        Columns and rows in units of pixels from the upper left corner, (n, 2): pixel centres end in one half.
    size
        Width and height of the film in pixels.

    Notes
    -----
    Valid for positions outside of the film too. The derivation is that of the pixel centres in `reference.scene`.
    """
    import mitsuba as mi

    width, height = size
    half_width = np.tan(0.5 * np.deg2rad(float(mi.traverse(sensor)["x_fov"][0])))
    matrix = np.array(sensor.world_transform().matrix, dtype=np.float64).reshape(4, 4)
    # In the camera's own frame x points left and y up; the plane is where pixels are squares of size 1.
    focal = np.full(len(positions), 0.5 * width / half_width)
    plane = np.stack([0.5 * width - positions[:, 0], 0.5 * height - positions[:, 1], focal], axis=1)
    direction = plane @ matrix[:3, :3].T
    return direction / np.linalg.norm(direction, axis=1, keepdims=True)


def area_image(
    truth: TruthScene,
    *,
    samples: int = 256,
    shadow_scale: float = 1.0,
    edges: str = "auto",
    tolerance: float = 1e-3,
    progress: Progress | None = None,
) -> TruthImage:
    """Compute the means over the areas of all pixels.

    Parameters
    ----------
    truth
        The scene.
    samples, shadow_scale, edges
        See `reference.quadrature.quadrature_image`.
    tolerance
        Relative error to reach in airlight and surface, where `_LEVELS` cuts of a pixel suffice. What was reached for
        the airlight is in `airlight_bound`: three standard deviations of an estimate, no strict bound.
    progress
        Called with (done, total, what) after each of the levels.

    Notes
    -----
    Valid for images whose edges are straight within a pixel and further apart than its first nine rays, between which a
    finer thing goes unseen. Distances and angles to the light are those of the centres.
    """
    evaluate = partial(_evaluated, truth, samples=samples, shadow_scale=shadow_scale, edges=edges)
    pixels = truth.width * truth.height
    row, column = np.divmod(np.arange(pixels), truth.width)
    found, centre = evaluate(np.arange(pixels), np.stack([column + 0.5, row + 0.5], axis=1), 1.0)
    certificates = [centre.certificate]
    means = found.value.reshape(pixels, 2, 3).mean(axis=(0, 2))
    floor = np.repeat(_FLOOR * np.where(np.isfinite(means), means, 0.0), 3)
    finished: list[_Squares] = []
    for level in range(1, _LEVELS + 1):
        if progress is not None:
            progress(level, _LEVELS + 1, "sub-pixels")
        cut = _to_cut(_joined([*finished, found]), found, floor, tolerance, pixels)
        if not cut.any():
            break
        finished.append(_chosen(found, ~cut))
        pixel, middle, size = found.pixel[cut], found.middle[cut], 0.5**level
        quarters = (middle[:, None] + 0.5 * size * _CORNERS).reshape(-1, 2)
        found, rays = evaluate(np.repeat(pixel, 4), quarters, size)
        certificates.append(rays.certificate)
    if progress is not None:
        progress(_LEVELS + 1, _LEVELS + 1, "sub-pixels")
    value, error, bound = _summed(_joined([*finished, found]), pixels)
    # The rays through the middles of the first squares, the pixels, come first.
    centre = replace(
        centre,
        distance=centre.distance[:pixels],
        light_angle=centre.light_angle[:pixels],
        certificate=Certificate.of_all(certificates),
    )
    return image_of(truth, centre, value[:, :3], error[:, :3] + bound, value[:, 3:])


def _evaluated(
    truth: TruthScene, pixel: Index, middle: Array, size: float, *, samples: int, shadow_scale: float, edges: str
) -> tuple[_Squares, RayValues]:
    """Apply the two rules to squares; return also what the rays found, those through the middles first."""
    count, area = len(pixel), size**2
    points = np.repeat(_POINTS[:, None], count, axis=1)
    if size <= 0.5**_LEVELS:
        points[1:] = 0.5 * (_CORNERS[:, None] + np.random.default_rng(count).uniform(-1, 1, (4, count, 2)))
    inner = (middle + 0.5 * size * points).reshape(-1, 2)
    # Neighbours share their corners: each is looked at once.
    grid = np.rint((middle + 0.5 * size * _CORNERS[:, None]).reshape(-1, 2) * _GRID).astype(np.int64)
    corners, where = np.unique(grid, axis=0, return_inverse=True)
    positions = np.concatenate([inner, corners / _GRID])
    direction = film_directions(truth.scene.sensors()[0], positions, (truth.width, truth.height))
    rays = _joined_rays(
        [
            ray_values(
                replace(truth, direction=direction[start : start + _CHUNK]),
                samples=samples,
                shadow_scale=shadow_scale,
                edges=edges,
            )
            for start in range(0, len(direction), _CHUNK)
        ]
    )
    of_point = np.concatenate([np.arange(5 * count), 5 * count + where.reshape(-1)]).reshape(9, count)
    value = np.concatenate([rays.airlight, rays.surface], axis=1)[of_point]
    edge = _differ(rays, of_point)
    with np.errstate(invalid="ignore"):  # a ray through a light has an infinite value
        mean = value[1:5].mean(axis=0)
        error = np.where(edge[:, None], np.ptp(value, axis=0) / np.sqrt(12), np.abs(mean - value[0]))
    error = np.where(np.isfinite(error), error, np.abs(mean))
    bound = rays.bound[of_point[1:5]].mean(axis=0)
    return _Squares(pixel, middle, np.full(count, size), mean * area, error * area, bound * area, edge), rays


def _differ(rays: RayValues, of_point: Index) -> Bools:
    """Return for which squares the rays through their points, (points, squares), are not alike."""
    intervals, distance = rays.intervals[of_point], rays.distance[of_point]
    seen, lit = np.isfinite(distance), (rays.surface.max(axis=1) > 0)[of_point]
    nearest, furthest = distance.min(axis=0), np.where(seen, distance, 0).max(axis=0)
    differ = (intervals != intervals[0]).any(axis=0)
    differ |= seen.any(axis=0) & ((furthest > (1 + _DEPTH) * nearest) | ~seen.all(axis=0))
    return np.asarray(differ | (lit.any(axis=0) & ~lit.all(axis=0)), dtype=np.bool_)


def _to_cut(all_squares: _Squares, found: _Squares, floor: Array, tolerance: float, pixels: int) -> Bools:
    """Return which of the squares found last carry more than their share of an error that is too large."""
    value, error, _ = _summed(all_squares, pixels)
    allowed = tolerance * np.maximum(np.abs(value), floor)
    count = np.bincount(all_squares.pixel, minlength=pixels)[found.pixel, None]
    share = np.where(found.edge[:, None], 1 / (_SIGMAS * np.sqrt(count)), 1 / count)
    above = (error > allowed)[found.pixel] & (found.error > share * allowed[found.pixel])
    return np.asarray(above.any(axis=1), dtype=np.bool_)


def _summed(squares: _Squares, pixels: int) -> tuple[Array, Array, Array]:
    """Add up the squares of each pixel: values, errors, bounds."""

    def summed(parts: Array) -> Array:
        return np.stack([np.bincount(squares.pixel, column, pixels) for column in parts.T], axis=1)

    edge = squares.edge[:, None]
    smooth, open_edges = summed(np.where(edge, 0, squares.error)), summed(np.where(edge, squares.error, 0) ** 2)
    return summed(squares.value), smooth + _SIGMAS * np.sqrt(open_edges), summed(squares.bound)


def _chosen(squares: _Squares, which: Bools) -> _Squares:
    return _Squares(*(getattr(squares, field.name)[which] for field in fields(_Squares)))


def _joined(parts: Sequence[_Squares]) -> _Squares:
    return _Squares(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(_Squares)))


def _joined_rays(parts: Sequence[RayValues]) -> RayValues:
    names = ("airlight", "bound", "surface", "distance", "light_angle", "intervals")
    arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    certificate = Certificate.of_all([part.certificate for part in parts])
    return RayValues(**arrays, transitions=sum(part.transitions for part in parts), certificate=certificate)
