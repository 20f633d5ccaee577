# SPDX-License-Identifier: BSD-3-Clause
"""A Mitsuba scene of which some shapes stand elsewhere: rays go into the space of each of them, vertices stay.

Mitsuba has one acceleration structure for a scene and builds all of it anew when a vertex moves. Its own instances do
not help: `EmbreeAccel::rebuild` in `src/render/scene_embree.inl` of 3.9.1 releases and builds the structures of all
shape groups too whenever the transform of one instance changes. So a shape of many triangles gets a Mitsuba scene of
its own here, which is built once, and a ray is cast in that scene too: from R^T (o - s) along R^T d, where the shape's
points p stand at R p + s. Distances are the same, since R turns.

Each ray is cast once more for each such scene, so that only shapes of many triangles get one. Mitsuba's interactions
with surfaces are of the space of the shape: only a scene with a table of triangles
(`realtime.scene.triangle_table`) is parted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from realtime.numerics.aligned import aligned_numbers
from realtime.scene.mesh_adjacency import Placement
from realtime.scene.named_shapes import scene_of


@dataclass(frozen=True)
class Space:
    """The space of one shape."""

    scene: Any  #: an `mi.Scene` of the shape alone, where it was read
    number: Any  #: of the shape in Mitsuba's registry
    rotation: tuple[Any, Any, Any]  #: rows of R, in float64
    shift: Any  #: s, in float64 [m]

    def ray(self, ray, longest) -> Any:
        """Return a Mitsuba ray as it is in this space, to the distance `longest` [m]."""
        origin = self._turned_back(mi.Vector3d(ray.o) - self.shift)
        return mi.Ray3f(mi.Point3f(origin), mi.Vector3f(self._turned_back(mi.Vector3d(ray.d))), longest, ray.time, [])

    def point(self, point) -> Any:
        """Return where a point of the shape stands [m], in its own precision."""
        own = mi.Vector3d(point)
        return type(point)(mi.Vector3d(*(dr.dot(row, own) for row in self.rotation)) + self.shift)

    def _turned_back(self, vector) -> Any:
        return sum(row * part for row, part in zip(self.rotation, vector, strict=True))


@dataclass(frozen=True)
class PlacedScene:
    """What methods ask of a Mitsuba scene, of one in parts."""

    standing: Any  #: an `mi.Scene` of the shapes that stand where Mitsuba has them
    spaces: tuple[Space, ...]  #: of the others

    def shapes(self) -> list[Any]:
        """Return Mitsuba's shapes; those with spaces stand there where they were read."""
        return [*self.standing.shapes(), *(space.scene.shapes()[0] for space in self.spaces)]

    def bbox(self) -> Any:
        """Return a box about all shapes [m]."""
        box = mi.ScalarBoundingBox3f(self.standing.bbox())
        for space in self.spaces:
            own = space.scene.bbox()
            for number in range(8):
                corner = space.point(mi.Vector3d(mi.Point3f(own.corner(number))))
                box.expand(mi.ScalarPoint3f(*(float(part[0]) for part in corner)))
        return box

    def ray_intersect_preliminary(self, ray, coherent=False, active=True) -> Any:
        """Return the nearest intersection of rays: shape, triangle and place in it are right, and the distance."""
        hit = self.standing.ray_intersect_preliminary(ray, coherent=coherent, active=active)
        for space in self.spaces:
            longest = dr.select(hit.is_valid(), hit.t, ray.maxt)
            own = space.scene.ray_intersect_preliminary(space.ray(ray, longest), coherent=coherent, active=active)
            hit = dr.select(own.is_valid(), own, hit)
        return hit

    def ray_test(self, ray, active=True) -> Any:
        """Return whether rays meet a shape."""
        blocked = self.standing.ray_test(ray, active)
        for space in self.spaces:
            blocked |= space.scene.ray_test(space.ray(ray, ray.maxt), active & ~blocked)
        return blocked

    def placed(self, hit, point) -> Any:
        """Return where points of the shapes stand that an intersection is with [m]."""
        shape = dr.reinterpret_array(mi.UInt32, hit.shape)
        for space in self.spaces:
            point = dr.select(shape == space.number, space.point(point), point)
        return point


def parted(scene, names: Sequence[str]) -> PlacedScene:
    """Return a Mitsuba scene with spaces of their own for the shapes of these names, in this order."""
    shapes = {shape.id(): shape for shape in scene.shapes()}
    standing = scene_of([shape for shape in scene.shapes() if shape.id() not in names])
    return PlacedScene(standing, tuple(_space(shapes[name]) for name in names))


def placed(scene: PlacedScene, placements: Sequence[Placement]) -> PlacedScene:
    """Return the scene with the shapes of its spaces elsewhere: nothing is built anew."""
    return replace(
        scene,
        spaces=tuple(
            replace(space, **_placement(placement.rotation, placement.shift))
            for space, placement in zip(scene.spaces, placements, strict=True)
        ),
    )


def mitsuba_scene(scene) -> Any:
    """Return the `mi.Scene` that holds the shapes without spaces of their own: what Mitsuba can be told of."""
    return scene.standing if isinstance(scene, PlacedScene) else scene


def _space(shape) -> Space:
    number = dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))
    dr.make_opaque(number)
    return Space(scene_of([shape]), number, **_placement(np.eye(3), np.zeros(3)))


def _placement(rotation, shift) -> Mapping[str, Any]:
    # Each number has an array of its own: a recorded frame tells arrays that are one from arrays that are equal.
    numbers = aligned_numbers(mi.Float64, np.append(rotation, shift))
    rows = [mi.Vector3d(numbers[first : first + 3]) for first in range(0, 12, 3)]
    return {"rotation": tuple(rows[:3]), "shift": rows[3]}
