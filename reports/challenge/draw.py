# SPDX-License-Identifier: BSD-3-Clause
"""A seed to the scenes of a challenge: eight of each of three kinds.

`random`: stages of `validation.scenes.random` in homogeneous fog. `certified`: eight of the nine
certified scenes with occluders, whose rays are known to 12 digits, with a camera and an extinction
that nobody has seen. `engine`: stages in height fog that parameters of an engine say, two each of
four engines.

Scenes have what most methods can have, as others count as black images: fog around the camera, points,
spots and suns, triangles. A stage is drawn again where light reaches too little of the view or
nearly all of it, which a method without shadows would have exactly, and where triangles times
lights exceed `_MOST`, so that its reference takes seconds.
"""

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np

from airlight.reference.quadrature.reference import reference_of
from airlight.reference.storage.files import temporary_folder, write_bytes
from airlight.reports.challenge.seed import EACH, FORMAT, KINDS, SIZE
from airlight.reports.interchange.mitsuba_xml import ply_bytes, scene_xml
from airlight.validation.certified.files import certified_data
from airlight.validation.scenes.engine_fog import ENGINES, parameters_of
from airlight.validation.scenes.loading import LoadedScene, load_scene
from airlight.validation.scenes.meshes import Mesh, box, grid, icosphere, placed, scaled
from airlight.validation.scenes.parts import (
    Plugin,
    camera,
    fog,
    light,
    mitsuba_mesh,
    phase_function,
)
from airlight.validation.scenes.random.design import Draws, Ranges, ranges_from
from airlight.validation.scenes.random.lights import Light
from airlight.validation.scenes.random.media import Medium
from airlight.validation.scenes.random.occluders import Occluder
from airlight.validation.scenes.random.scene import RandomScene, draw_scene, with_reach

_FOGS = ("unreal", "flax", "hdrp", "playcanvas")  # two scenes each
_MOST = 5000  # triangles times lights, about 3 s of a reference at 160 x 120
_LIT = 0.9  # at most, of the points in view: the others are in the shadow of all lights
_ABOVE = 0.1  # sine of the least elevation of a sun, 6 degrees: below 0 no light of it arrives
_OPAQUE = 8.0  # optical depth, exp(-8) = 3e-4: a view that is deeper shows nothing
_POINTS = 10_000  # of the design; another number would draw other scenes for every seed

#: Ranges that differ from those of `ranges.toml`: no bounds, areas, spheres and tabulated phase
#: functions, which would keep out most engines, and no view that is vacuum or black to the eye.
_STAGES: dict[str, object] = {
    "media": {"unbounded": 1},
    "light_kinds": {"point": 4, "spot": 3},
    "phases": {"isotropic": 3, "hg": 5, "rayleigh": 2},
    "spheres": {"no": 1},
    "lights": [1, 3],
    "occluders": [1, 12],
    "optical_depth": [0.03, 5.0],
    "g": [-0.31, 0.83],
    "scale": [0.9, 31.0],
}
#: A sun has no path through fog without bounds: for height fog, lights are drawn beside a bounded
#: medium, which the fog replaces.
_SUNLIT: dict[str, object] = _STAGES | {
    "media": {"bounded": 1},
    "bounded_media": [1, 1],
    "light_kinds": {"point": 2, "spot": 2, "directional": 3},
}


@dataclass(frozen=True)
class DrawnScene:
    """A scene of a challenge."""

    name: str
    kind: str  #: of `KINDS`
    purpose: str  #: one sentence: what was drawn
    files: Mapping[str, bytes]  #: the Mitsuba file, NAME.xml, and the meshes that it names

    @property
    def file(self) -> str:
        """The name of the Mitsuba file."""
        return f"{self.name}.xml"


