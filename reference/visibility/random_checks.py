# SPDX-License-Identifier: BSD-3-Clause
"""Checking lit intervals by fresh random shadow rays, and mending what they contradict.

Intervals that come from cast rays are mended: a sample that contradicts them lies in a sliver that the sampling stepped
over. It becomes a new bracket, whose two sides are bisected; this is repeated with new random samples until a round
finds nothing, or `_ROUNDS` have passed.

Intervals that come from exact geometry need no mending, but evidence that they are right: they share no code with the
shadow rays. Within float32 rounding of an edge the rays decide nothing. Elsewhere a third route judges a contradiction:
a float64 test of that one shadow ray against every triangle (Moeller and Trumbore 1997, Fast, minimum storage
ray-triangle intersection, J. Graphics Tools 2(1)) and every sphere, and for other shapes a ray that is cast at them
alone.
"""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reference.scene.shapes import Shapes
from reference.visibility.intervals import LitIntervals, RandomChecks, joined_doubt

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Index = NDArray[np.int64]
Visible = Callable[[Index, Array], Bools]
Bisect = Callable[[Visible, Index, tuple[Array, Array], Bools], Array]
Leg = Callable[[np.int64, np.float64], tuple[Array, Array]]

_ROUNDS = 4
ROUNDING = 1e-5  # of the angle: float32 shadow rays end 2e-6 early, and start and direction are rounded to 1e-7
JUDGED = 256  #: contradictions that are tested against every shape; more than a few mean that something is wrong
_CHUNK = 1 << 22  # rays cast at once


