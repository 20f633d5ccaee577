# SPDX-License-Identifier: BSD-3-Clause
"""The certified scenes as data that a renderer's author sets up by hand, with the expected pixels."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from airlight.reference.storage.build import build
from airlight.reports.kit.rows import SINGLE
from airlight.validation.certified.files import certified_data

#: Tolerance of a renderer without noise: of the value, and of the mean of the image. The second is
#: for rays along the edge of a shadow, whose ends move by roundings of positions.
OF_VALUE, OF_MEAN = 1e-4, 1e-5
REASON = (
    "The certified error is the bound of each pixel. The tolerance is for a renderer without noise "
    f"in single precision: three times {SINGLE:g}, the error of the exported kernel on any device that "
    "keeps the bounds of Vulkan, rounded up; and 1e-5 of the mean, as ends of shadows move by "
    "roundings of positions. With noise, take six standard errors of the mean over 24 seeds or more "
    "beside it. In double precision with exact shadows 1e-9 does."
)

Vector = tuple[float, ...]


@dataclass(frozen=True)
class KitScene:
    """A certified scene; `data` is its entry in the certified file."""

    name: str
    words: str
    data: Mapping[str, Any]

    @property
    def matrix(self) -> list[Vector]:
        """The columns of the camera: left, up, forward and position."""
        rows = self.data["mitsuba"]["sensor"]["to_world"]["matrix"]
        return [tuple(row[column] for row in rows[:3]) for column in range(4)]

    @property
    def fov(self) -> float:
        """The angle of view, horizontal and vertical [degrees]."""
        return float(self.data["mitsuba"]["sensor"]["fov"])

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image [pixels]."""
        film = self.data["mitsuba"]["sensor"]["film"]
        return film["width"], film["height"]


def kit_scenes() -> tuple[KitScene, ...]:
    """Return the certified scenes."""
    scenes = json.loads(certified_data().read_text(encoding="utf-8"))["scenes"]
    return tuple(KitScene(scene["name"], scene["words"], scene) for scene in scenes)


def scene_json(scene: KitScene) -> str:
    """Return a scene with its set-up in words and numbers, and the certified pixels, one a line."""
    left, up, forward, position = scene.matrix
    medium = {"g": 0.0} | scene.data["medium"]
    width, height = scene.size
    head = {
        "schema": "airlight-kit-scene/1",
        "license": "MIT-0",
        "build": build().words,
        "name": scene.name,
        "words": scene.words,
        "set_up": _set_up(scene),
        "camera": {
            "position": position,
            "forward": forward,
            "right": [-value + 0.0 for value in left],
            "up": up,
            "fov": scene.fov,
            "size": [width, height],
        },
        "medium": medium,
        "lights": scene.data["lights"],
        "occluders": scene.data["occluders"],
        "tolerance": {"of_value": OF_VALUE, "of_mean": OF_MEAN, "reason": REASON},
    }
    lines = ["{"]
    lines += [f" {json.dumps(name)}: {json.dumps(value)}," for name, value in head.items()]
    pixels = [_pixel(scene, number) for number in range(width * height)]
    return "\n".join([*lines, ' "pixels": [', ",\n".join(pixels), " ]", "}"]) + "\n"


def _pixel(scene: KitScene, number: int) -> str:
    """Return a pixel as JSON, whose numbers are the words of the certified file."""
    row, column = divmod(number, scene.size[0])
    pixel = scene.data["pixels"][number]
    direction = json.dumps(scene.data["camera"]["directions"][number])
    distance = "null" if pixel["distance"] == "inf" else pixel["distance"]
    radiance, bound = (", ".join(pixel[name]) for name in ("radiance", "bound"))
    return (
        f'  {{"column": {column}, "row": {row}, "direction": {direction}, "distance": {distance}, '
        f'"radiance": [{radiance}], "bound": [{bound}]}}'
    )


def _set_up(scene: KitScene) -> list[str]:
    """Return the ten lines that say how a scene is set up."""
    _, up, forward, position = scene.matrix
    medium = scene.data["medium"]
    phases = {
        "isotropic": "1/(4 pi)",
        "rayleigh": "3 (1 + cos^2)/(16 pi)",
        "hg": f"Henyey and Greenstein's, g = {medium.get('g', 0.0)}, positive forward",
    }
    width, height = scene.size
    return [
        "Lengths in m, z is up, axes are right-handed; numbers are exact in float32.",
        f"Camera: at {_words(position)}, looks along {_words(forward)}, up {_words(up)}.",
        f"Image: {width} x {height} square pixels, {scene.fov} degrees across; a pixel is the ray "
        "through its centre, row 0 at the top.",
        f"Fog: everywhere, homogeneous; extinction {_words(medium['sigma_t'])} 1/m, albedo "
        f"{_words(medium['albedo'])} (R, G, B).",
        f"Phase function [1/sr]: {phases[medium['phase']]}.",
        f"Lights, without size, intensity in W/sr: {'; '.join(map(_light, scene.data['lights']))}.",
        f"Occluders, black: {'; '.join(map(_occluder, scene.data['occluders'])) or 'none'}.",
        "Light: single scattering alone; no sky, no ambient light, no emission, no other order.",
        "Light falls as 1/r^2 and by exp(-extinction length) along both of its ways, with hard "
        "shadows and no end.",
        "Pixel: linear radiance in W/(m^2 sr), without exposure, tone mapping or clamping.",
    ]


def _words(numbers: Any) -> str:
    return f"({', '.join(f'{number:.9g}' for number in numbers)})"


def _light(light: Mapping[str, Any]) -> str:
    words = f"{light['type']} at {_words(light['position'])}, {_words(light['intensity'])}"
    if light["type"] == "point":
        return words
    return (
        f"{words} within {light['beam']} degrees of the axis {_words(light['axis'])}, from there "
        f"linear in the angle to 0 at {light['cutoff']}"
    )


def _occluder(shape: Mapping[str, Any]) -> str:
    if shape["type"] == "sphere":
        return f"sphere about {_words(shape['centre'])}, radius {shape['radius']:.9g}"
    edges = ", ".join(_words(edge) for edge in shape["half_edges"])
    return f"{shape['type']} about {_words(shape['centre'])}, half edges {edges}"
