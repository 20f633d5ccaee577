# SPDX-License-Identifier: BSD-3-Clause
"""Changed scenes whose frames are related: what somebody's renderer, or a method of ours, renders
for `airlight check`.

A scene with several lights is checked with all of them, but for *depths-multiply*: what two lamps
send to a surface is a sum of exponentials, and no exponential. *bounds* needs a scene without fog
around the camera, as no body of fog may lie in another. Exposure and a furnace belong to a
renderer's own settings, which no scene has.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import mitsuba as mi
import numpy as np

from airlight.validation.check import changes
from airlight.validation.check.changes import Description
from airlight.validation.check.check_file import Asked, Camera
from airlight.validation.scenes.meshes import rotation

_TURN = 0.2  # of the field of view, by which *pan* turns the camera
_MOVE = (3.7, -2.9, 1.3)  # [m]: no round number, along all axes
_THIN = (32, 64, 128)  # parts of the density: built-in scenes have depths of ten
_ASIDE = (320.0, 331.0)  # behind the camera, where a body of fog is out of sight [m]
#: Camera and spot of *reciprocity*: unequal depths, each outside of the other's cone.
_PLACES = ((0.0, 0.0, 0.0), (2.2, 2.6, 0.4))
_TOWARDS = ((0.25, 1.0, 0.05), (-1.0, 0.35, -0.1))
_CONES, _FOV, _SIGMA_T = (25.0, 34.0), 72.0, 0.5  # half angles and width [degrees], [1/m]
_SQUARE = 128  # pixels on a side of its images, whose sums err by a hundredth


@dataclass(frozen=True)
class Variants:
    """The changed scenes of a check, and how their frames are related."""

    scenes: dict[str, Callable[[], Description]]  #: by the name of the frame
    asked: tuple[Asked, ...]
    again: tuple[str, str]


def variants(scene: str, size: tuple[int, int], falloff: str = "linear") -> Variants:
    """Return the changed scenes of a built-in scene, with images of a size [pixels]; spots of the
    renderer have a `falloff` to the edge of their cones.

    Raises InputError for another scene.
    """
    whole = partial(changes.description, scene, size)
    plain = whole()
    names = changes.lights(plain)
    scenes: dict[str, Callable[[], Description]] = {"base": whole, "again": whole}
    asked: list[Asked] = []

    def relate(name: str, *frames: str, cameras: tuple[Camera, ...] = ()) -> None:
        asked.append(Asked(name, frames, cameras=cameras))

    def changed(change: Callable[..., Description], *values: object) -> Callable[[], Description]:
        return lambda: change(whole(), *values)

    # Lights: twice as bright, in two halves, with one that is black.
    scenes["twice"] = changed(changes.brighter, 2.0)
    relate("intensity", "base", "twice")
    more = {"another": changes.another_light(plain)}
    if len(names) > 1:
        half = len(names) // 2
        scenes["first"] = changed(changes.only, names[:half])
        scenes["second"] = changed(changes.only, names[half:])
        relate("sum", "first", "second", "base")
    else:
        scenes["both"] = lambda: whole() | more
        scenes["second"] = lambda: changes.only(whole() | more, ["another"])
        relate("sum", "base", "second", "both")
    scenes["black"] = lambda: whole() | {"another": changes.dark(more["another"])}
    relate("black-light", "base", "black")
    scenes["permuted"] = changed(changes.permuted, (1, 2, 0))
    relate("colours", "base", "permuted")
    # Place and length.
    scenes["doubled"] = changed(changes.larger, 2.0)
    relate("units", "base", "doubled")
    turn = np.eye(4)
    turn[:3, :3], turn[:3, 3] = rotation((0, 0, 1), 90.0), _MOVE
    scenes["moved"] = changed(changes.moved, turn)
    relate("moved", "base", "moved")
    # The same rays in other pixels.
    angle = _TURN * float(plain["sensor"]["fov"])
    scenes["panned"] = changed(changes.turned, angle)
    relate(
        "pan", "base", "panned", cameras=(camera_of(plain), camera_of(changes.turned(plain, angle)))
    )
    scenes["large"] = partial(changes.description, scene, (2 * size[0], 2 * size[1]))
    relate("size", "base", "large")
    # The medium: elsewhere, thinner, paler.
    if "medium" not in plain["sensor"]:
        scenes |= {f"body-{place:g}": changed(changes.with_body, place) for place in _ASIDE}
        relate("bounds", *(f"body-{place:g}" for place in _ASIDE))
    for part in _THIN:
        scenes[f"thin-{part}"] = changed(changes.denser, 1 / part)
    relate("thin", *(f"thin-{part}" for part in _THIN))
    if len(names) == 1 and "emitter" not in plain[names[0]]:
        scenes |= {"clearer": changed(changes.denser, 0.5), "denser": changed(changes.denser, 1.5)}
        relate("depths-multiply", "clearer", "base", "denser")
    scenes["pale"] = changed(changes.paler, 0.5)
    relate("albedo", "pale", "base")
    # Camera and spot in a scene of their own.
    scenes |= {"seen": partial(camera_and_spot, False), "swapped": partial(camera_and_spot, True)}
    cameras = tuple(
        camera_of(camera_and_spot(swapped), _CONES[swapped], falloff) for swapped in (False, True)
    )
    relate("reciprocity", "seen", "swapped", cameras=cameras)
    return Variants(scenes, tuple(asked), ("base", "again"))


def camera_of(
    scene: Description, cone: float | None = None, falloff: str = "cosine-squared"
) -> Camera:
    """Return where the camera of a description looks; `falloff`: its own within a cone."""
    axes = np.array(scene["sensor"]["to_world"].matrix, dtype=np.float64)[:3]
    forward, up = (axes[:, column] / np.linalg.norm(axes[:, column]) for column in (2, 1))
    return Camera(
        float(scene["sensor"]["fov"]),
        tuple(forward.tolist()),
        tuple(up.tolist()),
        cone,
        falloff,
    )


def camera_and_spot(swapped: bool) -> Description:
    """Return a spot in fog and a camera beside it, or each in the place of the other."""
    here, there = (1, 0) if swapped else (0, 1)

    def looking(number: int) -> "mi.ScalarTransform4f":
        place = np.array(_PLACES[number])
        return mi.ScalarTransform4f().look_at(
            place.tolist(), (place + _TOWARDS[number]).tolist(), [0, 0, 1]
        )

    fog = {"type": "homogeneous", "id": "fog", "sigma_t": _SIGMA_T, "albedo": 0.9}
    film = {"type": "hdrfilm", "width": _SQUARE, "height": _SQUARE, "rfilter": {"type": "box"}}
    return {
        "type": "scene",
        "fog": fog,
        "sensor": {
            "type": "perspective",
            "fov": _FOV,
            "fov_axis": "x",
            "to_world": looking(here),
            "medium": {"type": "ref", "id": "fog"},
            "film": film,
        },
        "spot": {
            "type": "spot",
            "to_world": looking(there),
            "cutoff_angle": _CONES[there],
            "beam_width": 0.0,
            "intensity": {"type": "rgb", "value": [3.0, 2.0, 1.0]},
        },
    }
