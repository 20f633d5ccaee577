# SPDX-License-Identifier: BSD-3-Clause
"""The file check.json: which frames of a renderer are related, and how.

```json
{"schema": "airlight-check/1", "again": ["base.exr", "base-again.exr"], "format": "half",
 "relations": [{"name": "intensity", "frames": ["base.exr", "twice.exr"], "factor": 2},
               {"name": "units", "frames": ["base.exr", "doubled.exr"]},
               {"name": "pan", "frames": ["base.exr", "panned.exr"],
                "cameras": [{"forward": [0, 1, 0], "fov": 60}, {"forward": [0.3, 0.95, 0], "fov": 60}]}]}
```

`scene`: a name, for words alone; `format`: of the values, float32, half or r11g11b10; `layer`: to
judge, of one relation or of all. Paths are those of EXR files beside check.json. Fields of a relation:
`factor`: by which light, exposure or albedo grew, 2 by default; `order`: of the colours, [1, 2, 0]
by default; `mirrored`: whether left and right changed; `value`: of a furnace; `cameras`: see
`Camera`.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from airlight.errors import InputError, nearest
from airlight.validation.arrays import Array

SCHEMA = "airlight-check/1"
FILE = "check.json"
#: Relative roundings of a value, half a unit in the last place over all mantissas (RMS).
ROUNDING = {"float32": 1e-6, "half": 2.8e-4, "r11g11b10": 8e-3}


def _cosine(cosine: Array, cone: float) -> Array:
    edge = math.cos(cone)
    return np.maximum((cosine - edge) / (1 - edge), 0.0)


def _cosine_squared(cosine: Array, cone: float) -> Array:
    return _cosine(cosine, cone) ** 2


def _cosine_smooth(cosine: Array, cone: float) -> Array:
    t = _cosine(cosine, cone)
    return t * t * (3 - 2 * t)


def _linear(cosine: Array, cone: float) -> Array:
    # In the angle, as Mitsuba's spot whose beam has no width.
    return np.maximum(1 - np.arccos(np.minimum(cosine, 1.0)) / cone, 0.0)


FALLOFFS: dict[str, Callable[[Array, float], Array]] = {
    "cosine": _cosine,
    "cosine-squared": _cosine_squared,
    "cosine-smooth": _cosine_smooth,
    "linear": _linear,
}
_RIM = "rim:"  # and a power k: 1 - ((1 - c)/(1 - c of the edge))^k


def _falloff(words: str) -> Callable[[Array, float], Array] | None:
    """Return the falloff of a word; None for a word that is none."""
    if not words.startswith(_RIM):
        return FALLOFFS.get(words)
    try:
        power = float(words.removeprefix(_RIM))
    except ValueError:
        return None
    # `_cosine` is the rest of (1 - c)/(1 - c of the edge) to 1.
    return (lambda c, cone: 1 - (1 - _cosine(c, cone)) ** power) if 0 < power < math.inf else None


@dataclass(frozen=True)
class Camera:
    """Where a camera looks; its pixels are squares."""

    fov: float  #: of the whole width [degrees]
    forward: tuple[float, float, float] = (0.0, 1.0, 0.0)
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    cone: float | None = None  #: half angle within which it is sensitive [degrees]
    #: how its sensitivity, that of a spot in its place, falls to the edge of the cone
    falloff: str = "cosine-squared"

    def _axes(self) -> tuple[Array, Array, Array]:
        forward = _unit("forward", self.forward)
        right = np.cross(forward, _unit("up", self.up))
        if np.linalg.norm(right) < 1e-6:
            raise InputError("cameras: forward and up are parallel; expected two directions")
        right /= np.linalg.norm(right)
        return right, -np.cross(right, forward), forward

    def _half(self) -> float:
        if not 0 < self.fov < 180:
            raise InputError(f"cameras: got a fov of {self.fov:g}; expected degrees from 0 to 180")
        return math.tan(math.radians(self.fov) / 2)

    def directions(self, width: int, height: int) -> Array:
        """Return unit directions through the pixel centres, (height, width, 3)."""
        right, down, forward = self._axes()
        x, y = self._plane(width, height)
        ways = x[..., None] * right + y[..., None] * down + forward
        return ways / np.linalg.norm(ways, axis=2, keepdims=True)

    def _plane(self, width: int, height: int) -> tuple[Array, Array]:
        """Return where pixel centres lie in the plane at the distance 1."""
        half = self._half()
        x = half * ((np.arange(width) + 0.5) * 2 / width - 1)
        y = half * ((np.arange(height) + 0.5) * 2 / width - height / width)
        return np.broadcast_to(x, (height, width)), np.broadcast_to(y[:, None], (height, width))

    def pixels(self, directions: Array, width: int, height: int) -> tuple[Array, Array]:
        """Return the columns and rows that directions have, NaN behind the camera."""
        right, down, forward = self._axes()
        ahead = directions @ forward
        ahead = np.where(ahead > 1e-6, ahead, np.nan)
        half = self._half()
        x, y = (directions @ right) / ahead / half, (directions @ down) / ahead / half
        column = (x + 1) * width / 2 - 0.5
        row = (y + height / width) * width / 2 - 0.5
        return np.nan_to_num(column, nan=-1.0), np.nan_to_num(row, nan=-1.0)

    def sensitivity(self, width: int, height: int) -> Array:
        """Return the weight of each pixel within the cone: 1 on the axis, 0 from its edge on."""
        law = _falloff(self.falloff)
        if self.cone is None or law is None:
            raise InputError(
                f"cameras: got a cone of {self.cone} and the falloff {self.falloff!r}; expected "
                f"degrees, and one of {', '.join(FALLOFFS)}, {_RIM}POWER"
            )
        # A cone that the frame cuts off has no whole sum; one that touches its edge is whole, but
        # for the rounding of a tangent and its inverse.
        shown = math.degrees(math.atan(self._half() * min(1.0, height / width)))
        if not 0 < self.cone <= shown * (1 + 1e-9):
            raise InputError(
                f"cameras: got a cone of {self.cone:g} degrees in a frame that shows {shown:.4g} to "
                "its nearest edge; expected a frame that holds all of the cone"
            )
        x, y = self._plane(width, height)
        return law(1 / np.sqrt(1 + x * x + y * y), math.radians(self.cone))

    def solid_angles(self, width: int, height: int) -> Array:
        """Return the solid angle of each pixel [sr]."""
        x, y = self._plane(width, height)
        side = 2 * self._half() / width
        return side * side / (1 + x * x + y * y) ** 1.5


def _unit(name: str, values: tuple[float, ...]) -> Array:
    vector = np.array(values, dtype=np.float64)
    length = np.linalg.norm(vector)
    if not np.isfinite(length) or length == 0:
        raise InputError(f"cameras: got {name} {list(values)}; expected a direction")
    return vector / length


@dataclass(frozen=True)
class Asked:
    """A relation that frames should keep, with its numbers."""

    name: str
    frames: tuple[str, ...]
    factor: float = 2.0
    order: tuple[int, int, int] = (1, 2, 0)
    mirrored: bool = False
    value: tuple[float, ...] = ()
    cameras: tuple[Camera, ...] = ()
    layer: str | None = None


@dataclass(frozen=True)
class CheckFile:
    """The content of check.json."""

    relations: tuple[Asked, ...]
    schema: str = SCHEMA
    scene: str | None = None
    again: tuple[str, ...] = ()
    format: str = "float32"
    layer: str | None = None


def read_check(path: Path) -> CheckFile:
    """Read check.json, given by its path or by its folder.

    Raises InputError if it cannot be read, or has a key that is not known or a value of another
    kind.
    """
    file = path / FILE if path.is_dir() else path
    try:
        data: Any = msgspec.json.decode(file.read_bytes())
    except OSError as error:
        raise InputError(f"{file}: {error.strerror}; expected the folder of a {FILE}") from error
    except msgspec.DecodeError as error:
        raise InputError(f"{file}: is no JSON: {error}") from error
    try:
        check = msgspec.convert(data, CheckFile)
    except msgspec.ValidationError as error:
        raise InputError(f"{file}: {error}; see docs/checks.md for an example") from error
    # A key that nobody knows would be dropped without a word.
    _check_keys(file, data, CheckFile)
    for asked in data["relations"]:
        _check_keys(file, asked, Asked)
        for camera in asked.get("cameras", ()):
            _check_keys(file, camera, Camera)
    if check.schema != SCHEMA:
        raise InputError(f"{file}: got the schema {check.schema!r}, expected {SCHEMA!r}")
    if check.format not in ROUNDING:
        raise InputError(
            f"{file}: got the format {check.format!r}, expected one of {', '.join(ROUNDING)}"
        )
    return check


def _check_keys(file: Path, data: dict[str, Any], kind: type) -> None:
    known = [each.name for each in fields(kind)]
    for name in data.keys() - {*known}:
        raise InputError(
            f"{file}: got the key {name!r}, expected some of {', '.join(known)}"
            f"{nearest(name, known)}"
        )


def named_frames(check: CheckFile) -> dict[str, Any]:
    """Return the content of check.json, with the file NAME.exr for each frame of a name."""

    def files(names: Sequence[str]) -> list[str]:
        return [f"{name}.exr" for name in names]

    relations = [
        {key: value for key, value in asdict(each).items() if value != usual.get(key)}
        | {"frames": files(each.frames)}
        for each in check.relations
        for usual in [asdict(Asked("", ()))]
    ]
    told = {"schema": check.schema, "scene": check.scene, "again": files(check.again)}
    return told | {"format": check.format, "relations": relations}
