# SPDX-License-Identifier: BSD-3-Clause
"""A scene with less and more of one kind of work, step by step.

| kind | work | what changes |
|---|---|---|
| `size` | pixels | the image has half, twice and four times the width and height |
| `triangles` | triangles of opaque meshes | each is cut into four, with bumps (`validation.study.subdivision`) |
| `lights` | lights without extent | each stands beside itself again, with its fraction of the intensity |
| `media` | bounded media | the last ones are left out |
| `map` | texels on a side of a shadow map | the parameter `map` |

The other kinds keep the image at the size that is asked for.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from analytic.errors import InputError
from realtime.scene.animate import turned_light
from realtime.scene.lights import Light
from realtime.scene.read_media import sort_shapes
from realtime.scene.read_scene import Scene, read_scene
from validation.scenes.loading import load_scene
from validation.scenes.meshes import rotation
from validation.study.subdivision import subdivided, triangles_of, with_shapes

KINDS = ("size", "triangles", "lights", "media", "map")
MOST_TRIANGLES = 5_300_000  #: a mesh of so many takes some gigabytes with what is made of it
_SIDES = (0.5, 1, 2, 4)  # of the image
_COPIES = (1, 2, 4, 8)  # of each light
_MAPS = (128, 256, 512, 1024, 2048)
_ASIDE = 0.07  # between the copies of a light, as a share of its distance from the camera
_TURN = 2.3  # between the copies of a light from infinity [degrees]


@dataclass(frozen=True)
class Step:
    """A scene with some work."""

    work: float  #: of its kind
    scene: Callable[[], Scene]
    parameters: Mapping[str, Any] = field(default_factory=dict)  #: of the method, beside the configuration's own


def ladder(kind: str, name_or_path: str, size: tuple[int, int]) -> list[Step]:
    """Return the steps of a kind of work, of `KINDS`, for a scene at a size [pixels], the least work first.

    A scene that has nothing of the kind of which there could be less or more is refused.
    """
    makers = {"size": _sizes, "triangles": _triangles, "lights": _lights, "media": _media, "map": _maps}
    if kind not in makers:
        raise InputError(f"scaling: got {kind!r}, wanted some of {', '.join(KINDS)}, with commas between them")
    return makers[kind](name_or_path, size)


def _sizes(name: str, size: tuple[int, int]) -> list[Step]:
    width, height = size
    sizes = [(max(1, round(width * factor)), max(1, round(height * factor))) for factor in _SIDES]
    return [Step(at[0] * at[1], partial(_read, name, at)) for at in sizes]


def _read(name: str, size: tuple[int, int]) -> Scene:
    return read_scene(load_scene(name, size).scene)


def _triangles(name: str, size: tuple[int, int]) -> list[Step]:
    count = triangles_of(load_scene(name, size).scene)
    levels = [level for level in range(10) if 0 < count * 4**level <= MOST_TRIANGLES]
    if len(levels) < 2:
        raise InputError(
            f"scaling triangles: {name} has {count} triangles of opaque meshes; wanted some, and four times as many "
            f"not more than {MOST_TRIANGLES}; use another scene"
        )
    return [Step(count * 4**level, partial(_finer, name, size, level)) for level in levels]


def _finer(name: str, size: tuple[int, int], level: int) -> Scene:
    return read_scene(subdivided(load_scene(name, size).scene, level))


def _lights(name: str, size: tuple[int, int]) -> list[Step]:
    scene = _read(name, size)
    count = len(scene.lights)
    if not count:
        raise InputError(f"scaling lights: {name} has lights with extent only; wanted a point, spot or directional one")
    return [Step(count * copies, partial(with_copies, scene, copies)) for copies in _COPIES]


def with_copies(scene: Scene, copies: int) -> Scene:
    """Return a scene in which each light without extent stands several times, with its fraction of the intensity."""
    here = np.array(scene.camera.origin, dtype=np.float64).ravel()
    lights = tuple(_copy(light, number, copies, here) for light in scene.lights for number in range(copies))
    kinds = [light.kind for light in lights]
    counts: dict[str, Any] = {f"{kind}_lights": kinds.count(kind) for kind in ("point", "spot", "directional")}
    return replace(scene, lights=lights, features=replace(scene.features, **counts))


def _copy(light: Light, number: int, copies: int, camera) -> Light:
    light = replace(light, intensity=light.intensity / copies)
    if number == 0:
        return light
    position = np.array(light.position, dtype=np.float64).ravel()
    if light.extent is not None:
        return turned_light(light, position, rotation((0.31, 0.53, 0.79), _TURN * number))
    step = _ASIDE * np.linalg.norm(position - camera)
    aside = step * number**0.5 * np.array([np.cos(2.4 * number), np.sin(2.4 * number), 0.3 * np.cos(1.7 * number)])
    return replace(light, position=type(light.position)(*(float(c) for c in position + aside)))


def _media(name: str, size: tuple[int, int]) -> list[Step]:
    boundaries = sort_shapes(load_scene(name, size).scene)[1]
    if len(boundaries) < 2:
        raise InputError(
            f"scaling media: {name} has {len(boundaries)} bounded media, wanted two or more; use three-media, or a "
            "scene of your own"
        )
    return [Step(count, partial(_fewer_media, name, size, count)) for count in range(1, len(boundaries) + 1)]


def _fewer_media(name: str, size: tuple[int, int], count: int) -> Scene:
    """Return a scene with the first of its bounded media."""
    scene = load_scene(name, size).scene
    left_out = {shape.id() for shape in sort_shapes(scene)[1][count:]}
    return read_scene(with_shapes(scene, [shape for shape in scene.shapes() if shape.id() not in left_out]))


def _maps(name: str, size: tuple[int, int]) -> list[Step]:
    return [Step(side, partial(_read, name, size), {"map": side}) for side in _MAPS]
