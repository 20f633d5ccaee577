# SPDX-License-Identifier: BSD-3-Clause
r"""Small steps of rays through clouds with densities, and optical depths.

A step of the length dx has the density in its middle, rho, and the depth kappa rho dx: the midpoint rule, whose error
falls with dx^2. Steps start as long as a voxel, and grow with the depth tau to the eye like exp(tau/s), s =
`realtime.clouds.single_scattering.SPREAD`: what lies behind tau shows with exp(-tau), so all steps have about
the same share in what is wrong of it.
"""

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.clouds.bounds import CloudSurfaces, next_crossing
from realtime.clouds.single_scattering import SPREAD
from realtime.numerics.array_types import Metres
from realtime.scene.media.bounded import Clouds

#: A depth behind which nothing shows: exp(-20) = 2e-9.
OPAQUE = 20.0
_SHORTEST = 1e-6  # of a step, of the distance: rounding leaves as much


def march(
    surfaces: CloudSurfaces, origin, direction, end, total, *, step: Callable, add: Callable, active: Any = True
) -> Any:
    """Add up what small steps of rays within clouds have, from the nearest to the farthest.

    `surfaces`: the boundaries of clouds; `origin`, `direction`, `end`: rays [m], their unit directions, and where they
    end, may be infinite [m]; `total`: the sum of no step, a tuple of arrays of the rays' width; `step`: (total,
    distance [m], cloud, active) -> how long a step may be [m]; `add`: (total, begin, end, cloud, inside) -> total, and
    whether to go on, for steps [m] in the cloud of a number; `active`: lanes to compute.
    """
    Float, lanes = type(direction.x), max(dr.width(direction), dr.width(origin))

    def body(x, edge, cloud, total, going):
        # Where no stretch is open, look for the next crossing: its far end if the ray is in a cloud, else its start.
        looks = going & (x >= edge)
        crossing = next_crossing(surfaces, origin, direction, x, looks)
        opens, jumps, steps_on = looks & crossing.leaves, looks & ~crossing.leaves, going & ~looks
        edge = dr.select(opens, dr.minimum(crossing.distance, end), edge)
        cloud = dr.select(opens, crossing.cloud, cloud)
        target = dr.minimum(x + dr.maximum(step(total, x, cloud, steps_on), _SHORTEST * x), edge)
        total, goes_on = add(total, x, target, cloud, steps_on)
        x = dr.select(jumps, crossing.distance, dr.select(steps_on, target, x))
        return x, edge, cloud, total, going & (x < end) & (looks | goes_on)

    zero = dr.zeros(Float, lanes)
    going = dr.full(mi.Bool, True, lanes) & active & (zero < end)
    state = (+zero, +zero, dr.zeros(mi.UInt32, lanes), total, going)
    *_, total, _ = dr.while_loop(state=state, cond=lambda *state: state[-1], body=body)
    return total


def middle_density(clouds: Clouds, origin, direction, begin, end, cloud, inside) -> Any:
    """Return rho in the middle of steps [1]."""
    assert clouds.density is not None
    return clouds.density.at(origin + direction * (0.5 * (begin + end)), cloud, inside)


def voxel(clouds: Clouds, cloud, active) -> Metres:
    """Return the width of a voxel of the clouds of some numbers, infinite where they have none [m]."""
    assert clouds.density is not None
    return dr.gather(type(clouds.density.voxel), clouds.density.voxel, cloud, active)


def marched_depths(
    surfaces: CloudSurfaces, clouds: Clouds, origin, direction, end, *, stride: Any, seen: bool, active: Any = True
) -> tuple[Any, ...]:
    """Return the optical depth of rays up to a distance in all clouds, by channel [1].

    `surfaces`, `clouds`, `origin`, `direction`, `end`, `active`: as for
    `realtime.clouds.bounds.optical_depths`; how long the first steps are [voxels]; `seen`: whether the depths
    are those of what the eye sees: steps grow, and end behind `OPAQUE`.
    """
    Float, lanes = type(direction.x), max(dr.width(direction), dr.width(origin))

    def step(depths, x, cloud, inside):
        length = stride * voxel(clouds, cloud, inside)
        return length * dr.exp(dr.minimum(least(depths), OPAQUE) / SPREAD) if seen else length

    def add(depths, begin, finish, cloud, inside):
        rho = middle_density(clouds, origin, direction, begin, finish, cloud, inside)
        length = dr.select(inside, rho * (finish - begin), 0)
        depths = tuple(
            dr.fma(dr.gather(Float, own, cloud, inside), length, depth) for own, depth in zip(clouds.sigma_t, depths)
        )
        return depths, least(depths) < OPAQUE if seen else inside

    nothing = tuple(dr.zeros(Float, lanes) for _ in clouds.sigma_t)
    return march(surfaces, origin, direction, end, nothing, step=step, add=add, active=active)


def least(depths: tuple[Any, ...]) -> Any:
    """Return the smallest of depths by channel [1]."""
    smallest = depths[0]
    for depth in depths[1:]:
        smallest = dr.minimum(smallest, depth)
    return smallest
