# SPDX-License-Identifier: BSD-3-Clause
"""The stretches of rays in clouds, found once and kept: what is marched, summed and entered first.

Few rays lie in clouds more than a few times. So the first stretches of a ray are kept in as many pairs of numbers, and
who needs more of a ray looks for them once more from the first that has no place. Whoever walks along stretches casts
no ray at each of its steps.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from realtime.clouds.bounds.crossings import Crossing, next_crossing
from realtime.clouds.bounds.surfaces import CloudSurfaces
from realtime.numerics.array_types import Metres, PerRay, chosen_value
from realtime.scene.media.bounded import Clouds

KEPT = 4  #: stretches of a ray; of 480 000 camera rays of `stratocumulus` 0.1 % have more


@dataclass(frozen=True)
class Stretches:
    """The next stretches of rays in clouds, one behind the other."""

    begins: tuple[Metres, ...]
    ends: tuple[Metres, ...]
    clouds: tuple[PerRay, ...]  #: numbers; empty where there is one cloud, of the number 0
    count: PerRay  #: how many are kept
    beyond: Metres  #: where the first begins that is not; infinite where all are [m]

    @property
    def fields(self) -> tuple:
        """The fields, of which `Stretches` can be made again: a recorded loop takes no frozen record."""
        return self.begins, self.ends, self.clouds, self.count, self.beyond

    def chosen(self, number: PerRay) -> tuple[Metres, Metres, PerRay]:
        """Return begin, end and cloud of a stretch by lane."""
        begin, end, cloud = (
            chosen_value(values, number) for values in (self.begins, self.ends, self.clouds or (mi.UInt32(0),))
        )
        return begin, end, cloud


def first_stretches(
    surfaces: CloudSurfaces, clouds: Clouds, origin, direction, end
) -> tuple[Crossing, Stretches, tuple[PerRay, ...]]:
    """Follow rays to their ends.

    `surfaces`, `clouds`: the boundaries, and what fills them; `origin`, `direction`, `end`: as for
    `realtime.clouds.bounds.crossings.sum_over_stretches`. Returns `first`: the first crossing; the first ones;
    `depths`: optical, of all stretches, by channel [1].
    """
    Float = type(direction.x)
    lanes = max(dr.width(direction), dr.width(origin))
    first = next_crossing(surfaces, origin, direction, dr.zeros(Float, lanes), Float(0) < end)
    nothing = tuple(dr.zeros(Float, lanes) for _ in clouds.sigma_t)
    stretches, depths = _none(surfaces, Float, lanes), nothing
    inside = first.leaves
    stop = dr.select(inside, dr.minimum(first.distance, end), 0)
    stretches = _with(stretches, dr.zeros(Float, lanes), stop, first.cloud, inside)
    depths = _deeper(clouds, depths, stop, first.cloud, inside)

    def step(x, fields, depths, going):
        crossing = next_crossing(surfaces, origin, direction, x, going)
        inside = going & crossing.leaves
        stop = dr.select(inside, dr.minimum(crossing.distance, end), x)
        stretches = _with(Stretches(*fields), x, stop, crossing.cloud, inside)
        depths = _deeper(clouds, depths, stop - x, crossing.cloud, inside)
        return crossing.distance, stretches.fields, depths, going & (crossing.distance < end)

    _, fields, depths, _ = dr.while_loop(
        state=(+first.distance, stretches.fields, depths, first.distance < end),
        cond=lambda *state: state[-1],
        body=step,
    )
    return first, Stretches(*fields), depths


def next_stretches(surfaces: CloudSurfaces, origin, direction, end, last: Stretches) -> Stretches:
    """Return the stretches behind the `last` ones that were kept; none where all were.

    Parameters are those of `first_stretches`.
    """
    Float = type(direction.x)

    def step(x, fields, going):
        crossing = next_crossing(surfaces, origin, direction, x, going)
        stop, inside = dr.minimum(crossing.distance, end), going & crossing.leaves
        stretches = _with(Stretches(*fields), x, stop, crossing.cloud, inside)
        more = (crossing.distance < end) & ~dr.isfinite(stretches.beyond)
        return crossing.distance, stretches.fields, going & more

    none = _none(surfaces, Float, dr.width(last.beyond))
    _, fields, _ = dr.while_loop(
        state=(+last.beyond, none.fields, dr.isfinite(last.beyond)), cond=lambda *state: state[-1], body=step
    )
    return Stretches(*fields)


def _none(surfaces: CloudSurfaces, Float, lanes: int) -> Stretches:
    begins, ends, numbers = (tuple(dr.zeros(kind, lanes) for _ in range(KEPT)) for kind in (Float, Float, mi.UInt32))
    return Stretches(
        begins,
        ends,
        numbers if surfaces.several else (),
        dr.zeros(mi.UInt32, lanes),
        dr.full(Float, dr.inf, lanes),
    )


def _with(stretches: Stretches, begin, end, cloud, inside) -> Stretches:
    """Return stretches with one more in the lanes that are `inside`."""
    here = [inside & (stretches.count == place) for place in range(KEPT)]

    def put(values, new):
        return tuple(dr.select(at, new, value) for at, value in zip(here, values, strict=True))

    left_over = inside & (stretches.count >= KEPT) & ~dr.isfinite(stretches.beyond)
    return Stretches(
        put(stretches.begins, begin),
        put(stretches.ends, end),
        put(stretches.clouds, cloud) if stretches.clouds else (),
        dr.select(inside & (stretches.count < KEPT), stretches.count + 1, stretches.count),
        dr.select(left_over, begin, stretches.beyond),
    )


def _deeper(clouds: Clouds, depths, length, cloud, inside) -> tuple[PerRay, ...]:
    """Return optical depths with those of one more stretch."""
    return tuple(
        dr.fma(dr.gather(type(depth), sigma_t, cloud, inside), length, depth)
        for sigma_t, depth in zip(clouds.sigma_t, depths, strict=True)
    )
