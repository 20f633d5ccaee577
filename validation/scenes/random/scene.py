# SPDX-License-Identifier: BSD-3-Clause
"""Scenes drawn from a seed, under the name `random:SEED`.

A name may go on: `random:7,ranges=FILE.toml` draws from other ranges, and takes the .obj and .ply
files of a folder that they name as occluders too; commas and per cent signs of a path are written
as in a URL. A scene in which too little light reaches the view is drawn again.

All is drawn in radii of a stage about the origin, then scaled and moved to
an arbitrary place, once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import mitsuba as mi
import numpy as np

from airlight.validation.arrays import Array
from airlight.validation.columns import plain
from airlight.validation.properties.view import LightPlace, distance, lit_points
from airlight.validation.scenes.meshes import box, gem, icosphere, placed, rotation, scaled
from airlight.validation.scenes.names import random_parts
from airlight.validation.scenes.parts import (
    Plugin,
    area_lamp,
    camera,
    fog,
    medium_boundary,
    mitsuba_mesh,
    phase_function,
    point_light,
    spot_light,
    sun,
)
from airlight.validation.scenes.random.design import (
    Draws,
    Ranges,
    ranges_from,
    read_ranges,
)
from airlight.validation.scenes.random.lights import AREA_KINDS, Light, draw_lights
from airlight.validation.scenes.random.media import Medium, draw_media
from airlight.validation.scenes.random.occluders import Occluder, draw_ground, draw_occluders
from airlight.validation.scenes.registry import Animation, SceneRecord


@dataclass(frozen=True)
class RandomScene:
    """A scene that was drawn. It is drawn in radii of the stage, the ball that the camera
    looks at, and scaled once.
    """

    seed: int
    attempt: int  #: how many draws before this one let too little light through
    scale: float  #: radius of the stage [m]
    centre: Array  #: of the stage [m]
    origin: Array  #: of the camera
    target: Array  #: a point that the camera looks at
    fov: float  #: horizontal field of view [degrees]
    inside: str  #: name of the medium that the camera is in, or 'vacuum'
    in_shadow: bool  #: whether a plate is meant to keep the first light from the camera
    media: tuple[Medium, ...]  #: an unbounded one first
    lights: tuple[Light, ...]
    occluders: tuple[Occluder, ...]
    lit: float = 0.0  #: fraction of points in view that a light reaches
    #: fraction of rays that meet a surface before half of the way to the middle of the stage
    near: float = 0.0

    @property
    def enough(self) -> bool:
        """Whether the scene is worth rendering."""
        return self.lit >= 0.23 and self.near <= 0.31


def random_record(name: str) -> SceneRecord:
    """Return the record of a random scene; needs an active Mitsuba variant."""
    drawn, shapes = _lit(*_parse(name))
    x, y, z = drawn.centre.tolist()
    return SceneRecord(
        name,
        lambda: _build(drawn, shapes),
        _purpose(drawn),
        "none: drawn from its seed",
        Animation(about=(x, y, z)),
    )


def drawn_values(name: str) -> dict[str, object]:
    """Return the drawn values of a random scene, as plain data without
    meshes; lengths are in metres.
    """
    values: dict[str, object] = plain(_lit(*_parse(name))[0])
    return values


def _parse(name: str) -> tuple[int, Ranges]:
    seed, file = random_parts(name)
    return seed, read_ranges(file) if file else ranges_from({})


# Drawing ------------------------------------------------------------------------------------------


def _lit(seed: int, ranges: Ranges) -> tuple[RandomScene, dict[str, mi.Shape]]:
    """Return the first draw that lets enough light through, or the best, with the Mitsuba
    shapes of its occluders.
    """
    draws = []
    for attempt in range(17):
        drawn = draw_scene(seed, ranges, attempt)
        # The shapes are built once, for the test of the light and for the scene.
        shapes = {occluder.name: _shape(occluder) for occluder in drawn.occluders}
        drawn = with_reach(drawn, mi.load_dict({"type": "scene"} | shapes, optimize=False))
        draws.append((drawn, shapes))
        if drawn.enough:
            return draws[-1]
    return max(draws, key=lambda each: each[0].lit - each[0].near)


def draw_scene(seed: int, ranges: Ranges, attempt: int = 0) -> RandomScene:
    """Return the scene of a seed; another attempt has the same point of the design, and other
    places and shapes.
    """
    draws = Draws(seed, attempt)
    scale = draws.logarithmic(*ranges["scale"], name="scale")
    origin, target, fov = _draw_view(draws, ranges)
    media = draw_media(draws, ranges, origin)
    lights = draw_lights(draws, ranges, media, origin, target)
    in_shadow = draws.pick(ranges["camera_in"], "camera_in") == "shadow"
    occluders = draw_occluders(draws, ranges, origin, lights, in_shadow=in_shadow)
    occluders += draw_ground(draws, ranges, origin, lights, occluders)
    kinds = [occluder.kind for occluder in occluders]
    # Names such as 'box-2' count the occluders of each kind.
    named = [
        replace(occluder, name=f"{occluder.kind}-{kinds[:number].count(occluder.kind) + 1}")
        for number, occluder in enumerate(occluders)
    ]
    stream = draws.of("place")
    # An arbitrary place, away from the origin: no code may rely on a scene around it.
    centre = scale * np.array([stream.between(-2.3, 2.3) for _ in range(3)])
    inside = [medium.name for medium in media if medium.holds_camera]
    return RandomScene(
        seed,
        attempt,
        scale,
        centre,
        centre + scale * origin,
        centre + scale * target,
        fov,
        inside[-1] if inside else "vacuum",
        in_shadow,
        tuple(medium.placed(scale, centre) for medium in media),
        tuple(light.placed(scale, centre) for light in lights),
        tuple(occluder.placed(scale, centre) for occluder in named),
    )


def _draw_view(draws: Draws, ranges: Ranges) -> tuple[Array, Array, float]:
    """Return origin and target of the camera and its field of view."""
    stream = draws.of("camera")
    distance = draws.logarithmic(*ranges["camera_distance"], name="camera_distance")
    elevation = math.radians(draws.between(*ranges["camera_elevation"], name="camera_elevation"))
    azimuth = stream.between(0, 2 * math.pi)
    # The camera is at a distance from the middle of the stage and looks near it.
    across = math.cos(elevation)
    origin = distance * np.array(
        [across * math.cos(azimuth), across * math.sin(azimuth), math.sin(elevation)]
    )
    return origin, 0.37 * stream.in_ball(), draws.between(*ranges["fov"], name="fov")


def with_reach(drawn: RandomScene, occluders: mi.Scene) -> RandomScene:
    """Return the scene with the fractions `lit` and `near`, of an image of 4 to 3."""
    directions = _directions(drawn)
    away = float(np.linalg.norm(drawn.origin - drawn.centre))
    hit = distance(occluders, np.broadcast_to(drawn.origin, directions.shape), directions)
    # Rays that meet nothing end behind the stage.
    free = np.minimum(hit, away + drawn.scale)
    # The points are the middles of equal parts of each ray before its surface.
    along = 3  # points on each ray
    fraction = (np.arange(along) + 0.5) / along
    points = (drawn.origin + (free[:, None] * fraction)[..., None] * directions[:, None]).reshape(
        -1, 3
    )
    lights = [_place(each) for each in drawn.lights]
    lit = np.any([lit_points(occluders, each, points) for each in lights], axis=0)
    return replace(drawn, lit=float(lit.mean()), near=float((free < 0.5 * away).mean()))


def _directions(drawn: RandomScene) -> Array:
    forward = (drawn.target - drawn.origin) / np.linalg.norm(drawn.target - drawn.origin)
    left = np.cross([0.0, 0.0, 1.0], forward)
    left /= np.linalg.norm(left)
    up = np.cross(forward, left)
    tangent = np.tan(0.5 * np.deg2rad(drawn.fov))
    # The centres of the pixels of a small image of 4 to 3.
    columns, rows = 7, 5
    x = tangent * (2 * (np.arange(columns) + 0.5) / columns - 1)
    y = 0.75 * tangent * (2 * (np.arange(rows) + 0.5) / rows - 1)
    rays = (forward + x[:, None, None] * left + y[None, :, None] * up).reshape(-1, 3)
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def _place(drawn: Light) -> LightPlace:
    """Return where a light is, or of a spot or flat light where it shines
    too; a sphere in its middle.
    """
    # A spot shines within its cone, a flat light in front of its plane: a cosine of at least 0.
    axis = (drawn.target - drawn.position) / np.linalg.norm(drawn.target - drawn.position)
    cos_cutoff = math.cos(math.radians(drawn.cutoff)) if drawn.kind == "spot" else 0.0
    directed = drawn.kind in ("spot", "rectangle", "disk")
    return LightPlace("point", drawn.position, 0.0, axis if directed else None, cos_cutoff)


# Building -----------------------------------------------------------------------------------------


def _purpose(drawn: RandomScene) -> str:
    kinds = [each.kind for each in drawn.lights]
    lights = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
    media = ", ".join(
        f"{medium.bounds} of optical depth {medium.optical_depth:.3g}" for medium in drawn.media
    )
    where = "shadow" if drawn.in_shadow else "light"
    return (
        f"Drawn from the seed {drawn.seed}: lights: {lights}; media: {media}; "
        f"{len(drawn.occluders)} occluders; the "
        f"camera in {where}, in {drawn.inside}."
    )


def _build(drawn: RandomScene, shapes: Mapping[str, mi.Shape]) -> Plugin:
    fillings = {medium.name: _filling(medium) for medium in drawn.media}
    # Media are built once and shared: the camera, and both sides of each bound, reference the same
    # medium.
    around = fillings.get("unbounded")
    sensor = camera(
        drawn.origin.tolist(), drawn.target.tolist(), fov=drawn.fov, size=(800, 600), in_fog=False
    )
    # Mitsuba's clip planes in proportion to the scene, of any size.
    sensor |= {"near_clip": 1e-5 * drawn.scale, "far_clip": 1e5 * drawn.scale}
    inside = fillings.get(drawn.inside, around)
    return {
        "type": "scene",
        "sensor": sensor if inside is None else sensor | {"medium": inside},
        **{each.name: _light(each) for each in drawn.lights},
        **{
            medium.name: _boundary(medium, fillings[medium.name], around)
            for medium in drawn.media
            if medium.bounds != "unbounded"
        },
        **shapes,
    }


def _filling(medium: Medium) -> mi.Medium:
    sigma_t = medium.sigma_t.tolist()
    described = fog(
        sigma_t[0] if medium.grey else sigma_t,
        medium.albedo.tolist(),
        phase_function(medium.phase, 513),  # values where it is tabulated
    )
    return mi.load_dict(described | {"id": f"{medium.name}-medium"})


def _ball(position: Array, radius: float) -> mi.ScalarTransform4f:
    """Return the transform from the unit sphere to a sphere at a `position`, (3,), [m]."""
    return mi.ScalarTransform4f().translate(position.tolist()).scale(float(radius))


def _boundary(medium: Medium, filling: mi.Medium, around: mi.Medium | None) -> Plugin | mi.Mesh:
    if medium.bounds == "sphere":
        sphere: Plugin = {
            "type": "sphere",
            "to_world": _ball(medium.centre, medium.half[0]),
            "bsdf": {"type": "null"},
            "interior": filling,
        }
        return sphere if around is None else sphere | {"exterior": around}
    # Bodies of half sizes 1, which `half` scales; `media._BALLS` has the radii of the balls about
    # and within them.
    mesh = {"box": box((2.0, 2.0, 2.0)), "gem": gem(9, 4), "ellipsoid": icosphere(1)}[medium.bounds]
    mesh = placed(scaled(mesh, medium.half), medium.centre, rotation(*medium.turn))
    return medium_boundary(medium.name, mesh, filling, around)


def _light(drawn: Light) -> Plugin:
    colour, position, target = (
        values.tolist() for values in (drawn.colour, drawn.position, drawn.target)
    )
    direction = drawn.target - drawn.position
    if drawn.kind == "directional":
        return sun(direction.tolist(), colour)
    if drawn.kind == "point":
        return point_light(position, colour)
    if drawn.kind in AREA_KINDS:
        size = drawn.size if len(drawn.size) == 2 else drawn.size[0]
        lamp = area_lamp(drawn.kind, position, target, size, colour)
        if not drawn.black:
            lamp["material"] = {"type": "null"}
        # Mitsuba takes the rounding of the turn of a large sphere for shear, and warns.
        if drawn.kind == "sphere":
            lamp["to_world"] = _ball(drawn.position, drawn.size[0])
        return lamp
    # A spot that shines along the vertical needs another direction up.
    upright = abs(direction[2]) < 0.99 * np.linalg.norm(direction)
    return spot_light(
        colour,
        position=position,
        target=target,
        cutoff=drawn.cutoff,
        beam=drawn.beam,
        up=[0, 0, 1] if upright else [1, 0, 0],
    )


def _shape(occluder: Occluder) -> mi.Shape:
    if occluder.kind != "ball":
        return mitsuba_mesh(occluder.name, occluder.mesh, occluder.reflectance.tolist())
    diffuse = {
        "type": "diffuse",
        "reflectance": {"type": "rgb", "value": occluder.reflectance.tolist()},
    }
    ball = _ball(occluder.position, occluder.radius)
    return mi.load_dict(
        {
            "type": "sphere",
            "id": occluder.name,
            "to_world": ball,
            "bsdf": {"type": "twosided", "bsdf": diffuse},
        }
    )