def draw_scenes(seed: str) -> tuple[DrawnScene, ...]:
    """Return the scenes of a seed, the same on every machine; needs an active Mitsuba variant."""
    digest = hashlib.sha256(f"{FORMAT} {seed}".encode()).digest()
    number = int.from_bytes(digest[:8], "big")
    # The certified scenes of this seed: the first eight with occluders in a drawn order.
    scenes = json.loads(certified_data().read_text(encoding="utf-8"))["scenes"]
    certified = [scene for scene in scenes if scene["occluders"]]
    order = Draws(number, part="order")
    ranked = sorted((order.fraction(), at) for at in range(len(certified)))
    chosen = [certified[at] for _, at in ranked[:EACH]]
    makers: dict[str, Callable[[int, Draws], tuple[RandomScene, Plugin, str]]] = {
        "random": lambda at, draws: _random(draws),
        "certified": lambda at, draws: _certified(chosen[at], draws),
        "engine": lambda at, draws: _engine(_FOGS[at % len(_FOGS)], draws),
    }

    def drawn(kind: str, at: int) -> DrawnScene:
        draws = Draws(number, part=f"{kind}-{at}")
        while True:
            scene = _scene(f"{kind}-{at + 1}", kind, *makers[kind](at, draws))
            if kind != "engine" or _is_seen(scene):
                return scene

    return tuple(drawn(kind, at) for kind in KINDS for at in range(EACH))


def _is_seen(scene: DrawnScene) -> bool:
    """Return whether fog is lit in half of the view: a camera under a floor sees none of a sun."""
    with temporary_folder() as folder:
        loaded = load_drawn(folder, scene, (16, 12))
        lit = reference_of(loaded.scene).airlight.max(axis=2) > 0
    return bool(lit.mean() > 0.5)


def scenes_digest(scenes: Sequence[DrawnScene]) -> str:
    """Return the digest of the Mitsuba files and meshes of scenes: SHA-256 over lines `sha256
    name`, sorted by name.
    """
    named = {name: data for scene in scenes for name, data in scene.files.items()}
    lines = [
        f"{hashlib.sha256(data).hexdigest()}  {name}\n" for name, data in sorted(named.items())
    ]
    return hashlib.sha256("".join(lines).encode()).hexdigest()


# --- kinds ----------------------------------------------------------------------------------------


def _random(draws: Draws) -> tuple[RandomScene, Plugin, str]:
    stage = _stage(draws, ranges_from(_STAGES))
    medium = stage.media[0]
    return stage, _homogeneous(medium), f"Stage {stage.seed}.{stage.attempt} in homogeneous fog"


def _stage(draws: Draws, ranges: Ranges) -> RandomScene:
    """Return the first stage of a sequence of drawn ones that is lit, and not costly."""
    while True:
        # A point of the design, and one of many stages that it has.
        point, attempt = int(draws.fraction() * _POINTS), int(draws.fraction() * 2**30)
        stage = draw_scene(point, ranges, attempt)
        triangles = sum(len(each.mesh[1]) for each in stage.occluders)
        if triangles * len(stage.lights) <= _MOST and _is_shown(stage, _LIT):
            return stage


def _is_shown(stage: RandomScene, most: float = 1.0) -> bool:
    """Return whether light reaches enough of the view, and at most a fraction of it."""
    shapes = {
        each.name: mitsuba_mesh(each.name, each.mesh, each.reflectance.tolist())
        for each in stage.occluders
    }
    reached = with_reach(stage, mi.load_dict({"type": "scene"} | shapes, optimize=False))
    return reached.enough and reached.lit <= most


