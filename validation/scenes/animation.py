# SPDX-License-Identifier: BSD-3-Clause
"""Animations: what moves in the frames of a scene, and how.

The frames make one turn, so that the last one leads on to the first:

* `light`: every light circles about a vertical axis, and the axis of a spot turns with it. Vertical
  is the axis of coordinates nearest to the camera's up.
* `objects`: every object turns about the vertical through its own middle.
* `medium`: the extinction is multiplied by 1 + sin(turn) / 2, between half and one
  and a half times its value.
* `colour`: the intensities of red, green and blue rotate among the channels; their sum stays.

The frame renderer recomputes only what moves (`moved_parts`, `realtime.frame.incremental`) and
reuses the kernels of the first frame.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from airlight.errors import InputError
from airlight.realtime.area_lights.shape import turned_area_light
from airlight.realtime.scene.animate import (
    Objects,
    closed_shapes,
    coloured_area_light,
    coloured_light,
    read_objects,
    thicker_medium,
    turned_light,
    turned_objects,
    with_area_lights,
)
from airlight.realtime.scene.media.medium import Homogeneous
from airlight.realtime.scene.mesh_adjacency import read_occluders
from airlight.realtime.scene.read_scene import Scene
from airlight.validation.arrays import Array
from airlight.validation.scenes.meshes import rotation
from airlight.validation.scenes.registry import MOVES, Animation


def parse_moves(text: str) -> tuple[str, ...]:
    """Return the parts that move, from words separated by commas such as 'light,colour'."""
    moves = tuple(dict.fromkeys(word.strip() for word in text.split(",")))
    for move in moves:
        if move not in MOVES:
            raise InputError(
                f"--animate: got {move!r}, expected some of {', '.join(MOVES)}, separated by commas"
            )
    return moves


def moved_parts(animation: Animation) -> dict[str, bool]:
    """Return the differences between a frame and the last, as keywords of
    `realtime.frame.incremental.next_frame`.
    """
    return {
        "camera_moved": False,
        "geometry_moved": "objects" in animation.moves,
        "light_moved": "light" in animation.moves,
    }


def animate(scene: Scene, animation: Animation, frames: int) -> Iterator[Scene]:
    """Yield the scene of every frame, one turn in all; the first is the scene as it was read.

    A yielded scene is valid only until the next one is asked for: all of them share one Mitsuba
    scene, in which the objects move.
    """
    if frames < 1:
        raise InputError(f"frames: got {frames}, expected at least 1")
    step = _step(scene, animation)
    for number in range(frames):
        yield step(number / frames)


def frame_changes(moved: Scene, animation: Animation) -> dict[str, tuple[float, ...]] | None:
    """Return the changes of a frame in its scene, by the names of `validation.scenes.changes`.

    None where there is no name for a change: area lights, media that are not the same everywhere.
    """
    moves = set(animation.moves)
    homogeneous = moved.medium if isinstance(moved.medium, Homogeneous) else None
    if moved.area_lights or ("medium" in moves and homogeneous is None):
        return None
    # The names follow `validation.scenes.changes`: the first light has no number, the second is
    # `light-2`. A light at a place (w = 1) has a position and an intensity, a light at infinity an
    # irradiance; spots and directional lights have an axis.
    changes: dict[str, Sequence[float]] = {}
    for number, light in enumerate(moved.lights, 1):
        prefix = "light" if number == 1 else f"light-{number}"
        if "light" in moves:
            changes |= {f"{prefix}.position": light.position} if light.w else {}
            changes |= {} if light.exact_axis is None else {f"{prefix}.direction": light.exact_axis}
        if "colour" in moves:
            changes[f"{prefix}.{'intensity' if light.w else 'irradiance'}"] = light.intensity
    if homogeneous is not None and "medium" in moves:
        # One value a channel: the extinction of each channel is an array of one element.
        changes["medium.sigma_t"] = [float(channel[0]) for channel in homogeneous.sigma_t]
    return {
        name: tuple(np.array(value, dtype=np.float64).ravel().tolist())
        for name, value in changes.items()
    }


def frame_objects(
    scene: Scene, animation: Animation, frames: int
) -> dict[str, tuple[tuple[tuple[float, ...], ...], ...]]:
    """Return by shape a matrix for each frame, (4, 4) [m], from the place in the scene to the
    place in the frame.
    """
    objects = _objects(scene, animation)
    matrices = {}
    for name, about in {} if objects is None else objects.middles.items():
        # A turn R about the point m is x -> R x + (m - R m): rotation block first, then the
        # translation that keeps m where it is.
        turns = np.tile(np.eye(4), (frames, 1, 1))
        turns[:, :3, :3] = [_turn(scene, number / frames) for number in range(frames)]
        turns[:, :3, 3] = about - turns[:, :3, :3] @ about
        matrices[name] = tuple(tuple(map(tuple, matrix)) for matrix in turns.tolist())
    return matrices


def _objects(scene: Scene, animation: Animation) -> Objects | None:
    if "objects" not in animation.moves:
        return None
    lamps = {light.name for light in scene.area_lights}
    # Where no names are given all closed meshes turn, except the shapes of area lights, which
    # follow their lights.
    closed = closed_shapes(read_occluders(scene.geometry, scene.area_lights))
    names = animation.objects or tuple(name for name in closed if name not in lamps)
    if not names:
        raise InputError(
            "--animate objects: the scene has no closed mesh that could turn; animate the light"
        )
    return read_objects(scene, names)


def _turn(scene: Scene, fraction: float) -> Array:
    """Return the rotation about the vertical by a fraction of a turn, (3, 3)."""
    return rotation(vertical(scene).tolist(), 360 * fraction) if fraction else np.eye(3)


def _step(scene: Scene, animation: Animation) -> Callable[[float], Scene]:
    """Return a function from a fraction of the turn, 0 to 1, to the scene after it."""
    # The axis and the objects are the same in all frames and are found once.
    about = np.array(animation.about) if animation.about else middle(scene)
    objects = _objects(scene, animation)

    def after(fraction: float) -> Scene:
        turn = _turn(scene, fraction)
        # Each part starts from the scene as it was read, so that frames do not accumulate rounding.
        lights, area_lights, medium = scene.lights, scene.area_lights, scene.medium
        if "light" in animation.moves:
            lights = tuple(turned_light(light, about, turn) for light in lights)
            area_lights = tuple(turned_area_light(light, about, turn) for light in area_lights)
        if "colour" in animation.moves:
            lights = tuple(coloured_light(light, fraction) for light in lights)
            area_lights = tuple(coloured_area_light(light, fraction) for light in area_lights)
        if "medium" in animation.moves:
            # Between half and one and a half times the extinction of the scene.
            medium = thicker_medium(medium, 1 + 0.5 * np.sin(2 * np.pi * fraction))
        moved = replace(scene, lights=lights, medium=medium)
        # Objects and the shapes of opaque area lights move in the one Mitsuba scene.
        moved = turned_objects(moved, objects, turn) if objects else moved
        return with_area_lights(moved, area_lights)

    return after


def vertical(scene: Scene) -> Array:
    """Return the axis of coordinates nearest to the camera's up, a unit vector (3,)."""
    up = np.array(scene.camera.up, dtype=np.float64).ravel()
    axis = np.zeros(3)
    largest = int(np.argmax(np.abs(up)))
    axis[largest] = np.sign(up[largest])
    return axis


def middle(scene: Scene) -> Array:
    """Return the middle of the bounding box of all shapes, (3,) [m].

    Without shapes it is the point on the camera's axis that is closest to the first light.
    """
    light = (
        np.array(scene.lights[0].position).ravel() if scene.lights else scene.area_lights[0].middle
    )
    if scene.geometry.shapes():
        box = scene.geometry.bbox()
        return 0.5 * (
            np.array(box.min, dtype=np.float64).ravel()
            + np.array(box.max, dtype=np.float64).ravel()
        )
    # Without shapes there is no box: the foot of the perpendicular from the first light to the
    # camera's axis is in view and at the depth of the light.
    origin, forward = (
        np.array(vector, dtype=np.float64).ravel()
        for vector in (scene.camera.origin, scene.camera.forward)
    )
    return origin + forward * (forward @ (light - origin)) / (forward @ forward)
