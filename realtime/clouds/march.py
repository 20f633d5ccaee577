# SPDX-License-Identifier: BSD-3-Clause
r"""Steps of rays through clouds, and optical depths.

A step of the length dx has the density in its middle, rho, and the depth kappa rho dx: the midpoint rule, whose error
falls with dx^2. In a grid steps start as long as a voxel, and grow with the depth tau to the eye like exp(tau/s), s =
`SPREAD`: what lies behind tau shows with exp(-tau), so all steps have about the same fraction in what is wrong of it. A
homogeneous cloud is one of density 1, without voxels: its stretches are the steps.
"""

from collections.abc import Callable
from functools import reduce
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.clouds.bounds import CloudSurfaces, Crossing, next_crossing
from realtime.numerics.array_types import Metres
from realtime.scene.lights import Light
from realtime.scene.media.bounded import Clouds

SPREAD = 2.0  #: s
#: A depth behind which nothing shows: exp(-20) = 2e-9.
OPAQUE = 20.0
_SHORTEST = 1e-6  # of a step, of the distance: rounding leaves as much


def march(
    surfaces: CloudSurfaces,
    origin,
    direction,
    end,
    total,
    *,
    step: Callable,
    add: Callable,
    active: Any = True,
    first: Crossing | None = None,
) -> Any:
    """Add up what steps of rays within clouds have, from the nearest to the farthest.

    `surfaces`: the boundaries of clouds; `origin`, `direction`, `end`: rays [m], their unit directions, and where they
    end, may be infinite [m]; `total`: the sum of no step, a tuple of arrays of the rays' width; `step`: (total,
    distance [m], cloud) -> how long a step may be [m]; `add`: (total, begin, end, cloud) -> total, and whether to go
    on, for steps [m] in the cloud of a number: the first in a stretch has no length, and says where it begins;
    `active`: lanes to compute; `first`: the first crossing, if it is known. The loop changes no other lanes than those
    that go on.
    """
    Float, lanes = type(direction.x), max(dr.width(direction), dr.width(origin))

    def stretch(x, crossing=None):
        """Return where the next stretch in a cloud begins and ends; both are one place where rounding hides it."""
        near = next_crossing(surfaces, origin, direction, x) if crossing is None else crossing
        far = next_crossing(surfaces, origin, direction, near.distance, ~near.leaves & (near.distance < end))
        begin = dr.select(near.leaves, x, dr.select(far.leaves, near.distance, far.distance))
        edge = dr.select(near.leaves, near.distance, far.distance)
        return begin, dr.minimum(edge, end), dr.select(near.leaves, near.cloud, far.cloud)

    def body(x, edge, cloud, opens, total, going):
        longest = dr.maximum(step(total, x, cloud), _SHORTEST * x)
        target = dr.select(opens, x, dr.minimum(x + longest, edge))
        total, goes_on = add(total, x, target, cloud)
        opens = goes_on & ~opens & (target >= edge) & (edge < end)
        x, edge, cloud = dr.if_stmt(
            args=(target, edge, cloud), cond=opens, true_fn=lambda x, *_: stretch(x), false_fn=lambda *same: same
        )
        return x, edge, cloud, opens, total, going & goes_on & (x < end)

    begin, edge, cloud = stretch(dr.zeros(Float, lanes), first)
    going = dr.full(mi.Bool, True, lanes) & active & (begin < end)
    state = (begin, edge, cloud, dr.full(mi.Bool, True, lanes), total, going)
    *_, total, _ = dr.while_loop(state=state, cond=lambda *state: state[-1], body=body)
    return total


def middle_density(clouds: Clouds, origin, direction, begin, end, cloud) -> Any:
    """Return rho in the middle of steps [1]."""
    if clouds.density is None:
        return 1
    return clouds.density.at(origin + direction * (0.5 * (begin + end)), cloud)


def voxel(clouds: Clouds, cloud) -> Metres:
    """Return the width of a voxel of the clouds of some numbers, infinite where they have none [m]."""
    if clouds.density is None:
        return type(clouds.sigma_t[0])(dr.inf)
    return dr.gather(type(clouds.density.voxel), clouds.density.voxel, cloud)


def depths_along(
    surfaces: CloudSurfaces,
    clouds: Clouds,
    origin,
    direction,
    end,
    *,
    stride: Any,
    seen: bool,
    active: Any = True,
    first: Crossing | None = None,
) -> tuple[Any, ...]:
    """Return the optical depth of rays up to a distance in all clouds, by channel [1].

    `surfaces`, `clouds`: the boundaries, and what fills them; `origin`, `direction`, `end`, `active`, `first`: as of
    `march`; lanes that are not active have a depth of 0; `stride`: how long the first steps are in grids [voxels];
    `seen`: whether the depths are those of what the eye sees: there steps grow, and end behind `OPAQUE`.
    """
    Float, lanes = type(direction.x), max(dr.width(direction), dr.width(origin))
    seen &= clouds.density is not None

    def step(depths, x, cloud):
        length = stride * voxel(clouds, cloud) if clouds.density is not None else dr.inf
        return length * dr.exp(dr.minimum(least(depths), OPAQUE) / SPREAD) if seen else length

    def add(depths, begin, finish, cloud):
        length = (finish - begin) * middle_density(clouds, origin, direction, begin, finish, cloud)
        depths = tuple(
            dr.fma(dr.gather(Float, own, cloud), length, depth) for own, depth in zip(clouds.sigma_t, depths)
        )
        return depths, least(depths) < OPAQUE if seen else mi.Bool(True)

    nothing = tuple(dr.zeros(Float, lanes) for _ in clouds.sigma_t)
    return march(surfaces, origin, direction, end, nothing, step=step, add=add, active=active, first=first)


def segment_through(
    surfaces: CloudSurfaces, clouds: Clouds, light: Light, *, stride: Any
) -> Callable[[Any, Any], tuple[Any, ...]]:
    """Return the function from points [m] and active lanes to the depths of the segments from a light."""

    def segment(point, active):
        end = type(point.x)(dr.inf)
        return depths_along(surfaces, clouds, point, -light.axis, end, stride=stride, seen=False, active=active)

    return segment


def segment_by_lengths(clouds: Clouds, lengths: Any) -> Callable[[Any, Any], tuple[Any, ...]]:
    """Return the function from points [m] and active lanes to the depths of segments by channel.

    `lengths`: by cloud a function (point, active) -> how much of it lies on the segment, at its full density [m].
    """

    def segment(point, active):
        Float = type(point.x)
        depths = [Float(0) for _ in clouds.sigma_t]
        for cloud, length_to in enumerate(lengths):
            length = length_to(point, active)
            kappas = (dr.gather(Float, sigma_t, mi.UInt32(cloud)) for sigma_t in clouds.sigma_t)
            depths = [dr.fma(kappa, length, depth) for kappa, depth in zip(kappas, depths)]
        return tuple(depths)

    return segment


def least(depths: tuple[Any, ...]) -> Any:
    """Return the smallest of depths by channel [1]."""
    return reduce(dr.minimum, depths)