def _certified(data: Mapping[str, Any], draws: Draws) -> tuple[RandomScene, Plugin, str]:
    """Return a certified scene seen from elsewhere, in thinner or thicker fog."""
    table, sensor = data["medium"], data["mitsuba"]["sensor"]
    matrix = np.array(sensor["to_world"]["matrix"])
    origin, forward = matrix[:3, 3], matrix[:3, 2]
    words = f"hg:{table['g']!r}" if table["phase"] == "hg" else table["phase"]
    factor = draws.logarithmic(0.5, 2.0)
    sigma_t = factor * np.array(table["sigma_t"])
    lights = tuple(_certified_light(each, at) for at, each in enumerate(data["lights"], 1))
    # The camera turns about a point ahead, as far away as the nearest light.
    distance = min(float(np.linalg.norm(each.position - origin)) for each in lights)
    pivot = origin + distance * forward
    stage = RandomScene(
        seed=0,
        attempt=0,
        scale=distance,
        centre=pivot,
        origin=origin,
        target=pivot,
        fov=float(sensor["fov"]),
        inside="unbounded",
        in_shadow=False,
        media=(
            Medium(
                "unbounded",
                "unbounded",
                sigma_t,
                bool(np.ptp(sigma_t) == 0),
                np.array(table["albedo"]),
                words,
                float(sigma_t.mean() * distance),
                True,
            ),
        ),
        lights=lights,
        occluders=tuple(
            Occluder(
                each["type"], _certified_mesh(each), pivot, distance, np.zeros(3), f"shape-{at}"
            )
            for at, each in enumerate(data["occluders"], 1)
        ),
    )
    while True:
        angle, nearer = math.radians(draws.between(-41.0, 41.0)), draws.between(0.71, 1.31)
        x, y, z = nearer * (origin - pivot)
        turned = np.array(
            [
                pivot[0] + math.cos(angle) * x - math.sin(angle) * y,
                pivot[1] + math.sin(angle) * x + math.cos(angle) * y,
                # Above the floor, which is at 0.
                max(pivot[2] + z, 0.1 * distance),
            ]
        )
        seen = replace(stage, origin=turned)
        if _is_shown(seen):
            purpose = (
                f"Certified scene {data['name']} from another place, extinction times {factor:.3g}"
            )
            return seen, _homogeneous(stage.media[0]), purpose


def _certified_light(data: Mapping[str, Any], number: int) -> Light:
    position, axis = np.array(data["position"]), np.array(data.get("axis", (0.0, 0.0, -1.0)))
    return Light(
        f"light-{number}",
        data["type"],
        position,
        position + axis,
        np.array(data["intensity"]),
        brightness=0.0,
        cutoff=float(data.get("cutoff", 0.0)),
        beam=float(data.get("beam", 0.0)),
    )


def _certified_mesh(data: Mapping[str, Any]) -> Mesh:
    """Return an occluder as triangles: every renderer has the same silhouette of a sphere then."""
    centre = np.array(data["centre"])
    if data["type"] == "sphere":
        return placed(scaled(icosphere(3), data["radius"]), centre)
    edges = np.array(data["half_edges"])
    if data["type"] == "box":
        vertices, faces = box((2.0, 2.0, 2.0))
        return vertices @ edges + centre, faces
    across, up = 2 * edges
    return grid(tuple(centre - edges.sum(axis=0)), tuple(across), tuple(up), (1, 1))


def _engine(engine: str, draws: Draws) -> tuple[RandomScene, Plugin, str]:
    """Return a stage in height fog that an engine's parameters say, in three digits each."""
    stage = _stage(draws, ranges_from(_SUNLIT))
    while any(-_rise(sun) <= _ABOVE for sun in _suns(stage)):
        stage = _stage(draws, ranges_from(_SUNLIT))
    suns = _suns(stage)
    medium, scale = stage.media[0], stage.scale
    # The base is near the lower of camera and stage, so that most of the view is above it.
    low = min(stage.origin[2], stage.centre[2])
    way = float(np.linalg.norm(stage.origin - stage.centre)) + scale
    clamped = bool(ENGINES[engine].get("clamped", False))
    lamps = [each for each in stage.lights if each.kind != "directional"]
    lowest = min([low, *(each.position[2] for each in lamps)])
    while True:
        base = float(low + scale * draws.between(-0.71, 0.11))
        height = scale * draws.logarithmic(0.23, 3.1)
        sigma_t = draws.logarithmic(0.11, 3.1) / way
        # Without a clamp fog thickens downwards: it must drown neither view nor lamps. Light of a
        # sun passes a scale height, aslant.
        thickest = sigma_t * math.exp((base - lowest) / height)
        thickest = min(thickest, sigma_t) if clamped else thickest
        aslant = [height / -_rise(sun) for sun in suns]
        if thickest * max([way, *aslant]) <= _OPAQUE:
            break
    numbers = parameters_of(engine, [(sigma_t, base, height)], clamped=clamped, constant=0.0)
    assert not isinstance(numbers, str)
    # Fog of engines has no floor: below this one it is opaque, or so far away that it adds nothing.
    floor = base - (60 * scale if clamped else 8 * height)
    cap = base + max(20 * height, 20 * scale)
    matrix = np.diag([1.0, 1.0, cap - floor, 1.0])
    matrix[2, 3] = floor
    volume: Plugin = {"type": "heightfog", "engine": engine, "to_world": matrix}
    volume |= {name: float(f"{value:.3g}") for name, value in numbers.items()}
    plugin: Plugin = {
        "type": "heterogeneous",
        "id": "fog",
        "sigma_t": volume,
        "albedo": {"type": "rgb", "value": medium.albedo.tolist()},
        "phase": phase_function(medium.phase, 0),
    }
    return stage, plugin, f"Stage {stage.seed}.{stage.attempt} in the height fog of {engine}"


