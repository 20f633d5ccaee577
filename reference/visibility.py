# SPDX-License-Identifier: BSD-3-Clause
"""Lit intervals of camera rays by ray-traced visibility.

Along a ray the angle theta at the light is the natural variable: the airlight integrand is bounded in it, an endless
ray ends at pi/2, and the direction from the light to the point is simply ``sin(theta) direction + cos(theta) n`` (n the
unit vector from the light to the foot point), at the distance height / cos(theta). Nothing cancels, however close the
ray passes to the light.

Every ray is sampled at `samples` angles, regularly between its ends, and at `checks` random ones. Wherever two
neighbours disagree a transition lies between them, and is bisected to rounding. A shadow thinner than the sampling can
be missed: the share of random samples that the regular ones predict wrongly says how much (`missed`).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference.scene import TruthLight, TruthScene

Array = NDArray[np.float64]
Visible = Callable[[NDArray[np.int64], Array], NDArray[np.bool_]]

_BISECTIONS = 26  # theta range / 256 / 2^26 < 1e-10 rad: below the float32 rounding of the rays that are cast
_CHUNK = 1 << 22  # rays cast at once


@dataclass(frozen=True)
class LitIntervals:
    """The lit parts of rays: one entry per interval."""

    ray: NDArray[np.int64]  #: number of the ray
    low: Array  #: angle at the light where the interval begins [rad]
    high: Array  #: where it ends [rad]
    transitions: int  #: edges between light and shadow that were bisected
    missed: float  #: share of random samples that the regular ones predicted wrongly


def lit_intervals(
    truth: TruthScene,
    light: TruthLight,
    rays: tuple[Array, Array, Array],
    *,
    ends: tuple[Array, Array],
    samples: int = 256,
) -> LitIntervals:
    """Find the lit intervals of rays between two angles.

    Parameters
    ----------
    truth
        The scene.
    light
        The light.
    rays
        Unit directions (n, 3), unit normals from the light to the foot points (n, 3), heights (n,) [m].
    ends
        Angles at the light between which a ray is looked at [rad], each (n,); empty where the first is not below the
        second.
    samples
        Regular samples of each ray; an eighth as many random ones check them.

    Notes
    -----
    Valid where shadows along a ray are wider than (high - low)/samples in theta; `missed` measures what is not.
    """
    low, high = ends
    used = np.flatnonzero(high > low)
    if not truth.scene.shapes() or not len(used):
        return LitIntervals(used, low[used], high[used], 0, 0.0)
    visible = visibility_test(truth.scene, light.position, rays)
    per_chunk = max(1, _CHUNK // samples)
    parts = [
        _chunk(visible, ends, used[start : start + per_chunk], samples) for start in range(0, len(used), per_chunk)
    ]
    return LitIntervals(
        np.concatenate([part.ray for part in parts]),
        np.concatenate([part.low for part in parts]),
        np.concatenate([part.high for part in parts]),
        sum(part.transitions for part in parts),
        float(np.mean([part.missed for part in parts])),
    )


def visibility_test(scene, position: Array, rays: tuple[Array, Array, Array]) -> Visible:
    """Return a function (ray numbers, angles) -> whether the light at `position` reaches those points.

    The shadow rays start at the light, where nothing is close, and stop twenty float32 roundings before the point: a
    point on a surface must not be blocked by that surface.
    """
    import drjit as dr
    import mitsuba as mi

    direction, normal, height = mi.Vector3d(rays[0].T), mi.Vector3d(rays[1].T), mi.Float64(rays[2])
    start = mi.Point3f(*(float(c) for c in position))
    dr.make_opaque(direction, normal, height, start)

    def visible(ray: NDArray[np.int64], theta: Array) -> NDArray[np.bool_]:
        index = mi.UInt32(ray.astype(np.uint32))
        sine, cosine = dr.sincos(mi.Float64(theta))
        to_point = dr.gather(mi.Vector3d, direction, index) * sine + dr.gather(mi.Vector3d, normal, index) * cosine
        length = dr.gather(mi.Float64, height, index) / dr.maximum(cosine, 1e-300) * (1 - 2e-6)
        shadow_ray = mi.Ray3f(start, dr.normalize(mi.Vector3f(to_point)), mi.Float(length), 0.0, [])
        return ~np.array(scene.ray_test(shadow_ray), dtype=bool)

    return visible


def _chunk(visible: Visible, ends: tuple[Array, Array], used: NDArray[np.int64], samples: int) -> LitIntervals:
    low, high = ends[0][used], ends[1][used]
    # Regular samples at the middles of equal cells, and one close to each end: a shadow that touches the surface.
    fractions = np.concatenate([[1e-4], (np.arange(samples) + 0.5) / samples, [1 - 1e-4]])
    checks = max(1, samples // 8)
    random = (np.arange(checks) + np.random.default_rng(int(used[0])).random((len(used), checks))) / checks
    theta = np.concatenate([np.broadcast_to(fractions, (len(used), len(fractions))), random], axis=1)
    theta = low[:, None] + (high - low)[:, None] * theta
    lit = visible(np.repeat(used, theta.shape[1]), theta.ravel()).reshape(theta.shape)
    missed = _mispredicted(lit[:, : len(fractions)], lit[:, len(fractions) :], random)

    order = np.argsort(theta, axis=1)
    theta, lit = np.take_along_axis(theta, order, axis=1), np.take_along_axis(lit, order, axis=1)
    row, cell = np.nonzero(lit[:, 1:] != lit[:, :-1])
    edge = _bisect(visible, used[row], (theta[row, cell], theta[row, cell + 1]), lit[row, cell])
    # Beginnings and ends of the intervals: the transitions, and the ends of the ray where it is lit there. Sorted by
    # ray, then by angle, the two lists match one to one.
    rising = ~lit[row, cell]
    first, last = np.flatnonzero(lit[:, 0]), np.flatnonzero(lit[:, -1])
    begin_row, begin = np.concatenate([row[rising], first]), np.concatenate([edge[rising], low[first]])
    end_row, end = np.concatenate([row[~rising], last]), np.concatenate([edge[~rising], high[last]])
    by_begin, by_end = np.lexsort((begin, begin_row)), np.lexsort((end, end_row))
    return LitIntervals(used[begin_row[by_begin]], begin[by_begin], end[by_end], len(row), missed)


def _mispredicted(regular: NDArray[np.bool_], checks: NDArray[np.bool_], random: Array) -> float:
    """Return the share of the random samples that differ from both regular neighbours."""
    cells = regular.shape[1] - 2
    cell = np.clip((random * cells + 0.5).astype(np.int64), 0, cells)  # the neighbours are columns cell and cell + 1
    before, after = np.take_along_axis(regular, cell, axis=1), np.take_along_axis(regular, cell + 1, axis=1)
    return float(np.mean((checks != before) & (checks != after)))


def _bisect(
    visible: Visible, ray: NDArray[np.int64], bracket: tuple[Array, Array], lit_low: NDArray[np.bool_]
) -> Array:
    low, high = bracket[0].copy(), bracket[1].copy()
    for _ in range(_BISECTIONS if len(ray) else 0):
        middle = 0.5 * (low + high)
        same = visible(ray, middle) == lit_low
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return 0.5 * (low + high)
