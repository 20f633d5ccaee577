# SPDX-License-Identifier: BSD-3-Clause
"""Means over the areas of pixels: sub-pixels that are cut where the image has edges, with an error estimate.

A pixel is a square of the film. On a square two rules are compared: the value at its middle, right for what is linear,
and Simpson's in two dimensions, right for what is cubic,

    (8 middle + sum of the four corners) / 12:    x^2 has the mean 1/3 on [-1, 1]^2, and 4/12 by the rule.

Both take points that squares share: a middle is a corner of the four quarters, and a corner is one of its neighbours'.
So to cut a square costs six or seven rays, not 4 x 5. Where its five rays are not alike (another number of lit
intervals, another depth, a surface that is lit for some) an edge runs through the square; a straight edge cannot cross
a square without parting its corners. What an edge leaves open is about the spread of the five values, for each such
square on its own: their variances spread^2/12 add up. Elsewhere the difference of the two rules is an upper estimate of
the error, and these add up as they are. Every pixel is cut in four, and then squares that carry more than their share
of what their pixel may be wrong by.

The last squares with edges, `_LEVELS` cuts down, take a random point in each quarter: on an edge along the rows of the
film rays on a grid would be wrong the same way in all squares, and errors would not average. A straight edge crosses at
most three of the quarters. Each crossed one is covered to a share p, of which the point is a guess with the variance p
(1 - p), 1/6 on average: the mean of the four is off by sqrt(3/6)/4 = 0.18 of the jump. With a quarter of the spread of
the four values, which now and then shows nothing of an edge, that is not underestimated.

Near a light the radiance grows as one over the distance to it on the film, which a mean over an area forgives: the
squares around the light are cut `_DEEPEST` times, and the error falls as their size.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.quadrature.light_points import PointPlan
from reference.quadrature.ray_values import Progress, RayValues, TruthImage, image_of, ray_values
from reference.quadrature.unbounded import sums_of
from reference.scene.camera import film_directions, pixel_centres
from reference.scene.read import TruthScene
from reference.scene.shapes import read_shapes
from reference.visibility.intervals import RandomChecks

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Bools = NDArray[np.bool_]

_LEVELS = 4  # with an edge: squares of 1/16 of a pixel, with points in their quarters
_DEEPEST = 8  # around a light: of 1/256
_AROUND = 3.0  # sides of a square: squares with a light closer than this are cut so deep
_CHUNK = 1 << 17  # rays at once
_POINTS_OF_LIGHTS = 256  # of lights with extent, at most: a pixel has many rays
_DEPTH = 0.05  # neighbouring depths that differ by more are of two surfaces, or of one seen edge-on
_CLOSE = 0.05  # sides of a square: a ray that comes closer to a light says nothing of the rest of the square
_FLOOR = 1e-3  # of the mean of the image: below this a pixel's error need not be small relative to it
_SIGMAS = 3.0  # standard deviations of what edges leave open
_CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])  # in units of half a side
_POINTS = np.concatenate([[[0.0, 0.0]], _CORNERS])
_GRID = 2 ** (_DEEPEST + 1)  # corners and middles of all squares are whole numbers in this fraction of a pixel
_ROW = 1 << 32  # more than a row of the grid has points: one number per point

# Of `RayValues`, one row per ray:
_LAYERS = ("airlight", "bound", "surface", "distance", "light_angle", "intervals", "emitted", "replicates")

Trace = Callable[[Array], RayValues]


@dataclass(frozen=True)
class _Squares:
    """Squares of the film, and what their rays gave for their share of the mean over the pixel."""

    pixel: Index  #: number of the pixel, (n,)
    middle: Array  #: in units of pixels, (n, 2)
    size: Array  #: side in units of pixels, (n,)
    value: (
        Array  #: airlight, then surface, then what lights with extent emit if there are any, (n, 6 or 9) [W/(m^2 sr)]
    )
    error: Array  #: estimate of its error, a standard deviation where an edge runs through, (n, 6 or 9)
    replicates: Array  #: of airlight and surface, of lights with extent, flattened, (n, 6 replicates or 0)
    bound: Array  #: bound of the airlight integrals, (n, 3)
    edge: Bools  #: whether an edge runs through it, (n,)
    light: Bools  #: whether a light is close, (n,)


@dataclass(frozen=True)
class _Film:
    """The points of the grid that were looked at."""

    key: Index  #: row times `_ROW` plus column, ascending
    rays: RayValues  #: what was found there, in that order


def area_image(
    truth: TruthScene,
    *,
    samples: int = 256,
    shadow_scale: float = 1.0,
    edges: str = "auto",
    tolerance: float = 1e-3,
    progress: Progress | None = None,
    plan: PointPlan | None = None,
) -> TruthImage:
    """Compute the means over the areas of all pixels.

    Parameters
    ----------
    truth
        The scene.
    samples, shadow_scale, edges, plan
        See `reference.quadrature.image.quadrature_image`.
    tolerance
        Relative error [1] to reach in airlight and surface, where `_LEVELS` cuts of a pixel suffice. What was reached
        for the airlight is in `airlight_bound`: three standard deviations of an estimate, no strict bound.
    progress
        Called with (done, total, what) after each of the levels.

    Returns
    -------
    TruthImage
        The means, (height, width, 3) [W/(m^2 sr)].

    Notes
    -----
    Valid for images whose edges are straight within a pixel and further apart than its first thirteen rays; finer
    things between those go unseen. Distances and angles to the light are those of the centres.
    """
    # Rays that share their draws differ by what they see alone.
    plan = replace(plan or PointPlan(most=_POINTS_OF_LIGHTS), shared=True)
    how: dict[str, Any] = {"samples": samples, "shadow_scale": shadow_scale, "edges": edges, "plan": plan}
    trace = partial(_traced, truth, shapes=read_shapes(truth.occluders), **how)
    pixels = truth.width * truth.height
    middle = pixel_centres((truth.width, truth.height))
    angle = _pixel_angle(truth)
    film, newest = _on_grid(None, trace, (np.arange(pixels), middle, np.ones(pixels)), angle)
    centre = film.rays
    at_centre = np.searchsorted(film.key, _keys(middle))
    floor = _floor(centre, at_centre)
    finished: list[_Squares] = []
    for level in range(1, _DEEPEST + 1):
        if progress is not None:
            progress(level, _DEEPEST + 1, "sub-pixels")
        cut = np.ones(pixels, bool) if level == 1 else _to_cut(_joined([*finished, newest]), newest, floor, tolerance)
        if not cut.any():
            break
        last = cut & newest.edge & ~newest.light & (level >= _LEVELS)
        finished.append(_chosen(newest, ~cut))
        if last.any():
            squares, rays = _at_random(trace, *_quarters(newest, last))
            finished.append(squares)
            film = replace(film, rays=replace(film.rays, random_checks=_both(film.rays, rays)))
        rest = cut & ~last
        if not rest.any():
            newest = _chosen(newest, rest)
            break
        film, newest = _on_grid(film, trace, _quarters(newest, rest), angle)
    if progress is not None:
        progress(_DEEPEST + 1, _DEEPEST + 1, "sub-pixels")
    squares = _joined([*finished, newest])
    value, error, bound = _summed(squares, pixels)
    replicates = sums_of(squares.pixel, squares.replicates, pixels) if truth.area else np.empty((pixels, 0))
    centre = replace(
        centre,
        distance=centre.distance[at_centre],
        light_angle=centre.light_angle[at_centre],
        random_checks=film.rays.random_checks,
    )
    layers = value[:, :3], error[:, :3] + bound, value[:, 3:6]
    return image_of(truth, centre, layers, (value[:, 6:], replicates.reshape(pixels, 6, -1)))


def _traced(truth: TruthScene, positions: Array, **how: Any) -> RayValues:
    """Return what the rays through positions on the film find."""
    direction = film_directions(truth.scene.sensors()[0], positions, (truth.width, truth.height))
    starts = range(0, len(direction), _CHUNK)
    return _joined_rays(
        [ray_values(replace(truth, direction=direction[start : start + _CHUNK]), **how) for start in starts]
    )


def _pixel_angle(truth: TruthScene) -> float:
    """Return what a pixel in the middle of the film spans [rad]."""
    middle = 0.5 * np.array([truth.width, truth.height])
    positions = middle + np.array([[-0.5, 0.0], [0.5, 0.0]])
    left, right = film_directions(truth.scene.sensors()[0], positions, (truth.width, truth.height))
    return float(np.linalg.norm(right - left))


def _both(first: RayValues, second: RayValues) -> RandomChecks:
    return RandomChecks.of_all([first.random_checks, second.random_checks])


def _quarters(squares: _Squares, which: Bools) -> tuple[Index, Array, Array]:
    """Return pixels, middles and sides of the quarters of squares."""
    size = np.repeat(0.5 * squares.size[which], 4)
    middle = (squares.middle[which][:, None] + 0.25 * squares.size[which, None, None] * _CORNERS).reshape(-1, 2)
    return np.repeat(squares.pixel[which], 4), middle, size


def _keys(positions: Array) -> Index:
    """Return one number for each point of the grid, row by row."""
    grid = np.rint(positions * _GRID).astype(np.int64)
    return grid[:, 1] * _ROW + grid[:, 0]


def _floor(rays: RayValues, at_centre: Index) -> Array:
    """Return the least error worth a cut, of airlight, then surface; rays close to a light do not count."""
    dimmest = max(1, int(0.99 * len(at_centre)))
    layers = [np.sort(layer[at_centre].mean(axis=1))[:dimmest] for layer in _values(rays)]
    means = np.array([layer[np.isfinite(layer)].mean() if np.isfinite(layer).any() else 0.0 for layer in layers])
    return np.repeat(_FLOOR * means, 3)


def _on_grid(
    film: _Film | None, trace: Trace, squares: tuple[Index, Array, Array], angle: float
) -> tuple[_Film, _Squares]:
    """Apply the two rules to squares, and add the points that were not looked at yet to the film.

    A point close to a light, where the radiance is without bound, is left out: the mean of the rest stands for its
    square, which may be wrong by all of it. A pixel spans `angle` [rad].
    """
    pixel, middle, size = squares
    count, area = len(pixel), size[:, None] ** 2
    of_square = _keys((middle + 0.5 * size[:, None] * _POINTS[:, None]).reshape(-1, 2))
    new = np.unique(of_square) if film is None else np.setdiff1d(of_square, film.key)
    if len(new):
        rays = trace(np.stack([new % _ROW, new // _ROW], axis=1) / _GRID)
        old = (np.empty(0, np.int64), []) if film is None else (film.key, [film.rays])
        film = _sorted_film(np.append(old[0], new), _joined_rays([*old[1], rays]))
    assert film is not None
    of_point = np.searchsorted(film.key, of_square).reshape(5, count)
    value = np.concatenate(_values(film.rays), axis=1)[of_point]
    replicates = _flat(film.rays)[of_point]
    edge, sides = _differ(film.rays, of_point), film.rays.light_angle[of_point] / (angle * size)
    sound = (sides >= _CLOSE)[..., None]
    with np.errstate(invalid="ignore"):  # a ray through a light has an infinite value
        mean = (8 * value[0] + value[1:].sum(axis=0)) / 12
        error = np.where(edge[:, None], np.ptp(value, axis=0) / np.sqrt(12), np.abs(mean - value[0]))
    rest = np.where(sound, value, 0).sum(axis=0) / np.maximum(sound.sum(axis=0), 1)
    whole = sound.all(axis=0)
    mean, error = np.where(whole, mean, rest), np.where(whole, error, rest)
    bound = np.where(sound, film.rays.bound[of_point], 0).max(axis=0)
    light = sides.min(axis=0) < _AROUND
    replicates = np.where(whole, (8 * replicates[0] + replicates[1:].sum(axis=0)) / 12, replicates.mean(axis=0))
    return film, _Squares(pixel, middle, size, mean * area, error * area, replicates * area, bound * area, edge, light)


def _values(rays: RayValues) -> list[Array]:
    """Return the layers of rays whose means are taken, (rays, 3) each."""
    return [rays.airlight, rays.surface, *([rays.emitted] if rays.emitted.size else [])]


def _flat(rays: RayValues) -> Array:
    """Return the replicates of rays, (rays, 6 replicates), or without columns."""
    count = len(rays.airlight)
    return rays.replicates.reshape(count, -1) if rays.replicates.size else np.empty((count, 0))


def _sorted_film(key: Index, rays: RayValues) -> _Film:
    order = np.argsort(key)
    layers = {name: getattr(rays, name) for name in _LAYERS}
    return _Film(key[order], replace(rays, **{name: layer[order] for name, layer in layers.items() if layer.size}))


def _at_random(trace: Trace, pixel: Index, middle: Array, size: Array) -> tuple[_Squares, RayValues]:
    """Take a random point in each quarter of squares."""
    count, area = len(pixel), size[:, None] ** 2
    points = 0.5 * (_CORNERS[:, None] + np.random.default_rng(count).uniform(-1, 1, (4, count, 2)))
    rays = trace((middle + 0.5 * size[:, None] * points).reshape(-1, 2))
    value = np.concatenate(_values(rays), axis=1).reshape(4, count, -1)
    replicates = _flat(rays).reshape(4, count, -1).mean(axis=0)
    error, bound = np.ptp(value, axis=0) / 4, rays.bound.reshape(4, count, 3).mean(axis=0)
    edge, light = np.ones(count, bool), np.zeros(count, bool)
    mean = value.mean(axis=0)
    return _Squares(pixel, middle, size, mean * area, error * area, replicates * area, bound * area, edge, light), rays


def _differ(rays: RayValues, of_point: Index) -> Bools:
    """Return for which squares the rays through their points, (points, squares), are not alike."""
    intervals, distance = rays.intervals[of_point], rays.distance[of_point]
    seen, lit = np.isfinite(distance), (rays.surface.max(axis=1) > 0)[of_point]
    nearest, furthest = distance.min(axis=0), np.where(seen, distance, 0).max(axis=0)
    differ = (intervals != intervals[0]).any(axis=0)
    if rays.emitted.size:
        emits = (rays.emitted.max(axis=1) > 0)[of_point]
        differ |= emits.any(axis=0) & ~emits.all(axis=0)
    differ |= seen.any(axis=0) & ((furthest > (1 + _DEPTH) * nearest) | ~seen.all(axis=0))
    return np.asarray(differ | (lit.any(axis=0) & ~lit.all(axis=0)), dtype=np.bool_)


def _to_cut(all_squares: _Squares, newest: _Squares, floor: Array, tolerance: float) -> Bools:
    """Return which of the squares found last carry more than their share of an error that is too large."""
    pixels = int(all_squares.pixel.max()) + 1
    value, error, _ = _summed(all_squares, pixels)
    allowed = tolerance * np.maximum(np.abs(value), floor)
    count = np.bincount(all_squares.pixel, minlength=pixels)[newest.pixel, None]
    share = np.where(newest.edge[:, None], 1 / (_SIGMAS * np.sqrt(count)), 1 / count)
    above = (error > allowed)[newest.pixel] & (newest.error > share * allowed[newest.pixel])
    return np.asarray(above.any(axis=1) & (newest.light | (newest.size > 0.5**_LEVELS)), dtype=np.bool_)


def _summed(squares: _Squares, pixels: int) -> tuple[Array, Array, Array]:
    """Add up the squares of each pixel: values, errors, bounds."""
    pixel, edge = squares.pixel, squares.edge[:, None]
    smooth = sums_of(pixel, np.where(edge, 0, squares.error), pixels)
    open_edges = sums_of(pixel, np.where(edge, squares.error, 0) ** 2, pixels)
    error = smooth + _SIGMAS * np.sqrt(open_edges)
    return sums_of(pixel, squares.value, pixels), error, sums_of(pixel, squares.bound, pixels)


def _chosen(squares: _Squares, which: Bools) -> _Squares:
    return _Squares(*(getattr(squares, field.name)[which] for field in fields(_Squares)))


def _joined(parts: Sequence[_Squares]) -> _Squares:
    return _Squares(*(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(_Squares)))


def _joined_rays(parts: Sequence[RayValues]) -> RayValues:
    arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in _LAYERS}
    random_checks = RandomChecks.of_all([part.random_checks for part in parts])
    return RayValues(**arrays, transitions=sum(part.transitions for part in parts), random_checks=random_checks)
