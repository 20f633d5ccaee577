# SPDX-License-Identifier: BSD-3-Clause
"""A seed to the record of a scene.

Parts are drawn in radii of the stage about the origin; at the end all is scaled and moved to an arbitrary place.
"""

import numpy as np
from numpy.typing import NDArray

from validation.random_scenes.brightness import ways
from validation.random_scenes.cameras import draw_camera
from validation.random_scenes.casters import PlacedCaster, draw_casters, draw_ground
from validation.random_scenes.design import Draws
from validation.random_scenes.drawn import (
    AREA_KINDS,
    Colour,
    DrawnCamera,
    DrawnCaster,
    DrawnLight,
    DrawnMedium,
    DrawnScene,
    Vector,
)
from validation.random_scenes.lights import PlacedLight, draw_lights
from validation.random_scenes.media import PlacedMedium, draw_media
from validation.random_scenes.ranges import Ranges

Array = NDArray[np.float64]


def draw_scene(seed: int, ranges: Ranges, attempt: int = 0) -> DrawnScene:
    """Return the scene of a seed.

    Parameters
    ----------
    seed
        From 0 to `design.LARGEST_SEED`.
    ranges
        What is drawn from where to where.
    attempt
        The coordinates of the point are the same for every attempt; places and shapes are others.

    Raises
    ------
    InputError
        For a seed that no scene has.
    """
    draws = Draws(seed, attempt)
    scale = draws.logarithmic(*ranges.scale, "scale")
    camera, target, fov = draw_camera(draws, ranges)
    media = draw_media(draws, ranges, camera)
    seen = ways(media, camera, target, float(np.linalg.norm(camera)) + 1.0)
    lights = draw_lights(draws, ranges, media, camera, seen)
    in_shadow = draws.pick(ranges.camera_in, "camera_in") == "shadow"
    casters = draw_casters(draws, ranges, camera, lights, in_shadow=in_shadow)
    casters += draw_ground(draws, ranges, camera, lights, casters)
    stream = draws.of("place")
    centre = scale * np.array([stream.between(-2.3, 2.3) for _ in range(3)])
    media_names = ["endless" if medium.bounds == "endless" else f"medium-{k}" for k, medium in enumerate(media, 1)]
    inside = [name for medium, name in zip(media, media_names, strict=True) if medium.holds_camera]
    return DrawnScene(
        seed,
        attempt,
        scale,
        _vector(centre),
        DrawnCamera(
            _vector(centre + scale * camera),
            _vector(centre + scale * target),
            fov,
            inside[-1] if inside else "clear air",
            in_shadow,
        ),
        tuple(_medium(*pair, scale, centre) for pair in zip(media, media_names, strict=True)),
        tuple(_light(light, f"light-{number}", scale, centre) for number, light in enumerate(lights, 1)),
        tuple(
            _caster(caster, name, scale, centre)
            for caster, name in zip(casters, _named([each.kind for each in casters]), strict=True)
        ),
    )


def _named(kinds: list[str]) -> list[str]:
    return [f"{kind}-{kinds[:number].count(kind) + 1}" for number, kind in enumerate(kinds)]


def _vector(values: Array) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _colour(values: Array) -> Colour:
    return _vector(values)


def _medium(medium: PlacedMedium, name: str, scale: float, centre: Array) -> DrawnMedium:
    sigma_t = medium.sigma_t / scale
    endless = medium.bounds == "endless"
    return DrawnMedium(
        name,
        medium.bounds,
        (float(sigma_t[0]),) if medium.grey else _colour(sigma_t),
        _colour(medium.albedo),
        medium.phase,
        medium.optical_depth,
        (0.0, 0.0, 0.0) if endless else _vector(centre + scale * medium.centre),
        _vector(scale * medium.half),
        (_vector(medium.axis), medium.angle),
    )


def _light(light: PlacedLight, name: str, scale: float, centre: Array) -> DrawnLight:
    # Intensity is in W/sr: it lights with its square of the distance. Radiance and irradiance do not.
    spreads = light.kind != "directional" and light.kind not in AREA_KINDS
    # Extinction is over a length, so a stage twice as large scatters as much: its light comes from twice as far.
    colour = light.colour * (scale**2 if spreads else 1.0)
    return DrawnLight(
        name,
        light.kind,
        _vector(centre + scale * light.position),
        _vector(centre + scale * light.target),
        _colour(colour),
        light.brightness,
        tuple(scale * value for value in light.size),
        light.cutoff,
        light.beam,
        light.black,
    )


def _caster(caster: PlacedCaster, name: str, scale: float, centre: Array) -> DrawnCaster:
    return DrawnCaster(
        name,
        caster.kind,
        caster.numbers,
        _vector(centre + scale * caster.position),
        scale * caster.radius,
        (_vector(caster.axis), caster.angle),
        _colour(caster.reflectance),
    )
