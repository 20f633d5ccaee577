# SPDX-License-Identifier: BSD-3-Clause
"""References of opaque shapes to media: redundant ones are left out, contradictory ones refused.

Mitsuba asks for the media on both sides of every shape, and old manuals did so for walls and lamps.
The camera and the bounds of media determine the medium at every place; a wall or a lamp adds
nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.errors import InputError
from airlight.realtime.scene.mesh_adjacency import scene_of
from airlight.reference.scene.camera import camera_matrix
from airlight.validation.arrays import Array
from airlight.validation.scenes.files.nodes import child, kind, of_kind, properties, references
from airlight.validation.scenes.files.shapes import samples

_OPEN = ("Rectangle", "Disk", "Cylinder")  # shapes that bound no medium: readers say so


def leave_out_media(state: mi.parser.ParserState, scene: mi.Scene) -> bool:
    """Leave out the media of opaque shapes and of lamps; return whether there were any."""
    nodes = {properties(state, index).id(): index for index in of_kind(state, "Shape")}
    # Light that passes a bound goes straight on: no method and no reference can do a glass with a
    # medium inside.
    for shape in scene.shapes():
        material = child(state, nodes[shape.id()], "BSDF") if shape.id() in nodes else None
        if (
            material is not None
            and _media(shape)
            and not _is_opaque(shape)
            and shape.bsdf().class_name() != "Null"
        ):
            word = properties(state, material).plugin_name()
            raise InputError(
                f"shape '{shape.id()}' bounds a medium and has the material '{word}'; "
                "expected 'null', which lets light pass straight on: replace the material, or "
                "remove the media"
            )
    # Opaque shapes and lamps with references to media. Without a camera nothing says which medium
    # is outside.
    shapes = [
        shape
        for shape in scene.shapes()
        if shape.id() in nodes and _media(shape) and (shape.is_emitter() or _is_opaque(shape))
    ]
    if not shapes or not scene.sensors():
        return False
    others = [shape for shape in scene.shapes() if all(shape.id() != each.id() for each in shapes)]
    bounds = [
        shape for shape in others if shape.interior_medium() is not None and not _is_opaque(shape)
    ]
    # The references are checked against the media that camera and bounds determine, unless a bound
    # is open and determines nothing.
    if not any(shape.class_name() in _OPEN for shape in bounds):
        space = _Space(scene.sensors()[0], bounds)
        for shape in shapes:
            space.check(shape)
    for shape in shapes:
        props = properties(state, nodes[shape.id()])
        for key, at in references(props):
            if kind(state, at) == "Medium":
                del props[key]
        # Without a medium Mitsuba would take away nothing; a lamp without a
        # material is black as before.
        assert child(state, nodes[shape.id()], "Medium") is None
    return True


def touching(scene: mi.Scene) -> list[str]:
    """Return notes on opaque shapes that lie in the bounds of media.

    Rays of Mitsuba's integrators, and of the estimators by random samples, start a little beyond a
    bound and miss a part of such surfaces; methods and quadrature do not.
    """
    opaque = [shape for shape in scene.shapes() if _is_opaque(shape)]
    bounds = [
        shape
        for shape in scene.shapes()
        if shape.interior_medium() is not None and not _is_opaque(shape)
    ]
    if not opaque or not bounds:
        return []
    bodies = scene_of(bounds)
    points, normals = (np.concatenate(parts) for parts in zip(*map(samples, opaque), strict=True))
    # A short ray through each point along its normal: a hit of a parallel face within this distance
    # on either side means that the wall lies in the bound.
    touches = 1e-5  # of a point's coordinates: how near to a bound it is in it
    near = touches * (1 + np.abs(points).max(axis=1, keepdims=True))
    start, reach = mi.Point3f((points - near * normals).T), mi.Float(2 * near[:, 0])
    hit = bodies.ray_intersect(mi.Ray3f(start, mi.Vector3f(normals.T), reach, 0.0, []))
    parallel = (
        np.abs(np.array(hit.n, dtype=np.float64).reshape(3, -1).T * normals).sum(axis=1)
        > 1 - touches
    )
    in_bound = (np.array(hit.is_valid()) & parallel).reshape(len(opaque), -1)
    return [
        f"shape '{shape.id()}' lies in the bound of a medium: Mitsuba's integrators lose a part of "
        "it; move the bound"
        for shape, touched in zip(opaque, in_bound, strict=True)
        if touched.any()
    ]


def _media(shape: mi.Shape) -> list[tuple[str, mi.Medium, int]]:
    """Return the media that a shape references: the side in words, the medium, and 1 where that
    side is the side of the normal, else -1.
    """
    sides = (("interior", shape.interior_medium(), -1), ("exterior", shape.exterior_medium(), 1))
    return [side for side in sides if side[1] is not None]


def _is_opaque(shape: mi.Shape) -> bool:
    return not int(shape.bsdf().flags()) & int(mi.BSDFFlags.Null | mi.BSDFFlags.Transmission)


class _Space:
    """The media in space: the medium around all bounds, and the media within them."""

    def __init__(self, sensor: mi.Sensor, bounds: Sequence[mi.Shape]) -> None:
        self._bounds = scene_of(bounds) if bounds else None
        self._around = sensor.get_medium()
        if self._bounds is not None:
            # The medium outside of all bounds, seen from the camera: a ray from beyond them towards
            # the camera meets the bounds from outside, or none. It begins twice their distance
            # away, as float32 rays from farther would pass small ones.
            camera, box = camera_matrix(sensor)[:3, 3], self._bounds.bbox()
            ends = np.array([np.ravel(box.min), np.ravel(box.max)], dtype=np.float64)
            away = float(np.linalg.norm(ends - camera, axis=1).max())
            start = camera + 2 * away * np.array([0.3, 0.5, 0.8])
            self._around = self._at(start[None], camera[None])[0]

    def _at(self, start: Array, towards: Array) -> list[mi.Medium | None]:
        """Return the media at points, (n, 3) [m]: the medium before the nearest bound on the way
        to other points.
        """
        if self._bounds is None:
            return [self._around] * len(start)
        way = np.broadcast_to(towards, start.shape) - start
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        rays = mi.Ray3f(mi.Point3f(start.T), mi.Vector3f(way.T))
        # The first bound on the way has media on both sides; the medium on the side of the ray's
        # start is the one at the start.
        hit = self._bounds.ray_intersect(rays)
        media = hit.target_medium(-rays.d)
        dr.eval(media, hit)
        met = np.array(hit.is_valid())
        return [media[number] if met[number] else self._around for number in range(len(start))]

    def check(self, shape: mi.Shape) -> None:
        """Refuse a shape that references another medium than the one at its place, on each side."""
        points, normals = samples(shape)
        box = shape.bbox()
        size = float(np.linalg.norm(np.ptp([np.ravel(box.min), np.ravel(box.max)], axis=0)))
        for side, medium, sign in _media(shape):
            # Points a little beside the shape, on the side of the reference; the direction to look
            # along is arbitrary, away from the axes.
            beside = points + sign * 1e-4 * size * normals
            for actual in self._at(beside, beside + np.array([0.3, 0.5, 0.8])):
                if actual != medium:
                    words = f"medium '{actual.id()}'" if actual is not None else "no medium"
                    raise InputError(
                        f"shape '{shape.id()}' is opaque and references medium '{medium.id()}' as "
                        f"{side}, where there "
                        f"is {words}; expected no medium on it, the one that it stands in, or "
                        '<bsdf type="null"/> where it is the bound of a medium'
                    )
