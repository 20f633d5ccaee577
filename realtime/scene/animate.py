# SPDX-License-Identifier: BSD-3-Clause
"""Motion from frame to frame: lights, the medium, objects.

A moved scene is a new `Scene` that shares what did not move. Its arrays have the types and sizes of
the old ones and are opaque, so a frame that was recorded once serves for all. Objects alone move in
Mitsuba's scene, too, so that rays meet them; methods prepare their state from `Scene.positions`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.realtime.area_lights.shape import AreaLight, occluder_vertices
from airlight.realtime.numerics.array_types import aligned_array, types_of
from airlight.realtime.scene.directional_extent import directional_fields, extent_spheres
from airlight.realtime.scene.lights import DirectionalExtent, Light
from airlight.realtime.scene.media.medium import Medium
from airlight.realtime.scene.mesh_adjacency import Occluders
from airlight.realtime.scene.read_scene import Scene
from airlight.realtime.scene.triangle_table import Facets, read_facets, turned_facets

Array = NDArray[np.float64]


def turned_light(light: Light, about: Array, turn: Array) -> Light:
    """Return a light turned about a point, with its axis if it has one; a light at
    infinity only turns its axis.

    A uniform sky is the same whichever way it turns, and the beam that stands for it stays.

    `light`: the light; `about`: a point that stays [m]; `turn`: rotation matrix, (3, 3).
    """
    if light.sky is not None:
        return light
    # The rectangle across a light at infinity is fitted to the media again: they do not turn.
    if light.extent is not None:
        return replace(light, **_turned_directional(light, light.extent, turn))
    position = np.array(light.position, dtype=np.float64).ravel()
    arrays = {"position": _like(light.position, about + turn @ (position - about))}
    # A spot turns with its place.
    if light.exact_axis is not None:
        arrays["exact_axis"] = _like(light.exact_axis, turn @ np.array(light.exact_axis).ravel())
    return replace(light, **arrays)


def _turned_directional(light: Light, extent: DirectionalExtent, turn: Array) -> dict[str, Any]:
    types = types_of(type(extent.back))
    return directional_fields(
        turn @ np.array(light.exact_axis).ravel(),
        extent_spheres(extent),
        float(extent.back[0]),
        types,
        without_sides=float(extent.lowest[0]) < 0,
    )


def coloured_light(light: Light, fraction: float) -> Light:
    """Return a light whose red, green and blue rotate by a fraction of a turn; their sum stays."""
    colours = {"intensity": light.intensity} | ({} if light.sky is None else {"sky": light.sky})
    turned = {
        name: _rotated(np.array(colour, dtype=np.float64).ravel(), fraction)
        for name, colour in colours.items()
    }
    return replace(light, **{name: _like(colours[name], colour) for name, colour in turned.items()})


def _rotated(colour: Array, fraction: float) -> Array:
    # A third of a turn moves each value to the next channel. Between two such turns the colours mix
    # linearly, which leaves their sum as it is.
    whole, part = divmod(3 * fraction, 1)
    before, after = (np.roll(colour, int(whole) + step) for step in (0, 1))
    return (1 - part) * before + part * after


def coloured_area_light(light: AreaLight, fraction: float) -> AreaLight:
    """Return an area light whose red, green and blue rotate by a fraction of
    a turn; their sum stays.
    """
    return replace(light, radiance=_rotated(light.radiance, fraction))


def with_area_lights(scene: Scene, area_lights: Sequence[AreaLight]) -> Scene:
    """Return a scene with its area lights elsewhere; the shapes of black ones
    move in its Mitsuba scene.
    """
    # Black lights are opaque: their shapes are in Mitsuba's scene, where rays meet them.
    black = [light for light in area_lights if light.opaque]
    if not black:
        return replace(scene, area_lights=tuple(area_lights))
    parameters = mi.traverse(scene.geometry)
    for light in black:
        if light.kind == "mesh":
            replace_positions(parameters, {light.name: light.vertices.astype(np.float32)})
            continue
        key = f"{light.name}.to_world"
        # The columns of to_world: both axes of the shape, a third one across them that is as long
        # as the first, and the middle.
        third = np.cross(light.across, light.up)
        third *= np.linalg.norm(light.across) / np.linalg.norm(third)
        matrix = np.eye(4)
        matrix[:3] = np.stack([light.across, light.up, third, light.middle], axis=1)
        parameters[key] = type(parameters[key])(mi.Matrix4f(matrix.astype(np.float32)))
    parameters.update()
    # Methods that read triangles find the shapes of black lights by their names, too.
    moved = {light.name: occluder_vertices(light) for light in black}
    return replace(scene, area_lights=tuple(area_lights), positions={**scene.positions, **moved})


def thicker_medium(medium: Medium, factor: float) -> Medium:
    """Return a medium, and the bounded media in it, with the extinction times a
    factor; the albedo stays.

    Raises InputError for a factor that is negative or not finite.
    """
    if not 0 <= factor < np.inf:
        raise InputError(
            f"factor of the extinction: got {factor!r}, expected a finite value of 0 or more"
        )
    return medium.thicker(factor)


@dataclass(frozen=True)
class Objects:
    """Shapes that can move, as they stood when they were read."""

    parameters: Any  #: `mi.traverse` of the Mitsuba scene
    vertices: Mapping[str, NDArray[np.float32]]  #: by shape, its vertices as Mitsuba has them [m]
    middles: Mapping[str, Array]  #: of their bounding boxes [m]
    numbers: Mapping[str, int]  #: of the shapes in the scene
    facets: Facets | None  #: the triangles of the scene


def read_objects(scene: Scene, names: Sequence[str]) -> Objects:
    """Read the shapes that are to move; `names` are those of meshes.

    Raises InputError for a shape that is not there, or whose vertices Mitsuba does not let move.
    """
    parameters = mi.traverse(scene.geometry)
    vertices = {}
    for name in names:
        key = f"{name}.vertex_positions"
        if key not in parameters:
            raise InputError(
                f"shape {name!r} cannot move: expected the name of a mesh (obj, ply) in the scene"
            )
        vertices[name] = np.array(parameters[key], dtype=np.float32).reshape(-1, 3)
    facets = None
    if scene.facets is not None:
        # Objects may have moved before in Mitsuba's scene: as it is now, vertices and
        # normals are of one place.
        facets = read_facets(scene.geometry, types_of(type(scene.camera.origin.x)))
    # The table of triangles knows shapes by their numbers in the scene.
    numbers = _numbers(parameters, names, scene.geometry.shapes()) if facets is not None else {}
    middles = {
        name: 0.5 * (corners.min(axis=0).astype(float) + corners.max(axis=0))
        for name, corners in vertices.items()
    }
    # The same places in aligned arrays: the first frame is recorded with what later ones have.
    replace_positions(parameters, vertices)
    return Objects(parameters, vertices, middles, numbers, facets)


def _numbers(parameters, names: Sequence[str], shapes) -> dict[str, int]:
    """Return which of the shapes have the vertices of these names: Mitsuba makes
    names for shapes without one.
    """
    numbers = {}
    for number, shape in enumerate(shapes):
        # One mesh has one Dr.Jit variable of positions in both traversals: its index finds the
        # shape.
        of_shape = mi.traverse(shape)
        if "vertex_positions" in of_shape:
            numbers[of_shape["vertex_positions"].index] = number
    return {name: numbers[parameters[f"{name}.vertex_positions"].index] for name in names}


def replace_positions(parameters, positions: Mapping[str, NDArray[Any]]) -> None:
    """Move the vertices of shapes in Mitsuba's scene, which holds them in float32.

    The arrays are aligned, so that a frozen function that reads them is not recorded again.
    """
    for name, vertices in positions.items():
        parameters[f"{name}.vertex_positions"] = aligned_array(mi.Float, vertices.ravel())
    if positions:
        parameters.update()


def turned_objects(scene: Scene, objects: Objects, turn: Array) -> Scene:
    """Return the scene with each of the objects turned about the middle of its bounding
    box, from where it stood.

    `turn` is a rotation matrix, (3, 3). The scene's Mitsuba scene is changed.
    """
    # From where the objects stood when they were read: turns of many frames do not add up their
    # rounding.
    positions = {
        name: ((vertices - objects.middles[name]) @ turn.T + objects.middles[name]).astype(
            np.float32
        )
        for name, vertices in objects.vertices.items()
    }
    replace_positions(objects.parameters, positions)
    facets = objects.facets
    if facets is not None:
        facets = turned_facets(facets, objects.numbers.values(), turn)
    return replace(scene, positions={**scene.positions, **positions}, facets=facets)


def closed_shapes(occluders: Occluders) -> tuple[str, ...]:
    """Return the names of the shapes all of whose components are closed:
    things, not floors and walls.
    """
    component_shape = occluders.component_shape
    # One open component makes its shape open.
    open_shapes = component_shape[~occluders.closed]
    closed = np.setdiff1d(component_shape, open_shapes)
    return tuple(occluders.shapes[number] for number in closed)


def _like(old, values):
    """Return an opaque array of the type of an old one."""
    new = type(old)(*(float(value) for value in values))
    dr.make_opaque(new)
    return new