@dataclass(frozen=True)
class Toggles:
    """Lit and dark parts of rays: the state in which each begins, and where it changes."""

    ray: Index  #: numbers of the rays looked at, ascending
    lit: Bools  #: whether the beginning of each is lit
    edge_ray: Index  #: numbers of the rays of the edges, ascending
    edge: Array  #: their angles, ascending along each ray [rad]

    @staticmethod
    def joined(parts: Sequence["Toggles"]) -> "Toggles":
        """Put chunks of rays together."""
        names = ("ray", "lit", "edge_ray", "edge")
        return Toggles(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


@dataclass(frozen=True)
class Rounding:
    """How the edges of cast intervals are found: the shadow rays, and their bisection."""

    visible: Visible  #: casts the shadow rays
    bisect: Bisect  #: narrows a bracket to rounding


def checked_cast(toggles: Toggles, found_by: Rounding, *, ends: tuple[Array, Array], checks: int) -> LitIntervals:
    """Check intervals from cast rays, and mend them until a round of random samples contradicts none.

    Parameters
    ----------
    toggles
        The intervals.
    found_by
        The shadow rays that found them.
    ends
        Angles at the light between which the rays are looked at, (rays,) each [rad].
    checks
        Random samples of each ray and round.
    """
    ray, theta, lit = np.empty(0, np.int64), np.empty(0), np.empty(0, bool)
    checked = disagreements = 0
    missed = 0.0
    for number in range(_ROUNDS):
        fresh_ray, fresh = _random_samples(toggles.ray, ends, checks, number)
        fresh_lit = _cast(found_by.visible, fresh_ray, fresh)
        contradicted = fresh_lit != _predicted(toggles, fresh_ray, fresh)[0]
        checked += len(fresh)
        disagreements += int(contradicted.sum())
        missed = float(contradicted.mean()) if number == 0 else missed
        ray, theta = np.append(ray, fresh_ray[contradicted]), np.append(theta, fresh[contradicted])
        lit = np.append(lit, fresh_lit[contradicted])
        # What an earlier round contradicted is looked at again: several samples may lie in one interval.
        wrong = lit != _predicted(toggles, ray, theta)[0]
        if not wrong.any() and not contradicted.any():
            break
        toggles = _mended(toggles, ray[wrong], theta[wrong], found_by, ends)
        wrong = lit != _predicted(toggles, ray, theta)[0]
    left = int(wrong.sum())
    random_checks = RandomChecks(checked, disagreements, disagreements - left, left, missed)
    intervals = replace(_intervals(toggles, ends), random_checks=random_checks)
    return _with_doubt(intervals, ray[wrong], theta[wrong], ends, checks)


def checked_geometry(
    exact: LitIntervals,
    visible: Visible,
    geometry: tuple[Leg, Shapes],
    *,
    ends: tuple[Array, Array],
    checks: int,
    others: Visible | None = None,
    rounding: Array | float = ROUNDING,
) -> LitIntervals:
    """Check intervals from exact geometry.

    Parameters
    ----------
    exact
        The intervals, with the checks of that part of them that was cast.
    visible
        Shadow rays, (ray numbers, angles) -> whether the light reaches those points.
    geometry
        (ray number, angle) -> where the leg from the light begins and the way from there to the point, in float64; and
        the shapes.
    ends
        Angles at the light between which the rays are looked at [rad].
    checks
        Random samples of each ray.
    others
        Shadow rays among the shapes that are neither triangles nor spheres, if there are any.
    rounding
        How close to an edge the shadow rays cannot be asked [rad], one number or one for each ray.
    """
    toggles = _as_toggles(exact, ends)
    ray, theta = _random_samples(toggles.ray, ends, checks, 0)
    predicted, gap = _predicted(toggles, ray, theta)
    gap = np.minimum(gap, np.minimum(theta - ends[0][ray], ends[1][ray] - theta))
    wrong = np.flatnonzero(
        (_cast(visible, ray, theta) != predicted) & (gap > np.broadcast_to(rounding, len(ends[0]))[ray])
    )
    judged = wrong[:JUDGED]
    lit = np.array([lit_by_all_shapes(geometry, ray[k], theta[k]) for k in judged], dtype=bool)
    if others is not None:
        lit &= _cast(others, ray[judged], theta[judged])
    unsettled = np.append(judged[lit != predicted[judged]], wrong[JUDGED:])
    random_checks = RandomChecks(
        len(ray), len(wrong), len(wrong) - len(unsettled), len(unsettled), len(wrong) / max(len(ray), 1)
    )
    random_checks = RandomChecks.of_all([exact.random_checks, random_checks])
    return _with_doubt(replace(exact, random_checks=random_checks), ray[unsettled], theta[unsettled], ends, checks)


def _random_samples(ray: Index, ends: tuple[Array, Array], checks: int, number: int) -> tuple[Index, Array]:
    """Return one random angle in each of `checks` equal parts of every ray."""
    generator = fresh_generator(*ends, number=number)
    share = (np.arange(checks) + generator.random((len(ray), checks))) / checks
    low, high = ends[0][ray, None], ends[1][ray, None]
    return np.repeat(ray, checks), (low + (high - low) * share).ravel()


def fresh_generator(*drawn_for: Array, number: int = 0) -> np.random.Generator:
    """Return a generator whose seed is the digest of what numbers are drawn for, and a number.

    Rays, lights and scenes are then checked at places of their own, and at the same ones in every run.
    """
    digest = hashlib.blake2b(digest_size=16)
    for array in drawn_for:
        digest.update(np.ascontiguousarray(array).tobytes())
    return np.random.default_rng((int.from_bytes(digest.digest()), number))


def _cast(visible: Visible, ray: Index, theta: Array) -> Bools:
    parts = [visible(ray[s : s + _CHUNK], theta[s : s + _CHUNK]) for s in range(0, len(ray), _CHUNK)]
    return np.concatenate(parts) if parts else np.empty(0, bool)


def _predicted(toggles: Toggles, ray: Index, theta: Array) -> tuple[Bools, Array]:
    """Return whether intervals call samples lit, and how far these are from the nearest edge [rad]."""
    before = _edges_before(toggles, ray, theta)
    first = np.searchsorted(toggles.edge_ray, ray)
    lit = toggles.lit[np.searchsorted(toggles.ray, ray)] ^ ((before - first) % 2 == 1)
    left, right = _neighbours(toggles, ray, before, (np.full(len(ray), -np.inf), np.full(len(ray), np.inf)))
    return lit, np.minimum(theta - left, right - theta)


def _edges_before(toggles: Toggles, ray: Index, theta: Array) -> Index:
    """Return how many edges come before each sample, those of rays with lower numbers included.

    Angles lie in [-pi/2, pi/2]: four times the number of the ray plus the angle orders all, to a rounding of 1e-11 at a
    million rays.
    """
    return np.searchsorted(4.0 * toggles.edge_ray + toggles.edge, 4.0 * ray + theta)


def _neighbours(toggles: Toggles, ray: Index, before: Index, outside: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return the edges on either side of samples, or what is given where the ray has none there."""
    edge_ray, edge = np.append(toggles.edge_ray, -1), np.append(toggles.edge, 0.0)
    has_left, has_right = (before > 0) & (edge_ray[before - 1] == ray), edge_ray[before] == ray
    return np.where(has_left, edge[before - 1], outside[0]), np.where(has_right, edge[before], outside[1])


def _mended(toggles: Toggles, ray: Index, theta: Array, found_by: Rounding, ends: tuple[Array, Array]) -> Toggles:
    """Turn one contradicting sample of each interval into two edges."""
    before = _edges_before(toggles, ray, theta)
    _, distinct = np.unique(np.stack([ray, before]), axis=1, return_index=True)
    ray, theta, before = ray[distinct], theta[distinct], before[distinct]
    lit, _ = _predicted(toggles, ray, theta)
    left, right = _neighbours(toggles, ray, before, (ends[0][ray], ends[1][ray]))
    opening = found_by.bisect(found_by.visible, ray, (left, theta), lit)
    closing = found_by.bisect(found_by.visible, ray, (theta, right), ~lit)
    edge_ray, edge = np.concatenate([toggles.edge_ray, ray, ray]), np.concatenate([toggles.edge, opening, closing])
    order = np.lexsort((edge, edge_ray))
    return replace(toggles, edge_ray=edge_ray[order], edge=edge[order])


def _intervals(toggles: Toggles, ends: tuple[Array, Array]) -> LitIntervals:
    """Return the lit intervals: beginnings and ends, sorted by ray and angle, match one to one."""
    place = np.arange(len(toggles.edge)) - np.searchsorted(toggles.edge_ray, toggles.edge_ray)
    rising = toggles.lit[np.searchsorted(toggles.ray, toggles.edge_ray)] ^ (place % 2 == 0)
    count = np.searchsorted(toggles.edge_ray, toggles.ray, "right") - np.searchsorted(toggles.edge_ray, toggles.ray)
    ends_lit = toggles.ray[toggles.lit ^ (count % 2 == 1)]
    starts_lit = toggles.ray[toggles.lit]
    begin_ray = np.append(starts_lit, toggles.edge_ray[rising])
    begin = np.append(ends[0][starts_lit], toggles.edge[rising])
    end_ray = np.append(toggles.edge_ray[~rising], ends_lit)
    end = np.append(toggles.edge[~rising], ends[1][ends_lit])
    by_begin, by_end = np.lexsort((begin, begin_ray)), np.lexsort((end, end_ray))
    return LitIntervals(begin_ray[by_begin], begin[by_begin], end[by_end], len(toggles.edge))


def _as_toggles(intervals: LitIntervals, ends: tuple[Array, Array]) -> Toggles:
    used = np.flatnonzero(ends[1] > ends[0])
    at_start, at_end = intervals.low <= ends[0][intervals.ray], intervals.high >= ends[1][intervals.ray]
    edge_ray = np.append(intervals.ray[~at_start], intervals.ray[~at_end])
    edge = np.append(intervals.low[~at_start], intervals.high[~at_end])
    order = np.lexsort((edge, edge_ray))
    return Toggles(used, np.isin(used, intervals.ray[at_start]), edge_ray[order], edge[order])


def _with_doubt(
    intervals: LitIntervals, ray: Index, theta: Array, ends: tuple[Array, Array], checks: int
) -> LitIntervals:
    """Attach the contradictions that are left, after earlier ones: each stands for one of the parts of its ray."""
    if not len(ray):
        return intervals
    new = ray, theta, (ends[1][ray] - ends[0][ray]) / checks
    return replace(intervals, doubt=joined_doubt(intervals.doubt, new))


def lit_by_all_shapes(geometry: tuple[Leg, Shapes], ray: np.int64, theta: np.float64) -> bool:
    """Test one shadow ray against every triangle and every sphere in float64.

    Parameters
    ----------
    geometry
        As in `checked_geometry`.
    ray, theta
        Number of the ray, and the angle at the light [rad].
    """
    leg, shapes = geometry
    triangles = shapes.triangles
    position, way = leg(ray, theta)
    edge1, edge2 = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    p = np.cross(way, edge2)
    determinant = np.einsum("ij,ij->i", edge1, p)
    from_corner = position - triangles[:, 0]
    q = np.cross(from_corner, edge1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("ij,ij->i", from_corner, p) / determinant
        v = q @ way / determinant
        t = np.einsum("ij,ij->i", edge2, q) / determinant
    hidden = bool(np.any((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < 1)))
    return not (hidden or _meets_spheres(position, way, (shapes.centre, shapes.radius)))


def _meets_spheres(position: Array, way: Array, spheres: tuple[Array, Array]) -> bool:
    """Return whether the surface of a sphere lies between a point and the point `way` further on.

    The ways to the surface are the roots of |position + t way - centre|^2 = R^2.
    """
    from_centre = position - spheres[0]
    square, half = way @ way, from_centre @ way
    discriminant = half**2 - square * (np.sum(from_centre**2, axis=1) - spheres[1] ** 2)
    root = np.sqrt(np.maximum(discriminant, 0))
    ways = (np.stack([-root, root]) - half) / square
    return bool(np.any((discriminant > 0) & (ways > 0) & (ways < 1)))
