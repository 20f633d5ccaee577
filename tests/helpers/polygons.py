# SPDX-License-Identifier: BSD-3-Clause
"""Scenes of boxes that tests share, and the rays of an image as the search for lit intervals takes them."""

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from analytic.geometry import foot_and_height
from reference.quadrature.surface import surface_hits
from reference.visibility.exact_distance import exact_distance
from reference.visibility.lit_intervals import _shadow_rays, _visible
from reference.visibility.random_checks import Visible
from reference.visibility.spot_cone import cone_interval, perpendicular
from tests.helpers.scenes import tiny_scene


def rays_of(truth, light=0):
    """Return the rays of an image, and where they begin and end as angles at a light."""
    lamp, direction = truth.lights[light], truth.direction
    foot, height = foot_and_height(np.broadcast_to(truth.origin, direction.shape), direction, lamp.position)
    normal = perpendicular(truth.origin, direction, lamp)
    hits = surface_hits(truth)
    distance = exact_distance(truth, hits.interaction, hits.distance)
    end = np.where(np.isfinite(distance), np.arctan2(distance - foot, height), np.pi / 2)
    cone = cone_interval(direction, normal, lamp, lamp.cutoff)
    return lamp, (direction, normal, height), (np.maximum(np.arctan2(-foot, height), cone[0]), np.minimum(end, cone[1]))


def lit_lengths(intervals, ends):
    """Return how much of the angle at the light is lit on each ray."""
    return np.bincount(intervals.ray, intervals.high - intervals.low, len(ends[0]))


def box(centre, size, **changes):
    """Return a box whose sides are parallel to the axes."""
    transform = mi.ScalarTransform4f().translate(list(centre)).scale([0.5 * s for s in size])
    return {"type": "cube", "to_world": transform} | changes


def box_scene(**changes):
    """A scene of polygons: the sphere of the tiny scene replaced by boxes."""
    boxes = {"tower": box((0.1, 0.1, 0.7), (0.43, 0.37, 1.4)), "beam": box((0.6, 0.3, 1.1), (0.9, 0.11, 0.13))}
    return tiny_scene(ball=None, **boxes, **changes)


Array = NDArray[np.float64]


def visibility_test(scene, position: Array, rays: tuple[Array, Array, Array]) -> Visible:
    """Return a function (ray numbers, angles) -> whether the light at `position` reaches those points.

    The shadow rays start at the light, where nothing is close, and stop twenty float32 roundings before the point: a
    point on a surface must not be blocked by that surface.
    """
    return _visible(scene, _shadow_rays(position, rays))
