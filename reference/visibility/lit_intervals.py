# SPDX-License-Identifier: BSD-3-Clause
"""The lit parts of camera rays up to the visible surface, exact, and
checked by random shadow rays.
"""

from dataclasses import dataclass, replace

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.reference.scene.area_light import ReferenceAreaLight
from airlight.reference.scene.convex_bounds import Sphere
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.scene.shape_roles import scene_of
from airlight.reference.scene.shapes import Disks, Shapes, read_shapes
from airlight.reference.visibility.candidates import Ball, Near, near_shapes
from airlight.reference.visibility.certificate import LitIntervals, certified
from airlight.reference.visibility.distances import crossings
from airlight.reference.visibility.planes import Rays
from airlight.reference.visibility.shadows import lit_parts

Array = NDArray[np.float64]
Index = NDArray[np.int64]

#: of the largest coordinate: what is closer to the plane of a light counts
#: as in it; float32 corners
IN_PLANE = 1e-7
# of a distance, and of a metre or a smaller scene: an interval that ends this close to the surface,
# met in float32 if need be, reaches it
_END = 1e-6


@dataclass(frozen=True)
class Obstacles:
    """The possible occluders of a light, and the rays that they are near."""

    scene: "mi.Scene"  #: the shapes, for ray casts
    shapes: Shapes  #: the same as numbers
    near: Near
    light: Ball  #: the bounds of the light


def obstacles(
    reference: ReferenceScene, light: Ball, distance: Array, shapes: Shapes | None = None
) -> Obstacles:
    """Return the possible occluders between a light and the rays of a scene.

    `reference`: the scene; `light`: the bounds of the light; `distance`: how far the rays of the
    scene go, (rays,), may be infinite [m]; `shapes`: the result of
    `reference.scene.shapes.read_shapes` for its occluders, by default read here.
    """
    shapes = read_shapes(reference.occluders) if shapes is None else shapes
    near = near_shapes(light, reference.origin, reference.direction, distance, shapes)
    return Obstacles(reference.occluders, shapes, near, light)


def before_light(
    reference: ReferenceScene, light: ReferenceAreaLight
) -> tuple[ReferenceScene, Shapes]:
    """Return the scene and the shapes that can shadow an area light.

    `reference`, `light`: the scene and one of its area lights.

    A rectangle and a disk emit to one side, and a convex body shines on nothing that it hides
    itself: the shape of such a light never shadows its light, nor do shapes in or behind the plane
    of a rectangle or a disk. They are left out: in float64 a shape in the plane would be before or
    behind it by chance. The shape of a mesh that is not convex stays, a hair behind the triangles
    that emit.
    """
    shapes = reference.occluders.shapes()
    others = [shape for shape in shapes if shape != light.shape or light.shadows_itself]
    if len(others) < len(shapes):
        reference = replace(reference, occluders=scene_of(others, reference.scene))
    occluders = read_shapes(reference.occluders)
    if light.kind in ("rectangle", "disk"):
        disks = occluders.disks
        largest = max(
            occluders.metre(light.centre, reference.origin),
            float(np.abs(occluders.triangles).max(initial=0)),
            float((np.abs(disks.centre).max(axis=1) + disks.radius).max(initial=0)),
            float(np.abs(light.centre).max()),
        )
        # A triangle stays if any corner is before the plane by more than rounding, and a disk if
        # its rim is.
        before = (occluders.triangles - light.centre) @ light.normal > IN_PLANE * largest
        lean = np.linalg.norm(np.cross(disks.normal, light.normal), axis=1)
        rim = (disks.centre - light.centre) @ light.normal + disks.radius * lean
        stay = rim > IN_PLANE * largest
        occluders = replace(
            occluders,
            triangles=occluders.triangles[before.any(axis=1)],
            disks=Disks(disks.centre[stay], disks.normal[stay], disks.radius[stay]),
        )
    return reference, occluders


def lit_intervals(
    rays: Rays,
    ends: tuple[Array, Array],
    occluders: Obstacles,
    *,
    of: Index | None = None,
    checks: int = 32,
    every: int = 1,
    normal: Array | None = None,
) -> LitIntervals:
    """Find the lit intervals of rays between two distances, and have them checked.

    `rays`: the rays in their planes with the light, or with samples of it; `ends`: distances
    between which intervals are searched, (rays,) each [m]; the second may be infinite; `occluders`:
    the shapes that can stand in the light; `of`: by ray its number in `occluders`, (rays,); by
    default the number of the ray; `checks`, `every`, `normal`: see
    `reference.visibility.certificate.certified`; no checks if `checks` is 0.

    Valid for opaque meshes, rectangles, spheres and disks, wherever they are.
    """
    of = np.arange(len(rays.foot)) if of is None else of
    # A sphere around the light shows only its inside; all other shapes cast shadows.
    low, high = _inside(rays, ends, occluders)
    ray, x0, x1 = lit_parts(rays, (low, high), occluders.near, occluders.shapes, of)
    # An end of a lit interval is an edge between light and shadow unless it is an end of the range.
    metre = occluders.shapes.metre(rays.origin, *([rays.position] if rays.w else ()))
    inner = (
        x0 > ends[0][ray] + _END * (metre + np.abs(x0)),
        x1 * (1 + _END) + _END * metre < ends[1][ray],
    )
    transitions = int(inner[0].sum() + inner[1].sum())
    lit = LitIntervals(ray, x0, x1, transitions, metre=metre)
    # Without shapes no edge is uncertain.
    if not occluders.shapes.count:
        lit = replace(lit, edge=0.0)
    if not checks:
        return lit
    return certified(
        lit,
        rays,
        ends,
        occluders=occluders.scene,
        shapes=occluders.shapes,
        checks=checks,
        every=every,
        normal=normal,
    )


def _inside(rays: Rays, ends: tuple[Array, Array], occluders: Obstacles) -> tuple[Array, Array]:
    """Return the ends of the parts of rays that lie inside of all spheres that hold the light."""
    low, high = ends
    if not rays.w:
        return low, high
    light = occluders.light
    for centre, radius in zip(occluders.shapes.centre, occluders.shapes.radius, strict=True):
        # A sphere that holds no part of the light's ball holds none of its samples.
        if np.linalg.norm(centre - light.centre) >= radius + light.radius:
            continue
        within = np.linalg.norm(rays.position - centre, axis=1) < radius
        enter, leave = crossings(Sphere(centre, float(radius)), rays.origin, rays.direction)
        low = np.where(within, np.maximum(low, enter), low)
        high = np.where(within, np.minimum(high, leave), high)
    return low, high


def reaches(lit: LitIntervals, distance: Array) -> NDArray[np.bool_]:
    """Return by ray whether its last lit interval goes on to a distance, (rays,) [m]."""
    # The end of each ray's last interval; rays without an interval stay at -inf.
    last = np.full(len(distance), -np.inf)
    np.maximum.at(last, lit.ray, lit.high)
    return last * (1 + _END) + _END * lit.metre >= distance
