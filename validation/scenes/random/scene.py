# SPDX-License-Identifier: BSD-3-Clause
"""Scenes drawn from a seed, under the name `random:SEED`.

A name may go on: `random:7,ranges=FILE.toml` draws from other ranges, and takes the .obj and .ply files of a folder
that they name as casters too; commas and per cent signs of a path are written as in a URL. What is drawn where too
little light reaches what the camera sees is drawn again.

All is drawn in radii of a stage about the origin. Where Mitsuba's parts are made it is scaled and moved to an arbitrary
place.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from validation.properties.view import LightPlace, distance, lit_points
from validation.scenes.meshes import box, gem, icosphere, placed, rotation, scaled
from validation.scenes.parts import camera, fog, light, medium_boundary, mitsuba_mesh, phase_function
from validation.scenes.random.casters import Caster, draw_casters, draw_ground
from validation.scenes.random.design import Draws, Ranges, random_parts, ranges_from, read_ranges
from validation.scenes.random.lights import AREA_KINDS, Light, draw_lights
from validation.scenes.random.media import Medium, draw_media, ways
from validation.scenes.registry import Animation, SceneRecord

Array = NDArray[np.float64]

_ATTEMPTS = 17
_TABLE = 513  # values of a tabulated phase function
_ACROSS, _UP, _ALONG = 7, 5, 3  # rays of the camera, and points on each, at which light is looked for


@dataclass(frozen=True)
class Camera:
    """The camera."""

    origin: Array
    target: Array  #: a point that it looks at
    fov: float  #: horizontal field of view [degrees]
    inside: str  #: name of the medium that it is in, or 'clear air'
    in_shadow: bool  #: whether a plate is meant to keep the first light from it


@dataclass(frozen=True)
class Stage:
    """A scene that was drawn; lengths are in radii of the stage, the ball that the camera looks at."""

    seed: int
    attempt: int  #: how many draws before this one let too little light through
    scale: float  #: radius of the stage [m]
    centre: Array  #: of the stage [m]
    camera: Camera
    media: tuple[Medium, ...]  #: an endless one first
    lights: tuple[Light, ...]
    casters: tuple[Caster, ...]

    def place(self, point: Array) -> list[float]:
        """Return where a point is [m]."""
        return [float(value) for value in self.centre + self.scale * point]


@dataclass(frozen=True)
class Reach:
    """What of a scene the camera sees, and what of it is lit."""

    lit: float  #: share of points in view that a light reaches
    near: float  #: share of rays that meet a surface before half of the way to the middle of the stage
    camera_lit: bool  #: whether the first light reaches the camera

    @property
    def enough(self) -> bool:
        """Whether the scene is worth rendering."""
        return self.lit >= 0.23 and self.near <= 0.31


def random_record(name: str) -> SceneRecord:
    """Return the record of a random scene; needs an active Mitsuba variant."""
    stage, occluders, _ = _drawn(*_parse(name))
    x, y, z = stage.place(np.zeros(3))
    return SceneRecord(
        name, lambda: _build(stage, occluders), _purpose(stage), "none: drawn from its seed", Animation(about=(x, y, z))
    )


def drawn_values(name: str) -> dict[str, Any]:
    """Return what was drawn for a random scene, as plain data; its lengths are as in `Stage`."""
    stage, _, found = _drawn(*_parse(name))
    bare = replace(stage, casters=tuple(replace(each, mesh=()) for each in stage.casters))  # type: ignore[arg-type]
    return _plain(asdict(bare)) | {"reach": asdict(found)}


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items() if key != "mesh"}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def _parse(name: str) -> tuple[int, Ranges]:
    seed, file = random_parts(name)
    return seed, read_ranges(file) if file else ranges_from({})


# Drawing --------------------------------------------------------------------------------------------------------------


def _drawn(seed: int, ranges: Ranges) -> tuple[Stage, dict[str, Any], Reach]:
    """Return the first draw that lets enough light through, or the best, with the Mitsuba shapes of its casters."""
    draws = []
    for attempt in range(_ATTEMPTS):
        stage = draw_stage(seed, ranges, attempt)
        occluders = {caster.name: _occluder(stage, caster) for caster in stage.casters}
        found = reach(stage, mi.load_dict({"type": "scene"} | occluders, optimize=False))
        draws.append((stage, occluders, found))
        if found.enough:
            return draws[-1]
    return max(draws, key=lambda each: each[2].lit - each[2].near)


def draw_stage(seed: int, ranges: Ranges, attempt: int = 0) -> Stage:
    """Return the scene of a seed; for another attempt its point is the same, and places and shapes are others."""
    draws = Draws(seed, attempt)
    scale = draws.logarithmic(*ranges["scale"], name="scale")
    origin, target, fov = _draw_view(draws, ranges)
    media = draw_media(draws, ranges, origin)
    seen = ways(media, origin, target, float(np.linalg.norm(origin)) + 1.0)
    lights = draw_lights(draws, ranges, media, origin, seen)
    in_shadow = draws.pick(ranges["camera_in"], "camera_in") == "shadow"
    casters = draw_casters(draws, ranges, origin, lights, in_shadow=in_shadow)
    casters += draw_ground(draws, ranges, origin, lights, casters)
    kinds = [caster.kind for caster in casters]
    named = [
        replace(caster, name=f"{caster.kind}-{kinds[:number].count(caster.kind) + 1}")
        for number, caster in enumerate(casters)
    ]
    stream = draws.of("place")
    centre = scale * np.array([stream.between(-2.3, 2.3) for _ in range(3)])
    inside = [medium.name for medium in media if medium.holds_camera]
    view = Camera(origin, target, fov, inside[-1] if inside else "clear air", in_shadow)
    return Stage(seed, attempt, scale, centre, view, tuple(media), tuple(lights), tuple(named))


def _draw_view(draws: Draws, ranges: Ranges) -> tuple[Array, Array, float]:
    """Return origin and target of the camera and its field of view."""
    stream = draws.of("camera")
    distance = draws.logarithmic(*ranges["camera_distance"], name="camera_distance")
    elevation = math.radians(draws.between(*ranges["camera_elevation"], name="camera_elevation"))
    azimuth = stream.between(0, 2 * math.pi)
    across = math.cos(elevation)
    origin = distance * np.array([across * math.cos(azimuth), across * math.sin(azimuth), math.sin(elevation)])
    return origin, 0.37 * stream.in_ball(), draws.between(*ranges["fov"], name="fov")


def reach(stage: Stage, occluders: Any) -> Reach:
    """Return what light reaches past the casters, an `mi.Scene`, in an image of 4 to 3."""
    origin = np.array(stage.place(stage.camera.origin))
    directions = _directions(stage.camera)
    away = stage.scale * float(np.linalg.norm(stage.camera.origin))
    hit = distance(occluders, np.broadcast_to(origin, directions.shape), directions)
    free = np.minimum(hit, away + stage.scale)
    share = (np.arange(_ALONG) + 0.5) / _ALONG
    points = (origin + (free[:, None] * share)[..., None] * directions[:, None]).reshape(-1, 3)
    lights = [_place(stage, each) for each in stage.lights]
    lit = np.any([lit_points(occluders, each, points) for each in lights], axis=0)
    camera_lit = bool(lit_points(occluders, lights[0], origin[None])[0])
    return Reach(float(lit.mean()), float((free < 0.5 * away).mean()), camera_lit)


def _directions(view: Camera) -> Array:
    forward = (view.target - view.origin) / np.linalg.norm(view.target - view.origin)
    left = np.cross([0.0, 0.0, 1.0], forward)
    left /= np.linalg.norm(left)
    up = np.cross(forward, left)
    tangent = np.tan(0.5 * np.deg2rad(view.fov))
    x = tangent * (2 * (np.arange(_ACROSS) + 0.5) / _ACROSS - 1)
    y = 0.75 * tangent * (2 * (np.arange(_UP) + 0.5) / _UP - 1)
    rays = (forward + x[:, None, None] * left + y[None, :, None] * up).reshape(-1, 3)
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _place(stage: Stage, drawn: Light) -> LightPlace:
    """Return where a light is, or of a spot or flat light where it shines too; a sphere in its middle."""
    axis = (drawn.target - drawn.position) / np.linalg.norm(drawn.target - drawn.position)
    cos_cutoff = math.cos(math.radians(drawn.cutoff)) if drawn.kind == "spot" else 0.0
    directed = drawn.kind in ("spot", "rectangle", "disk")
    return LightPlace("point", np.array(stage.place(drawn.position)), 0.0, axis if directed else None, cos_cutoff)


# Building -------------------------------------------------------------------------------------------------------------


def _purpose(stage: Stage) -> str:
    kinds = [each.kind for each in stage.lights]
    lights = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
    media = ", ".join(f"{medium.bounds} of optical depth {medium.optical_depth:.3g}" for medium in stage.media)
    where = "shadow" if stage.camera.in_shadow else "light"
    return (
        f"Drawn from the seed {stage.seed}: lights: {lights}; media: {media}; {len(stage.casters)} casters; the camera "
        f"in {where}, in {stage.camera.inside}."
    )


def _build(stage: Stage, occluders: Mapping[str, Any]) -> dict[str, Any]:
    fillings = {medium.name: _filling(stage, medium) for medium in stage.media}
    endless = fillings.get("endless")
    view = stage.camera
    sensor = camera(stage.place(view.origin), stage.place(view.target), fov=view.fov, size=(800, 600), in_fog=False)
    sensor |= {"near_clip": 1e-5 * stage.scale, "far_clip": 1e5 * stage.scale}
    own = fillings.get(view.inside, endless)
    return {
        "type": "scene",
        "sensor": sensor | ({} if own is None else {"medium": own}),
        **{each.name: _light(stage, each) for each in stage.lights},
        **{
            medium.name: _boundary(stage, medium, fillings[medium.name], endless)
            for medium in stage.media
            if medium.bounds != "endless"
        },
        **occluders,
    }


def _filling(stage: Stage, medium: Medium) -> Any:
    sigma_t = [float(value) for value in medium.sigma_t / stage.scale]
    described = fog(
        sigma_t[0] if medium.grey else sigma_t, medium.albedo.tolist(), phase_function(medium.phase, _TABLE)
    )
    return mi.load_dict(described | {"id": f"{medium.name}-medium"})


def _ball(stage: Stage, position: Array, radius: float) -> Any:
    return mi.ScalarTransform4f().translate(stage.place(position)).scale(float(stage.scale * radius))


def _boundary(stage: Stage, medium: Medium, filling: Any, around: Any) -> Any:
    if medium.bounds == "sphere":
        outside = {} if around is None else {"exterior": around}
        ball = _ball(stage, medium.centre, medium.half[0])
        return {"type": "sphere", "to_world": ball, "bsdf": {"type": "null"}, "interior": filling} | outside
    mesh = {"box": box((2.0, 2.0, 2.0)), "gem": gem(9, 4), "ellipsoid": icosphere(1)}[medium.bounds]
    mesh = placed(scaled(mesh, medium.half), medium.centre, rotation(*medium.turn))
    return medium_boundary(medium.name, placed(scaled(mesh, stage.scale), stage.centre), filling, around)


def _light(stage: Stage, drawn: Light) -> dict[str, Any]:
    # Extinction is over a length, so a stage twice as large scatters as much, and its light comes from twice as far:
    # intensity [W/sr] grows with the square, radiance and irradiance stay.
    colour = (drawn.colour * (stage.scale**2 if drawn.kind in ("point", "spot") else 1.0)).tolist()
    where: dict[str, Any] = {"position": stage.place(drawn.position), "target": stage.place(drawn.target)}
    direction = drawn.target - drawn.position
    if drawn.kind == "directional":
        return light("sun", colour, direction=direction)
    if drawn.kind in AREA_KINDS:
        size = [stage.scale * value for value in drawn.size]
        lamp = light(drawn.kind, colour, **where, size=size if len(size) == 2 else size[0], opaque=drawn.black)
        if drawn.kind == "sphere":  # Mitsuba takes the rounding of the turn of a large one for shear, and warns
            lamp["to_world"] = _ball(stage, drawn.position, drawn.size[0])
        return lamp
    upright = abs(direction[2]) < 0.99 * np.linalg.norm(direction)
    cone = {"cutoff": drawn.cutoff, "beam": drawn.beam, "up": [0, 0, 1] if upright else [1, 0, 0]}
    return light(drawn.kind, colour, **where, **cone)


def _occluder(stage: Stage, caster: Caster) -> Any:
    if caster.kind == "ball":
        diffuse = {"type": "diffuse", "reflectance": {"type": "rgb", "value": caster.reflectance.tolist()}}
        ball = _ball(stage, caster.position, caster.radius)
        return mi.load_dict(
            {"type": "sphere", "id": caster.name, "to_world": ball, "bsdf": {"type": "twosided", "bsdf": diffuse}}
        )
    mesh = placed(scaled(caster.placed, stage.scale), stage.centre)
    return mitsuba_mesh(caster.name, mesh, caster.reflectance.tolist())
