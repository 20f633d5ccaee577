# SPDX-License-Identifier: BSD-3-Clause
"""Occluders: what casts shadows, and the floor, wall or room that receives them.

All lie within a ball, and no ball holds a light or the camera. But a cage is about a light, and the
ground is drawn around all else.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike

from airlight.errors import InputError
from airlight.realtime.scene.mesh_adjacency import mesh_triangles
from airlight.validation.arrays import Array
from airlight.validation.scenes.meshes import (
    Mesh,
    box,
    gem,
    grid,
    icosphere,
    joined,
    lathe,
    pierced_slab,
    placed,
    prism,
    rotation,
    scaled,
    star,
    tetrahedron,
    torus,
)
from airlight.validation.scenes.random.design import Draws, Ranges
from airlight.validation.scenes.random.lights import Light

_CAMERA = 0.31  # an occluder is as far from the camera at least, in radii of the stage

_SCREENS = ("fence", "pierced", "sheet", "plate")


@dataclass(frozen=True)
class Occluder:
    """A shape that casts shadows, first in radii of the stage, then in metres."""

    kind: str  #: of `occluder_kinds` in the ranges, 'ball', 'cage', 'floor', 'wall' or 'room'
    mesh: Mesh = field(repr=False)  #: where it is; a ball is Mitsuba's sphere in its place
    position: Array  #: of the middle of the ball around it
    radius: float  #: of the ball
    reflectance: Array
    name: str = ""

    def placed(self, scale: float, centre: Array) -> "Occluder":
        """Return the occluder in a stage of a radius and a centre [m]."""
        mesh = placed(scaled(self.mesh, scale), centre)
        return replace(
            self, mesh=mesh, position=centre + scale * self.position, radius=scale * self.radius
        )


def _placed(
    kind: str, mesh: Mesh, position: Array, radius: float, turn: tuple[Array, float], colour: Array
) -> Occluder:
    """Return an occluder of a mesh within the unit ball; `turn`: axis and angle [degrees]."""
    return Occluder(
        kind, placed(scaled(mesh, radius), position, rotation(*turn)), position, radius, colour
    )


def draw_occluders(
    draws: Draws, ranges: Ranges, camera: Array, lights: Sequence[Light], *, in_shadow: bool
) -> list[Occluder]:
    """Return the occluders of a scene, and perhaps a plate that keeps the
    first light from the camera.
    """
    files = _files(ranges["meshes"])
    # Meshes of a user need a folder; without any kind left, boxes.
    kinds = {
        kind: weight for kind, weight in ranges["occluder_kinds"].items() if kind != "mesh" or files
    }
    kinds = kinds if any(kinds.values()) else {"box": 1.0}
    occluders = [_shade(draws.of("shade"), camera, lights[0])] if in_shadow else []
    if draws.pick(ranges["cages"], "cages") == "yes":
        near = [light for light in lights if light.kind != "directional"]
        # A cage is around a light at a place; a directional light has none.
        occluders += [_cage(draws.of("cage"), camera, near[0])] if near else []
    count = draws.count(*ranges["occluders"], name="occluders")
    size = draws.logarithmic(*ranges["occluder_size"], name="occluder_size")
    for number in range(1, count + 1):
        stream = draws.of(f"caster-{number}")
        kind = draws.pick(kinds, f"occluder_kind-{number}")
        if number == 1 and draws.pick(ranges["spheres"], "spheres") == "yes":
            kind = "ball"
        # An occluder that finds no free place is left out.
        for _ in range(24):
            position, radius = _place(stream, ranges, kind, size, lights)
            if _is_clear(position, radius, camera, lights):
                occluders.append(_occluder(stream, kind, position, radius, files))
                break
    return occluders


def _place(
    stream: Draws, ranges: Ranges, kind: str, size: float, lights: Sequence[Light]
) -> tuple[Array, float]:
    """Return a place for an occluder: in the stage, or for a screen before a light too."""
    low, high = ranges["occluder_size"]
    radius = min(max(size * stream.logarithmic(0.41, 2.43), low), high)
    if kind in _SCREENS and stream.fraction() < 0.4:
        # Two screens of five stand between a light and the stage, where they cast shadows over all
        # of it.
        light = lights[int(stream.fraction() * len(lights))]
        toward = light.position / np.linalg.norm(light.position)
        away = min(float(np.linalg.norm(light.position)), 2.3)
        return stream.between(0.29, 0.83) * away * toward + 0.23 * stream.in_ball(), min(
            2.1 * radius, 0.9
        )
    # The stage is a little flat.
    position = stream.in_ball() * np.array([1.0, 1.0, 0.71])
    return position, radius


def _is_clear(position: Array, radius: float, camera: Array, lights: Sequence[Light]) -> bool:
    if np.linalg.norm(position - camera) < radius + _CAMERA:
        return False
    return all(
        # the least distance from a light, in radii of the stage
        np.linalg.norm(position - light.position) > radius + light.ball + 0.023
        for light in lights
    )


def _occluder(
    stream: Draws, kind: str, position: Array, radius: float, files: Sequence[Path]
) -> Occluder:
    reflectance = np.array([stream.between(0.07, 0.83) for _ in range(3)])
    upright = kind in ("fence", "vase", "pierced")
    # Upright shapes turn about an axis near the vertical, others about any.
    axis = stream.vector() + (np.array([0.0, 0.0, 4.0]) if upright else 0)
    angle = stream.between(3.0, 357.0)
    turn = axis / np.linalg.norm(axis), angle
    return _placed(kind, _solid(stream, kind, files), position, radius, turn, reflectance)


def _solid(stream: Draws, kind: str, files: Sequence[Path]) -> Mesh:
    """Return a mesh of a kind within the unit ball."""
    match kind:
        case "box":
            return box(2 * _half(stream, 3))
        case "plate":
            # The corner of half sides (0.31 to 1, normalised) stays near the unit ball with a thin
            # third side.
            thin = stream.logarithmic(0.0013, 0.047)
            return box(2 * np.append(_half(stream, 2), thin))
        case "sheet":
            return _rectangle(_half(stream, 3)[:2], (3, 2))
        case "tetrahedron":
            return tetrahedron(1.0)
        case "icosphere":
            return icosphere(stream.count(0, 3))
        case "gem":
            return gem(stream.count(5, 17), stream.count(2, 7))
        case "torus":
            # The outer radius, from the axis to the far side of the tube, is 1.
            tube = stream.between(0.09, 0.37)
            return torus(1 - tube, tube, (stream.count(17, 53), stream.count(7, 19)))
        case "star":
            points, inner, height = (
                stream.count(3, 9),
                stream.between(0.31, 0.73),
                stream.logarithmic(0.05, 0.9),
            )
            across = math.sqrt(1 - height**2)
            return placed(prism(star(inner * across, across, points), 2 * height), (0, 0, -height))
        case "vase":
            sides = stream.count(5, 29)
            radii = [stream.between(0.17, 0.61) for _ in range(stream.count(3, 11))]
            return lathe(radii, np.linspace(-0.77, 0.77, len(radii)), sides)
        case "fence":
            return _fence(stream)
        case "pierced":
            return _pierced(stream)
        case "mesh":
            return _user_mesh(files[int(stream.fraction() * len(files))])
    return icosphere(0)  # of a ball


def _half(stream: Draws, count: int) -> Array:
    """Return half of so many sides, whose corner is at the distance 1."""
    half = np.array([stream.between(0.31, 1.0) for _ in range(count)])
    return half / np.linalg.norm(half)


def _rectangle(half: ArrayLike, cells: tuple[int, int] = (1, 1)) -> Mesh:
    x, y = np.asarray(half, dtype=np.float64).tolist()
    return grid((-x, -y, 0.0), (2 * x, 0, 0), (0, 2 * y, 0), cells)


def _fence(stream: Draws) -> Mesh:
    """Return upright bars side by side, each turned about itself."""
    bars, width, height = (
        stream.count(3, 17),
        stream.between(0.13, 0.71),
        stream.between(0.37, 0.71),
    )
    thickness, turn = (
        stream.logarithmic(0.007, 0.11),
        rotation((0, 0, 1), stream.between(-67.0, 67.0)),
    )
    # The bars fill the width from -0.67 to 0.67.
    pitch = 2 * 0.67 / bars
    bar = box((width * pitch, 2 * thickness, 2 * height))
    return joined(
        [placed(bar, ((number + 0.5) * pitch - 0.67, 0.0, 0.0), turn) for number in range(bars)]
    )


def _pierced(stream: Draws) -> Mesh:
    """Return a slab with holes across and upwards, a fraction of its sides."""
    across, up = stream.count(1, 7), stream.count(1, 5)
    fraction, thickness = stream.between(0.29, 0.79), stream.logarithmic(0.011, 0.13)

    def lines(holes: int, half: float) -> Array:
        # Holes take the fraction of the side, ribs of equal width the rest.
        rib = (1 - fraction) / (holes + 1)
        widths = np.array([rib, *([fraction / holes, rib] * holes)])
        return 2 * half * np.concatenate([[0.0], np.cumsum(widths)])

    x, y = 0.71, 0.67
    return pierced_slab(lines(across, x), lines(up, y), 2 * thickness, (thickness, -x, -y))


def _files(folder: str) -> list[Path]:
    if not folder:
        return []
    files = sorted(
        path for path in Path(folder).iterdir() if path.suffix.lower() in (".obj", ".ply")
    )
    if not files:
        raise InputError(
            f"meshes: {folder} holds no .obj or .ply file; expected a folder of meshes"
        )
    return files


def _shade(stream: Draws, camera: Array, light: Light) -> Occluder:
    """Return a plate between the camera and a light, across the way."""
    way = light.position - camera
    length = float(np.linalg.norm(way))
    # Nearer to the camera than a directional light, and not so near to an area light that its light
    # reaches around the plate.
    distance = min(stream.between(0.31, 0.57) * length, stream.between(0.9, 1.7))
    # The plate may touch neither the camera nor the light; it is large enough to cover an area
    # light as seen from the camera, as far as there is room.
    room = min(distance, length - distance - light.ball)
    needed = 1.3 * light.ball * distance / length
    radius = max(min(stream.between(0.29, 0.53), 0.8 * room), min(needed, 0.9 * room))
    forward = way / length + 0.17 * stream.in_ball()
    axis, angle = turning(np.array([0.0, 0.0, 1.0]), forward / np.linalg.norm(forward))
    position = camera + distance * way / length
    reflectance = np.array([stream.between(0.07, 0.53) for _ in range(3)])
    # A plate within the unit ball: its half diagonal is 1.
    half = 0.69 + 0.03 * stream.fraction()
    mesh = box((2 * half, 2 * math.sqrt(1 - half**2), 2 * stream.logarithmic(0.0017, 0.031)))
    return _placed("plate", mesh, position, radius, (axis, angle), reflectance)


def _cage(stream: Draws, camera: Array, light: Light) -> Occluder:
    """Return upright bars around a light."""
    # The cage holds the whole light, and the camera stays outside of it, unless the light itself is
    # too large.
    most = float(np.linalg.norm(light.position - camera)) - _CAMERA
    radius = max(min(max(stream.between(0.13, 0.31), 2.1 * light.ball), most), 1.3 * light.ball)
    bars, thickness = stream.count(5, 13), stream.between(0.029, 0.097)
    bar = lathe([thickness, thickness], [-0.61, 0.61], 5)
    angles = 2 * np.pi * np.arange(bars) / bars
    mesh = joined(
        [placed(bar, (0.71 * np.cos(angle), 0.71 * np.sin(angle), 0.0)) for angle in angles]
    )
    reflectance = np.array([stream.between(0.07, 0.61) for _ in range(3)])
    return _placed(
        "cage",
        mesh,
        light.position,
        radius,
        (stream.vector(), stream.between(3.0, 357.0)),
        reflectance,
    )


def turning(start: Array, end: Array) -> tuple[Array, float]:
    """Return the axis and the angle [degrees] of the rotation that turns one
    unit vector into another.
    """
    axis = np.cross(start, end)
    length = float(np.linalg.norm(axis))
    if length < 1e-9:
        return np.array([1.0, 0.0, 0.0]), 0.0 if start @ end > 0 else 180.0
    return axis / length, math.degrees(math.atan2(length, float(start @ end)))


def draw_ground(
    draws: Draws,
    ranges: Ranges,
    camera: Array,
    lights: Sequence[Light],
    occluders: Sequence[Occluder],
) -> list[Occluder]:
    """Return a floor, a floor and a wall, a room around all, or nothing."""
    stream = draws.of("ground")
    kind = draws.pick(ranges["grounds"], "grounds")
    if kind == "none":
        return []
    directional = any(light.kind == "directional" for light in lights)
    if kind == "room" and directional:
        kind = "floor-and-wall"
    near = [light for light in lights if light.kind != "directional"]
    # Floor and room must not cut the camera, the lights, and the inner parts of occluders; they may
    # cut the outer parts.
    balls = [(camera, 0.13), *((light.position, light.ball + 0.07) for light in near)]
    balls += [(occluder.position, 0.31 * occluder.radius) for occluder in occluders]
    if kind == "room":
        return [_room(stream, balls)]
    tilt = stream.vector() * stream.between(0.01, 0.11) + np.array([0.0, 0.0, 1.0])
    normal = tilt / np.linalg.norm(tilt)
    ground = [_plane(stream, "floor", normal, balls)]
    if kind == "floor-and-wall":
        # The wall faces the camera: its normal leans towards it, with some randomness.
        toward = camera * np.array([1.0, 1.0, 0.0]) + 0.6 * np.linalg.norm(
            camera
        ) * stream.vector() * [1.0, 1.0, 0.07]
        if directional:
            # It must not stand between a light from infinity and the stage.
            ways = np.array([light.position / np.linalg.norm(light.position) for light in lights])
            toward += 0.6 * ways.sum(axis=0) * [1, 1, 0]
        ground.append(_plane(stream, "wall", toward / np.linalg.norm(toward), balls))
    return ground


def _plane(
    stream: Draws, kind: str, normal: Array, balls: Sequence[tuple[Array, float]]
) -> Occluder:
    """Return a rectangle below all balls as its normal has it."""
    # Below all balls along its normal, and wide enough to reach beyond all of them.
    lowest = min(float(position @ normal) - radius for position, radius in balls)
    lowest = min(lowest, -0.43) - stream.between(0.003, 0.11)
    extent = 1.3 + max(float(np.linalg.norm(position)) + radius for position, radius in balls)
    turn = turning(np.array([0.0, 0.0, 1.0]), normal)
    reflectance = np.array([stream.between(0.11, 0.71) for _ in range(3)])
    half = stream.between(0.71, 1.0), stream.between(0.71, 1.0)
    return _placed(kind, _rectangle(half), lowest * normal, extent, turn, reflectance)


def _room(stream: Draws, balls: Sequence[tuple[Array, float]]) -> Occluder:
    """Return a closed room, seen from inside, around all balls; its floor is level
    except for a few degrees.
    """
    low = np.min([position - radius for position, radius in balls], axis=0) - stream.between(
        0.11, 0.31
    )
    high = np.max([position + radius for position, radius in balls], axis=0) + stream.between(
        0.11, 0.31
    )
    # Wider than the box of all balls by 13 %, since the room is turned by a few degrees.
    half = 0.5 * (high - low) * 1.13
    radius = float(np.linalg.norm(half))
    axis = stream.vector()
    reflectance = np.array([stream.between(0.11, 0.61) for _ in range(3)])
    vertices, faces = box(2 * half / radius)
    turn = axis, stream.between(0.3, 2.3)
    # Reversed faces: the room is seen from inside.
    return _placed(
        "room", (vertices, faces[:, ::-1]), 0.5 * (low + high), radius, turn, reflectance
    )


def _user_mesh(path: Path) -> Mesh:
    """Return a mesh of the user's, moved and scaled to the unit ball."""
    try:
        shape = mi.load_dict({"type": path.suffix.lower()[1:], "filename": str(path)})
    except Exception as error:  # Mitsuba raises RuntimeError for all bad input
        raise InputError(
            f"meshes: Mitsuba cannot read {path}: {' '.join(str(error).split())}"
        ) from error
    vertices, faces = mesh_triangles(shape)
    if not len(faces) or not np.isfinite(vertices).all():
        raise InputError(
            f"meshes: {path} has no triangles or numbers that are not finite; expected a mesh"
        )
    # The middle of the bounding box of the vertices that faces use; the farthest vertex is at the
    # distance 1.
    used = vertices[np.unique(faces)]
    middle = 0.5 * (used.min(axis=0) + used.max(axis=0))
    size = float(np.linalg.norm(used - middle, axis=1).max())
    return (vertices - middle) / size, faces
