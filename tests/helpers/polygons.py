# SPDX-License-Identifier: BSD-3-Clause
"""Scenes of boxes that tests share, and the rays of an image as the search for
lit intervals takes them.
"""

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.reference.quadrature.surface import surface_hits
from airlight.reference.visibility.candidates import Ball
from airlight.reference.visibility.distances import exact_distance
from airlight.reference.visibility.lit_intervals import obstacles
from airlight.reference.visibility.planes import cone_interval, rays_at
from tests.helpers.scenes import tiny_scene


def rays_of(reference, light=0):
    """Return the rays of an image in their planes with a light, where they begin and end,
    and what is in the light.
    """
    lamp = reference.lights[light]
    rays = rays_at(reference.origin, reference.direction, lamp.position)
    hits = surface_hits(reference)
    distance = exact_distance(reference, hits.interaction, hits.distance)
    low, high = cone_interval(rays, lamp, lamp.cutoff)
    ends = np.maximum(rays.distance(low), 0.0), np.minimum(rays.distance(high), distance)
    return rays, ends, obstacles(reference, Ball(lamp.position), distance)


def box(centre, size, **changes):
    """Return a box whose sides are parallel to the axes."""
    transform = mi.ScalarTransform4f().translate(list(centre)).scale([0.5 * s for s in size])
    return {"type": "cube", "to_world": transform} | changes


def box_scene(**changes):
    """A scene of polygons: the sphere of the tiny scene replaced by boxes."""
    boxes = {
        "tower": box((0.1, 0.1, 0.7), (0.43, 0.37, 1.4)),
        "beam": box((0.6, 0.3, 1.1), (0.9, 0.11, 0.13)),
    }
    return tiny_scene(ball=None, **boxes, **changes)


Array = NDArray[np.float64]
