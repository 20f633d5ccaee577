# SPDX-License-Identifier: BSD-3-Clause
"""Random scenes: `random:SEED`, drawn from the seed alone, and built as a Mitsuba scene.

A name may go on: `random:7,meshes=FOLDER` takes .obj and .ply files as casters too, `random:7,ranges=FILE.toml` draws
from other ranges; commas and per cent signs of a path are written as in a URL. What is drawn where too little light
reaches what the camera sees is drawn again.
"""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from realtime.scene.mesh_adjacency import mesh_triangles
from validation.random_scenes.draw import draw_scene
from validation.random_scenes.drawn import AREA_KINDS, DrawnCaster, DrawnLight, DrawnMedium, DrawnScene
from validation.random_scenes.ranges import Ranges, ranges_from, read_ranges
from validation.random_scenes.reach import Reach, reach
from validation.scenes.meshes import (
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
from validation.scenes.parts import (
    area_lamp,
    camera,
    fog,
    medium_boundary,
    mitsuba_mesh,
    point_light,
    tabulated_phase,
)
from validation.scenes.registry import Animation, SceneRecord

Array = NDArray[np.float64]

PREFIX = "random:"
_SAFE = "/:\\"  # what stands in a path as it is, besides letters, digits, '_', '.', '-' and '~'
_ATTEMPTS = 17
_TABLE = 513  # values of a tabulated phase function


def is_random(name: str) -> bool:
    """Return whether a name is that of a random scene."""
    return name.startswith(PREFIX)


def random_name(name: str, meshes: Path | None = None, ranges: Path | None = None) -> str:
    """Return the name of a scene with a folder of meshes and a file of ranges, as options give them.

    Raises
    ------
    InputError
        If the scene is no random one and one of them is given.
    """
    given = {"meshes": meshes, "ranges": ranges}
    words = [f"{option}={quote(str(path.resolve()), safe=_SAFE)}" for option, path in given.items() if path is not None]
    if words and not is_random(name):
        option = words[0].partition("=")[0]
        given_scene = f"{name} is no random scene" if name else "got no scene"
        raise InputError(f"--{option}: {given_scene}; wanted a scene such as {PREFIX}7, or no --{option}")
    return ",".join([name, *words])


def random_parts(name: str) -> tuple[int, dict[str, Path]]:
    """Return the seed in a name, and the paths of `meshes` and `ranges` that it goes on with.

    Raises
    ------
    InputError
        For a name of another form.
    """
    seed, *options = name.removeprefix(PREFIX).split(",")
    if not (seed.isascii() and seed.isdecimal()):
        raise InputError(f"scene: got {name!r}, wanted {PREFIX}SEED, a whole number, for example {PREFIX}7")
    given: dict[str, Path] = {}
    for option in options:
        key, _, value = option.partition("=")
        if key not in ("meshes", "ranges") or not value or key in given:
            raise InputError(
                f"scene: got {option!r} in {name!r}, wanted meshes=FOLDER or ranges=FILE.toml after the seed, each once"
            )
        given[key] = Path(unquote(value))
    return int(seed), given


def random_record(name: str) -> SceneRecord:
    """Return the record of a random scene.

    Raises
    ------
    InputError
        For a name of another form, a seed that no scene has, a folder without meshes and ranges that cannot be drawn.
    """
    drawn, meshes, _ = _drawn(*_parse(name))
    return SceneRecord(
        name,
        lambda: _build(drawn, meshes),
        _purpose(drawn),
        "none: drawn from its seed",
        Animation(about=drawn.centre),
    )


def drawn_values(name: str) -> dict[str, Any]:
    """Return what was drawn for a random scene, as plain data."""
    drawn, _, found = _drawn(*_parse(name))
    return asdict(drawn) | {"reach": asdict(found)}


def _parse(name: str) -> tuple[int, Ranges]:
    seed, given = random_parts(name)
    ranges = Ranges()
    if "ranges" in given:
        ranges = read_ranges(given["ranges"])
    if "meshes" in given:
        ranges = ranges_from({"meshes": str(given["meshes"])} | _changed(ranges), name)
    return seed, ranges


def _changed(ranges: Ranges) -> dict[str, Any]:
    return {name: value for name, value in vars(ranges).items() if name != "meshes"}


def _drawn(seed: int, ranges: Ranges) -> tuple[DrawnScene, list[Mesh], Reach]:
    """Return the first draw that lets enough light through, or the best, with the meshes of its casters."""
    files = _files(ranges.meshes)
    draws = []
    for attempt in range(_ATTEMPTS):
        drawn = draw_scene(seed, ranges, attempt)
        meshes = [_mesh(caster, files) for caster in drawn.casters]
        found = reach(drawn, [vertices[faces] for vertices, faces in meshes])
        draws.append((drawn, meshes, found))
        if found.enough:
            return draws[-1]
    return max(draws, key=lambda each: each[2].lit - each[2].near)


def _files(folder: str) -> list[Path]:
    if not folder:
        return []
    files = sorted(path for path in Path(folder).iterdir() if path.suffix.lower() in (".obj", ".ply"))
    if not files:
        raise InputError(f"meshes: {folder} holds no .obj or .ply file; wanted a folder of meshes")
    return files


def _purpose(drawn: DrawnScene) -> str:
    kinds = [light.kind for light in drawn.lights]
    lights = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
    media = ", ".join(f"{medium.bounds} of optical depth {medium.optical_depth:.3g}" for medium in drawn.media)
    where = "shadow" if drawn.camera.in_shadow else "light"
    return (
        f"Drawn from the seed {drawn.seed}: lights: {lights}; media: {media}; {len(drawn.casters)} casters; the camera "
        f"in {where}, in {drawn.camera.inside}."
    )


def _build(drawn: DrawnScene, meshes: Sequence[Mesh]) -> dict[str, Any]:
    endless = next((_medium(medium) for medium in drawn.media if medium.bounds == "endless"), None)
    bounded = {medium.name: (medium, _medium(medium)) for medium in drawn.media if medium.bounds != "endless"}
    sensor = camera(drawn.camera.origin, drawn.camera.target, fov=drawn.camera.fov, size=(800, 600), in_fog=False)
    own = bounded[drawn.camera.inside][1] if drawn.camera.inside in bounded else endless
    near, far = 1e-5 * drawn.scale, 1e5 * drawn.scale
    scene: dict[str, Any] = {"type": "scene"}
    scene["sensor"] = sensor | {"near_clip": near, "far_clip": far} | ({} if own is None else {"medium": own})
    for light in drawn.lights:
        scene[light.name] = _light(light)
    for name, (medium, filling) in bounded.items():
        scene[name] = _boundary(medium, filling, endless)
    for caster, mesh in zip(drawn.casters, meshes, strict=True):
        scene[caster.name] = (
            _sphere(caster) if caster.kind == "ball" else mitsuba_mesh(caster.name, mesh, caster.reflectance)
        )
    return scene


def _medium(medium: DrawnMedium) -> Any:
    sigma_t: float | list[float] = medium.sigma_t[0] if len(medium.sigma_t) == 1 else list(medium.sigma_t)
    return mi.load_dict(fog(sigma_t, medium.albedo, _phase(medium.phase)) | {"id": f"{medium.name}-medium"})


def _phase(words: str) -> dict[str, Any]:
    name, _, number = words.partition(":")
    if name == "hg":
        return {"type": "hg", "g": float(number)}
    return {"type": name} if name in ("isotropic", "rayleigh") else tabulated_phase(words, _TABLE)


def _boundary(medium: DrawnMedium, filling: Any, around: Any) -> Any:
    outside = {} if around is None else {"exterior": around}
    if medium.bounds == "sphere":
        turned = mi.ScalarTransform4f().translate(list(medium.centre)).scale(medium.half[0])
        return {"type": "sphere", "to_world": turned, "bsdf": {"type": "null"}, "interior": filling} | outside
    mesh = {
        "box": lambda: box((2.0, 2.0, 2.0)),
        "gem": lambda: gem(9, 4),
        "ellipsoid": lambda: icosphere(1),
    }[medium.bounds]()
    axis, angle = medium.turn
    mesh = placed(scaled(mesh, medium.half), medium.centre, rotation(axis, angle))
    return medium_boundary(medium.name, mesh, filling, around)


def _light(light: DrawnLight) -> dict[str, Any]:
    if light.kind == "point":
        return point_light(light.position, light.colour)
    if light.kind in AREA_KINDS:
        size = light.size if light.kind == "rectangle" else light.size[0]
        lamp = area_lamp(light.kind, light.position, light.target, size, light.colour)
        if light.kind == "sphere":  # Mitsuba takes the rounding of the turn of a large one for shear, and warns
            lamp["to_world"] = mi.ScalarTransform4f().translate(list(light.position)).scale(light.size[0])
        return lamp if light.black else lamp | {"material": {"type": "null"}}
    direction = np.subtract(light.target, light.position)
    if light.kind == "directional":
        irradiance = {"type": "rgb", "value": list(light.colour)}
        return {"type": "directional", "direction": direction.tolist(), "irradiance": irradiance}
    up = [0, 0, 1] if abs(direction[2]) < 0.99 * np.linalg.norm(direction) else [1, 0, 0]
    return {
        "type": "spot",
        "to_world": mi.ScalarTransform4f().look_at(origin=list(light.position), target=list(light.target), up=up),
        "intensity": {"type": "rgb", "value": list(light.colour)},
        "cutoff_angle": light.cutoff,
        "beam_width": light.beam,
    }


def _sphere(caster: DrawnCaster) -> dict[str, Any]:
    diffuse = {"type": "diffuse", "reflectance": {"type": "rgb", "value": list(caster.reflectance)}}
    return {
        "type": "sphere",
        "to_world": mi.ScalarTransform4f().translate(list(caster.position)).scale(caster.radius),
        "bsdf": {"type": "twosided", "bsdf": diffuse},
    }


def _mesh(caster: DrawnCaster, files: Sequence[Path]) -> Mesh:
    """Return the mesh of a caster, where it is [m]."""
    mesh = _user_mesh(files[int(caster.numbers[0] * len(files))]) if caster.kind == "mesh" else _unit_mesh(caster)
    axis, angle = caster.turn
    return placed(scaled(mesh, caster.radius), caster.position, rotation(axis, angle))


def _unit_mesh(caster: DrawnCaster) -> Mesh:
    """Return a mesh within the unit ball."""
    numbers = caster.numbers
    match caster.kind:
        case "box" | "plate":
            return box([2 * value for value in numbers])
        case "sheet" | "floor" | "wall":
            x, y = numbers
            cells = (3, 2) if caster.kind == "sheet" else (1, 1)
            return grid((-x, -y, 0.0), (2 * x, 0, 0), (0, 2 * y, 0), cells)
        case "room":
            vertices, faces = box([2 * value for value in numbers])
            return vertices, faces[:, ::-1]
        case "tetrahedron":
            return tetrahedron(1.0)
        case "icosphere":
            return icosphere(int(numbers[0]))
        case "ball":
            return icosphere(2)
        case "gem":
            return gem(int(numbers[0]), int(numbers[1]))
        case "torus":
            return torus(1 - numbers[0], numbers[0], (int(numbers[1]), int(numbers[2])))
        case "star":
            height = numbers[2]
            across = np.sqrt(1 - height**2)
            return placed(prism(star(numbers[1] * across, across, int(numbers[0])), 2 * height), (0, 0, -height))
        case "vase":
            level = np.linspace(-0.77, 0.77, len(numbers) - 1)
            return lathe(numbers[1:], level, int(numbers[0]))
        case "fence":
            return _fence(*numbers)
        case "pierced":
            return _pierced(*numbers)
        case "cage":
            return _cage(int(numbers[0]), numbers[1])
    raise ValueError(caster.kind)


def _fence(bars: float, width: float, height: float, thickness: float, turn: float) -> Mesh:
    count, reach_across = int(bars), 0.67
    pitch = 2 * reach_across / count
    bar = box((width * pitch, 2 * thickness, 2 * height))
    return joined(
        [
            placed(bar, ((number + 0.5) * pitch - reach_across, 0.0, 0.0), rotation((0, 0, 1), turn))
            for number in range(count)
        ]
    )


def _pierced(across: float, up: float, share: float, thickness: float) -> Mesh:
    def lines(holes: int, half: float) -> Array:
        rib = (1 - share) / (holes + 1)
        widths = np.array([rib, *([share / holes, rib] * holes)])
        return 2 * half * np.concatenate([[0.0], np.cumsum(widths)])

    x, y = 0.71, 0.67
    return pierced_slab(lines(int(across), x), lines(int(up), y), 2 * thickness, (thickness, -x, -y))


def _cage(bars: int, radius: float) -> Mesh:
    bar = lathe([radius, radius], [-0.61, 0.61], 5)
    angle = 2 * np.pi * np.arange(bars) / bars
    return joined([placed(bar, (0.71 * np.cos(each), 0.71 * np.sin(each), 0.0)) for each in angle])


def _user_mesh(path: Path) -> Mesh:
    """Return a mesh of the user's, moved and scaled to the unit ball."""
    try:
        shape = mi.load_dict({"type": path.suffix.lower()[1:], "filename": str(path)})
    except Exception as error:  # Mitsuba raises RuntimeError for all bad input
        raise InputError(f"meshes: Mitsuba cannot read {path}: {' '.join(str(error).split())}") from error
    vertices, faces = mesh_triangles(shape)
    if not len(faces) or not np.isfinite(vertices).all():
        raise InputError(f"meshes: {path} has no triangles or numbers that are not finite; wanted a mesh")
    used = vertices[np.unique(faces)]
    middle = 0.5 * (used.min(axis=0) + used.max(axis=0))
    size = float(np.linalg.norm(used - middle, axis=1).max())
    return (vertices - middle) / size, faces
