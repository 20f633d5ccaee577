# SPDX-License-Identifier: BSD-3-Clause
"""The parts of a certified fog scene, how Mitsuba reads it, and the twelve scenes of the file.

Every number is exact in float32, so that renderers in single precision render the very scene that
was certified: coordinates are multiples of 1/1024 m, which makes the corners of boxes exact as
well. Rotations cannot be exact; the matrices of cameras and spots are those of the file, and count
as given. Occluders are black, hence all light in an image is airlight.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np

from airlight.validation.certified.files import certified_data

Point = tuple[float, ...]  # of 3 numbers
Matrix = tuple[tuple[float, ...], ...]  # 4 rows of 4

SIZE = 8  #: pixels along each side of an image
_BLACK = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.0, 0.0, 0.0]}}


@dataclass(frozen=True)
class FogSphere:
    """A sphere."""

    centre: Point  #: [m]
    radius: float  #: [m]


@dataclass(frozen=True)
class FogBox:
    """A parallelepiped: centre + a u + b v + c w with -1 <= a, b, c <= 1."""

    centre: Point  #: [m]
    half_edges: tuple[Point, Point, Point]  #: u, v, w [m]


@dataclass(frozen=True)
class FogScreen:
    """A flat parallelogram without thickness: centre + a u + b v with -1 <= a, b <= 1."""

    centre: Point  #: [m]
    half_edges: tuple[Point, Point]  #: u, v [m]


@dataclass(frozen=True)
class FogLight:
    """A point light, or a spot where it has a matrix."""

    position: Point  #: [m]
    intensity: Point  #: on the axis, RGB [W/sr]
    matrix: Matrix | None = None  #: of a spot, light to world; its third column is the axis
    cutoff: float = 180.0  #: of a spot: half angle of the cone [degrees]
    #: of a spot: half angle of full intensity [degrees]; linear in the angle up to the cut-off
    beam: float = 180.0


@dataclass(frozen=True)
class FogScene:
    """One certified scene."""

    name: str
    words: str
    camera: Matrix  #: camera to world: columns left, up, forward, position
    fov: float  #: horizontal and vertical [degrees]
    sigma_t: Point  #: RGB [1/m]
    albedo: Point  #: RGB
    phase: str  #: 'isotropic', 'hg' or 'rayleigh'
    g: float  #: mean cosine of 'hg'
    lights: tuple[FogLight, ...]
    occluders: tuple[FogSphere | FogBox | FogScreen, ...] = ()


def fog_scenes() -> tuple[FogScene, ...]:
    """Return the scenes of the file, each with what it is for."""
    return tuple(_scene(given) for given in json.loads(certified_data().read_text())["scenes"])


def _scene(given: dict[str, Any]) -> FogScene:
    mitsuba, medium = given["mitsuba"], given["medium"]
    lights = []
    for number, light in enumerate(given["lights"]):
        cone = {}
        if light["type"] == "spot":
            matrix = _tuples(mitsuba[f"light{number}"]["to_world"]["matrix"])
            cone = {"matrix": matrix, "cutoff": light["cutoff"], "beam": light["beam"]}
        lights.append(FogLight(_tuples(light["position"]), _tuples(light["intensity"]), **cone))
    kinds = {"sphere": FogSphere, "box": FogBox, "screen": FogScreen}
    shapes = [
        {name: _tuples(value) for name, value in shape.items()} for shape in given["occluders"]
    ]
    return FogScene(
        given["name"],
        given["words"],
        camera=_tuples(mitsuba["sensor"]["to_world"]["matrix"]),
        fov=mitsuba["sensor"]["fov"],
        sigma_t=_tuples(medium["sigma_t"]),
        albedo=_tuples(medium["albedo"]),
        phase=medium["phase"],
        g=medium.get("g", 0.0),
        lights=tuple(lights),
        occluders=tuple(kinds[shape.pop("type")](**shape) for shape in shapes),
    )


def _tuples(value: Any) -> Any:
    return tuple(map(_tuples, value)) if isinstance(value, list) else value


def mitsuba_dict(scene: FogScene) -> dict[str, Any]:
    """Return a scene for `mi.load_dict` as plain JSON; each ``{"matrix":
    rows}`` stands for a transform.

    Mitsuba takes colours above 1 for lights alone, so the extinction comes as a colour and a
    power of 4 that scales it.
    """
    scale = 1.0
    while max(scene.sigma_t) > scale:
        scale *= 4
    phase: dict[str, Any] = {"type": scene.phase} | ({"g": scene.g} if scene.phase == "hg" else {})
    entries: dict[str, Any] = {
        "type": "scene",
        "fog": {
            "type": "homogeneous",
            "id": "fog",
            "sigma_t": {"type": "rgb", "value": [value / scale for value in scene.sigma_t]},
            "scale": scale,
            "albedo": {"type": "rgb", "value": list(scene.albedo)},
            "phase": phase,
        },
        "sensor": {
            "type": "perspective",
            "fov": scene.fov,
            "fov_axis": "x",
            "near_clip": 0.0001,
            "to_world": _transform(scene.camera),
            "medium": {"type": "ref", "id": "fog"},
            "film": {"type": "hdrfilm", "width": SIZE, "height": SIZE, "rfilter": {"type": "box"}},
        },
    }
    entries |= {f"light{number}": _light_dict(light) for number, light in enumerate(scene.lights)}
    return entries | {
        f"occluder{number}": _shape_dict(shape) for number, shape in enumerate(scene.occluders)
    }


def load_fog(scene: dict[str, Any]) -> Any:
    """Return the `mi.Scene` of a dictionary of `mitsuba_dict`, its matrices made
    transforms; entries may be changed.
    """

    def converted(value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        if set(value) == {"matrix"}:
            return mi.ScalarTransform4f(np.array(value["matrix"]))
        return {name: converted(entry) for name, entry in value.items()}

    return mi.load_dict(converted(scene))


def _light_dict(light: FogLight) -> dict[str, Any]:
    intensity = {"type": "rgb", "value": list(light.intensity)}
    if light.matrix is None:
        return {"type": "point", "position": list(light.position), "intensity": intensity}
    angles = {"cutoff_angle": light.cutoff, "beam_width": light.beam}
    return {"type": "spot", "to_world": _transform(light.matrix), "intensity": intensity} | angles


def _shape_dict(shape: FogSphere | FogBox | FogScreen) -> dict[str, Any]:
    if isinstance(shape, FogSphere):
        return {
            "type": "sphere",
            "center": list(shape.centre),
            "radius": shape.radius,
            "bsdf": _BLACK,
        }
    columns = [*shape.half_edges, shape.centre]
    if isinstance(shape, FogScreen):
        normal = unit(np.cross(*shape.half_edges).tolist())
        columns.insert(2, tuple(float(np.float32(value)) for value in normal))
    rows = [[column[axis] for column in columns] for axis in range(3)]
    kind = "cube" if isinstance(shape, FogBox) else "rectangle"
    return {"type": kind, "to_world": _transform([*rows, [0.0, 0.0, 0.0, 1.0]]), "bsdf": _BLACK}


def _transform(rows: Sequence[Sequence[float]]) -> dict[str, Any]:
    return {"matrix": [list(row) for row in rows]}


def unit(vector: Sequence[float]) -> list[float]:
    """Return the vector, (3,) in any unit, scaled to length 1 [1]."""
    length = math.sqrt(sum(value * value for value in vector))
    return [value / length for value in vector]
