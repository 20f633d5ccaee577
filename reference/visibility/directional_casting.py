# SPDX-License-Identifier: BSD-3-Clause
"""The legs from a directional light to points of camera rays, for the routes of `reference.visibility.lit_intervals`.

A leg begins where it has passed all opaque shapes: at the plane across the light's direction that touches the box
around them from the light's side. Its point is given by its share of the way from `first` to `last`. A smooth surface
that the legs meet at a grazing angle changes its distance t along them as cot(angle) times their distance from one
another, s dx = s (last - first) d(share): t over s (last - first) is what `Legs.depth` wants.

Rounding: begin, direction and end of a float32 leg are off by a few 1e-7 of the coordinates, which is worth as much
over s on the ray.
"""

from collections.abc import Callable

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reference.scene.read import TruthScene
from reference.scene.shapes import Shapes
from reference.visibility.directional_geometry import parallel_intervals
from reference.visibility.intervals import LitIntervals
from reference.visibility.lit_intervals import Legs, found_intervals
from reference.visibility.parallel_rays import ParallelRays
from reference.visibility.random_checks import ROUNDING, Leg

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_SHORT = 2e-6  # relative to the coordinates: how far before its point a leg ends, as for other lights


def directional_intervals(
    truth: TruthScene,
    rays: ParallelRays,
    *,
    samples: int = 256,
    edges: str = "auto",
    shapes: Shapes | None = None,
    checks: int | None = None,
) -> LitIntervals:
    """Find the lit intervals of rays and have them checked, as shares of the way from `rays.first` to `rays.last`.

    The other parameters, and what is refused, are those of `reference.visibility.lit_intervals.lit_intervals`. The
    `edge` of the result is relative to `edge_scale`.
    """
    corners = _box(truth)
    scale = edge_scale(truth, rays)
    length = np.maximum(rays.last - rays.first, np.finfo(float).tiny)
    spread = rays.sine * length
    legs = Legs(
        _shadow_rays(rays, corners),
        _single_leg(rays, corners),
        lambda ray, distance: distance / spread[ray],
        lambda known: parallel_intervals(rays, known),
        ROUNDING * scale / length,
    )
    return found_intervals(truth, legs, ends=rays.ends, samples=samples, edges=edges, shapes=shapes, checks=checks)


def edge_scale(truth: TruthScene, rays: ParallelRays) -> Array:
    """Return what the relative uncertainty of coordinates is worth on each ray, by edges of shadows, (n,) [m].

    It is the largest distance between the camera and what is on legs or rays, over s.
    """
    corner = np.abs(_box(truth) - rays.origin).max(axis=0)
    return max(float(np.max(rays.last, initial=0.0)), float(np.linalg.norm(corner))) / rays.sine


def _box(truth: TruthScene) -> Array:
    """Return the corners of the box around the opaque shapes, (2, 3); the camera where there are none."""
    if not truth.occluders.shapes():
        return np.stack([truth.origin, truth.origin])
    box = truth.occluders.bbox()
    return np.array([[float(c) for c in corner] for corner in (box.min, box.max)])


def _tops(to_light: Array, corners: Array) -> Array:
    """Return how far the box reaches towards the light, as a coordinate along that direction."""
    return np.sum(np.maximum(to_light * corners[0], to_light * corners[1]), axis=-1)


def _single_leg(rays: ParallelRays, corners: Array) -> Leg:
    def leg(ray: np.int64, share: np.float64) -> tuple[Array, Array]:
        towards = rays.to_light[ray]
        point = rays.origin + rays.distance(np.array([ray]), np.array([share]))[0] * rays.direction[ray]
        # A metre beyond all shapes, or beyond the point where that is past them.
        length = max(float(_tops(towards, corners) - point @ towards), 0.0) + 1.0
        return point + length * towards, -length * towards

    return leg


def _shadow_rays(rays: ParallelRays, corners: Array) -> Callable:
    size = float(np.abs(corners).max() + np.abs(rays.origin).max() + np.max(rays.last, initial=0.0))
    towards_all = rays.to_light
    axis = towards_all[0] if len(towards_all) else np.array([0.0, 0.0, 1.0])
    top = float(_tops(axis, corners))
    direction, towards = mi.Vector3d(rays.direction.T), mi.Vector3d(towards_all.T)
    begin, length = mi.Float64(rays.first), mi.Float64(rays.last - rays.first)
    origin = mi.Point3d(*(float(c) for c in rays.origin))
    dr.make_opaque(direction, towards, begin, length, origin)

    def shadow(ray: Index, share: Array):
        index = mi.UInt32(ray.astype(np.uint32))
        x = dr.gather(mi.Float64, begin, index) + mi.Float64(share) * dr.gather(mi.Float64, length, index)
        point = origin + x * dr.gather(mi.Vector3d, direction, index)
        to_light = dr.gather(mi.Vector3d, towards, index)
        reach = dr.maximum(top - dr.dot(point, to_light), 0) + 0.01 * size
        start = mi.Point3f(point + reach * to_light)
        return mi.Ray3f(start, dr.normalize(mi.Vector3f(-to_light)), mi.Float(reach - _SHORT * size), 0.0, [])

    return shadow
