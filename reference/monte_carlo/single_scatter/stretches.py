# SPDX-License-Identifier: BSD-3-Clause
"""Camera rays and their stretches in one medium, and the cells of the unit interval that samples along them lie in."""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi


@dataclass(frozen=True)
class Ray:
    """Camera rays in both precisions."""

    origin: Any
    direction: Any
    origin_double: Any
    direction_double: Any


@dataclass(frozen=True)
class Stretch:
    """The part of camera rays in one medium."""

    start: Any  #: distance from the camera where it begins [m]
    end: Any  #: where it ends, may be infinite [m]
    depth: Any  #: optical depth from the camera to its start
    medium: Any  #: pointer
    sigma_s: Any  #: [1/m]
    sigma_t: Any  #: [1/m]
    at_lights: tuple[Any, ...]  #: pointers to the media in which the point and spot lights are
    at_camera: Any  #: pointer to the medium in which the camera is


def double_ray(origin, direction) -> Ray:
    """Return rays given in double precision; their directions need not have unit length."""
    direction = dr.normalize(direction)
    return Ray(mi.Point3f(origin), dr.normalize(mi.Vector3f(direction)), origin, direction)


def cell_of(number, shift, count: int) -> tuple[Any, Any]:
    """Return where a cell of the unit interval begins, and its width.

    All cells are 1/(count - 1) wide but the first and the last, which share that width as `shift` in [0, 1) says. So
    the edge of a shadow lies anywhere in its cell from batch to batch; in cells that stay, an edge close to the end of
    one would be felt so rarely that no spread between batches could tell.
    """
    if count == 1:
        return mi.Float(0), mi.Float(1)
    place = mi.Float(number) + shift
    low, high = dr.maximum(place - 1, 0), dr.minimum(place, count - 1)
    return low / (count - 1), (high - low) / (count - 1)


def point_on(ray: Ray, position):
    """Return a point of a medium on camera rays."""
    point = dr.zeros(mi.MediumInteraction3f)
    point.p = position
    point.wi = -ray.direction
    point.sh_frame = mi.Frame3f(ray.direction)
    return point