# --- files ----------------------------------------------------------------------------------------


def load_drawn(folder: Path, scene: DrawnScene, size: tuple[int, int] | None = None) -> LoadedScene:
    """Write the Mitsuba file of a scene and its meshes into a folder, and load it, at its own
    size by default.
    """
    for name, data in scene.files.items():
        write_bytes(folder / name, data, flush=False)
    # Mitsuba's note that its own image of fog without bounds ends at the far plane is no news.
    level = mi.logger().log_level()
    mi.logger().set_log_level(mi.LogLevel.Error)
    try:
        return replace(load_scene(str(folder / scene.file), size), purpose=scene.purpose)
    finally:
        mi.logger().set_log_level(level)


def _suns(stage: RandomScene) -> list[Light]:
    return [each for each in stage.lights if each.kind == "directional"]


def _rise(sun: Light) -> float:
    """Return the vertical component of the unit direction of a sun."""
    direction = sun.target - sun.position
    return float(direction[2] / np.linalg.norm(direction))


def _homogeneous(medium: Medium) -> Plugin:
    sigma_t = medium.sigma_t.tolist()
    phase = phase_function(medium.phase, 0)
    return fog(sigma_t[0] if medium.grey else sigma_t, medium.albedo.tolist(), phase)


def _scene(name: str, kind: str, stage: RandomScene, medium: Plugin, what: str) -> DrawnScene:
    """Return a stage in a medium as files."""
    sensor = camera(stage.origin.tolist(), stage.target.tolist(), fov=stage.fov, size=SIZE)
    # Clip planes in proportion to the scene, of any size.
    sensor |= {"near_clip": 1e-5 * stage.scale, "far_clip": 1e7 * stage.scale}
    scene: Plugin = {"type": "scene", "fog": medium, "sensor": sensor}
    scene |= {each.name: _light(each) for each in stage.lights}
    files = {}
    for each in stage.occluders:
        file = f"{name}.{each.name}.ply"
        files[file] = ply_bytes(each.mesh)
        scene[each.name] = {
            "type": "ply",
            "filename": file,
            "face_normals": True,
            "bsdf": _twosided(each.reflectance.tolist()),
        }
    kinds = [each.kind for each in stage.lights]
    lights = ", ".join(f"{kinds.count(each)} {each}" for each in dict.fromkeys(kinds))
    purpose = f"{what}: {lights}, {len(stage.occluders)} occluders."
    return DrawnScene(name, kind, purpose, {f"{name}.xml": scene_xml(scene).encode()} | files)


def _twosided(reflectance: Sequence[float]) -> Plugin:
    diffuse = {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(reflectance)}}
    return {"type": "twosided", "bsdf": diffuse}


def _light(each: Light) -> Plugin:
    made = partial(light, colour=each.colour.tolist())
    direction = each.target - each.position
    if each.kind == "directional":
        return made("sun", direction=direction.tolist())
    position = each.position.tolist()
    if each.kind == "point":
        return made("point", position=position)
    # A spot that shines along the vertical needs another direction up.
    upright = abs(direction[2]) < 0.99 * np.linalg.norm(direction)
    return made(
        "spot",
        position=position,
        target=each.target.tolist(),
        cutoff=each.cutoff,
        beam=each.beam,
        up=[0, 0, 1] if upright else [1, 0, 0],
    )
