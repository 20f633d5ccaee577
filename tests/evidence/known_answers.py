# SPDX-License-Identifier: BSD-3-Clause
"""Scenes on which laws of airlight are tried, as dictionaries for Mitsuba, and what the laws
do to such dictionaries.

`{"matrix": rows}` stands for a transform. Scale factors are powers of two and coordinates multiples
of 1/1024, so that float32 scenes obey the laws exactly, too. No occluder is a sphere: these are met
in float32.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from airlight.reference.monte_carlo.single_scatter.integrator import single_scatter_batch
from airlight.reference.monte_carlo.volpath import volpath_batch
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.quadrature.replicates import PointPlan
from airlight.reference.scene.read import ReferenceScene, read_reference
from tests.evidence.certified.model import (
    FogBox,
    FogScene,
    FogScreen,
    fog_scenes,
    load_fog,
    mitsuba_dict,
)

Scene = dict[str, Any]

PLAN = PointPlan(error=0.0, first=16, most=16)  # points enough for a law, which holds for any
# the axes change places
TURN = np.array([[0.0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
# centre, half edges of the fog under the sun
BOX = np.array([0.125, 0.25, 1.0]), np.array([1.0, 0.75, 0.875])
G = 0.375  # of that fog
_BLACK = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
_EMITTERS = ("point", "spot", "directional")
_POWERS = ("intensity", "irradiance", "radiance")
_SAMPLES = 32


@cache
def fog_scene() -> FogScene:
    """Return a box on a floor, under a point light and a soft spot."""
    scenes = {scene.name: scene for scene in fog_scenes()}
    lights = (*scenes["box-floor"].lights, scenes["soft-spot"].lights[0])
    return replace(scenes["box-floor"], lights=lights, sigma_t=(0.1875, 0.25, 0.375))


def lamps() -> Scene:
    """Return `fog_scene` as a dictionary."""
    return mitsuba_dict(fog_scene())


def panel(kind: str = "rectangle") -> Scene:
    """Return the box on the floor under an area light, its disk or
    sphere of the same first side.
    """
    lamp = np.eye(4)
    # The third axis looks down and inwards; all numbers are multiples of 1/16.
    sides = [0.5, 0.25 if kind == "rectangle" else 0.5, 1.0]
    lamp[:3, :3] = np.array([[0.0, 0.6, -0.8], [1.0, 0.0, 0.0], [0.0, -0.8, -0.6]]) * sides
    lamp[:3, 3] = 1.375, 0.375, 2.25
    emitter = {"type": "area", "radiance": rgb(4.0, 3.0, 2.0)}
    entry = {
        "type": kind,
        "to_world": {"matrix": lamp.tolist()},
        "bsdf": _BLACK,
        "emitter": emitter,
    }
    return mitsuba_dict(replace(fog_scene(), lights=())) | {"lamp": entry}


def sun() -> Scene:
    """Return a slab that shadows a box of fog under a directional light, and a camera outside."""
    away = np.array(
        [
            [0.48, 0.6, 0.64, 0.0],
            [-0.36, 0.8, -0.48, 0.0],
            [-0.8, 0.0, 0.6, 0.0],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    mist = {
        "type": "homogeneous",
        "sigma_t": rgb(0.375, 0.5, 0.75),
        "scale": 1.0,
        "albedo": rgb(0.75, 0.5, 0.25),
        "phase": {"type": "hg", "g": G},
    }
    return {
        "type": "scene",
        "sensor": {
            "type": "perspective",
            "fov": 40.0,
            "fov_axis": "x",
            "near_clip": 0.0001,
            # Along +y from before the box: columns left, up, forward, position.
            "to_world": {
                "matrix": [[-1.0, 0, 0, 0.25], [0, 0, 1, -3.5], [0, 1, 0, 1.125], [0, 0, 0, 1]]
            },
            "film": {"type": "hdrfilm", "width": 12, "height": 12, "rfilter": {"type": "box"}},
        },
        "sun": {
            "type": "directional",
            "to_world": {"matrix": (away @ np.diag([1.0, -1, -1, 1])).tolist()},
            "irradiance": rgb(8.0, 6.0, 4.0),
        },
        "body": cube(*BOX) | {"bsdf": {"type": "null"}, "interior": mist},
        "slab": cube([1.0, -0.5, 2.25], [0.5, 0.375, 0.0625]) | {"bsdf": {"type": "diffuse"}},
    }


SCENES: dict[str, Callable[[], Scene]] = {"lamps": lamps, "sun": sun, "panel": panel}


def rgb(*values: float) -> Scene:
    return {"type": "rgb", "value": list(values)}


def cube(centre, half_edges) -> Scene:
    matrix = np.diag([*(float(value) for value in half_edges), 1.0])
    matrix[:3, 3] = centre
    return {"type": "cube", "to_world": {"matrix": matrix.tolist()}}


def changed(entry: Any, names: tuple[str, ...], change: Callable[[Any], Any]) -> Any:
    """Return a dictionary in which all entries of some names are changed, however deep."""
    if not isinstance(entry, dict):
        return entry
    return {
        name: change(value) if name in names else changed(value, names, change)
        for name, value in entry.items()
    }


def brighter(scene: Scene, factor: float) -> Scene:
    """Multiply what all lights send."""
    return changed(
        scene, _POWERS, lambda colour: rgb(*(factor * value for value in colour["value"]))
    )


def darker(scene: Scene, factor: float) -> Scene:
    """Multiply the albedo."""
    return changed(
        scene, ("albedo",), lambda colour: rgb(*(factor * value for value in colour["value"]))
    )


def mapped(scene: Scene, matrix: np.ndarray) -> Scene:
    """Apply a similarity to everything; cameras and lights stay rotations,
    with a left that stays left.
    """

    def placed(entry: Any) -> Any:
        if not isinstance(entry, dict):
            return entry
        entry = {name: placed(value) for name, value in entry.items()}
        if "position" in entry:
            entry["position"] = (matrix[:3, :3] @ entry["position"] + matrix[:3, 3]).tolist()
        if "to_world" in entry:
            moved = matrix @ np.array(entry["to_world"]["matrix"])
            if entry["type"] in ("perspective", *_EMITTERS):
                size = np.linalg.det(matrix[:3, :3])
                moved[:3, :3] /= np.cbrt(abs(size))
                moved[:3, 0] *= np.sign(size)
            entry["to_world"] = {"matrix": moved.tolist()}
        return entry

    return placed(scene)


def in_units(scene: Scene, k: float) -> Scene:
    """Measure lengths in units k times as short."""
    return changed(mapped(scene, np.diag([k, k, k, 1.0])), ("scale",), lambda scale: scale / k)


def one_light_each(scene: Scene) -> list[Scene]:
    """Return the scene with one of its lights at a time."""
    lights = [
        name
        for name, entry in scene.items()
        if isinstance(entry, dict) and entry["type"] in _EMITTERS
    ]
    return [
        {name: entry for name, entry in scene.items() if name not in lights or name == one}
        for one in lights
    ]


def enclosed(name: str) -> Scene:
    """Return `lamps` with its light in a closed box, or `sun` in one."""
    if name == "sun":
        return sun() | {
            "shell": cube([0.0, 0.0, 0.0], [16.0, 16.0, 16.0]) | {"bsdf": {"type": "diffuse"}}
        }
    light = replace(fog_scene().lights[0], position=(0.125, 0.25, 1.0))
    box = FogBox(
        (0.125, 0.25, 1.0), ((0.25, 0.0625, 0.0), (-0.0625, 0.25, 0.03125), (0.0, 0.0, 0.25))
    )
    return white(mitsuba_dict(replace(fog_scene(), lights=(light,), occluders=(floor(), box))))


def floor() -> FogScreen:
    (found,) = [shape for shape in fog_scene().occluders if isinstance(shape, FogScreen)]
    return found


def white(scene: Scene) -> Scene:
    """Return a dictionary whose occluders reflect half of the light."""
    half = {"type": "diffuse", "reflectance": rgb(0.5, 0.5, 0.5)}
    return {
        name: entry | {"bsdf": half} if name.startswith("occluder") else entry
        for name, entry in scene.items()
    }


def reference_of(scene: Scene | FogScene) -> ReferenceScene:
    return read_reference(load_fog(mitsuba_dict(scene) if isinstance(scene, FogScene) else scene))


def layers(reference: ReferenceScene, estimator: str = "quadrature") -> np.ndarray:
    """Return airlight and surface by an estimator, (2, pixels, 3) [W/(m^2 sr)]."""
    if estimator == "quadrature":
        image = quadrature_image(reference, plan=PLAN)
        return np.stack([image.airlight, image.surface]).reshape(2, -1, 3)
    batch = single_scatter_batch if estimator == "single-scatter" else volpath_batch
    return batch(reference, 1, _SAMPLES).mean


def airlight(scene: Scene, estimator: str = "quadrature") -> np.ndarray:
    return layers(reference_of(scene), estimator)[0]


def difference(computed: np.ndarray, expected: np.ndarray) -> float:
    """Return the largest difference of two images over the largest value of the second."""
    return float(np.abs(computed - expected).max() / np.abs(expected).max())
