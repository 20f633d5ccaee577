# SPDX-License-Identifier: BSD-3-Clause
"""The file `frames.json`: the state of the scene in each frame of a renderer, and the file of each.

```json
{"schema": "airlight-frames/1", "scene": "hall", "first": 1, "frames": 2, "fps": 60, "exposure": 0,
 "layer": "airlight", "pixel": "centre", "resets": [0], "changes": {"light.position": [[0.1, 2,
 3.1], [0.1, 2.1, 3.1]]}}
```

`first`: number of the file that shows frame 0; `exposure`: stops, one number or a list: values are
divided by 2^stops; `resets`: frames with which a history begins; `jitter`: by frame how far right
of and below the pixel centres its rays pass [pixels]; `changes`: a list by frame for each name of
`--change`; `objects`: for each shape that moves a list by frame of matrices, 4 x 4, that take it
from its place in the scene [m].
"""

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from airlight.errors import InputError, nearest
from airlight.validation.readers import (
    Reader,
    by_name,
    read_list,
    read_number,
    read_whole,
    read_word,
)

SCHEMA = "airlight-frames/1"
_MARK = "#"
_MOST = 1_000_000_000
_number = partial(read_number, least=-1e30, most=1e30)
# A factor of 2^100 is 1e30; float64 has no number for some thousand stops.
_stop = partial(read_number, least=-100, most=100)

_Value = TypeVar("_Value")
Matrix = tuple[tuple[float, ...], ...]  #: 4 x 4, by rows: from the place in the scene [m]


@dataclass(frozen=True)
class FramesRecord:
    """The description of a sequence of frames."""

    frames: int
    scene: str | None = None
    first: int = 1
    fps: float | None = None
    exposure: float | tuple[float, ...] = 0.0  #: [stops]
    layer: str | None = None
    pixel: str | None = None
    resets: tuple[int, ...] = (0,)
    jitter: tuple[tuple[float, ...], ...] | None = None  #: right and down [pixels]
    changes: Mapping[str, tuple[tuple[float, ...], ...]] = field(default_factory=dict)
    objects: Mapping[str, tuple[Matrix, ...]] = field(default_factory=dict)

    def stops(self, frame: int) -> float:
        """Return the exposure of a frame [stops]."""
        return self.exposure[frame] if isinstance(self.exposure, tuple) else self.exposure

    def shown(
        self, frame: int
    ) -> tuple[dict[str, tuple[float, ...]], dict[str, Matrix], tuple[float, ...]]:
        """Return the state of a frame: changes and matrices of moving shapes by name, and
        the jitter of its pixels.
        """
        changes = {name: values[frame] for name, values in self.changes.items()}
        moves = {name: matrices[frame] for name, matrices in self.objects.items()}
        return changes, moves, self.jitter[frame] if self.jitter else (0.0, 0.0)

    def text(self) -> str:
        """Return the file."""
        return json.dumps(
            {"schema": SCHEMA} | {k: v for k, v in asdict(self).items() if v is not None}
        )


def read_frames(path: str | os.PathLike[str]) -> FramesRecord:
    """Read `frames.json`.

    Raises InputError if it cannot be read, has a key that is not known or a value of another kind,
    or lists of other lengths than there are frames.
    """
    try:
        given = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(
            f"{path}: cannot be read as JSON: {reason}; see docs/your-engine.md for an example"
        ) from error
    # An object with known names, of which the number of frames is needed.
    if not isinstance(given, dict) or given.pop("schema", SCHEMA) != SCHEMA:
        raise InputError(f'{path}: expected an object with "schema": "{SCHEMA}"')
    for name in given.keys() - _KINDS.keys():
        raise InputError(
            f"{path}: got {name!r}, expected some of {', '.join(_KINDS)}{nearest(name, _KINDS)}"
        )
    if "frames" not in given:
        raise InputError(f'{path}: the number of frames is missing; expected such as "frames": 60')
    # Each key has a reader of its kind of value; `null` stands for the default.
    read = {
        name: _KINDS[name](f"{path}: {name}", value)
        for name, value in given.items()
        if value is not None
    }
    record = FramesRecord(**read)
    # Every list by frame must have a value for each frame: a shorter one would shift the rest.
    lists: dict[str, tuple[object, ...]] = {**record.changes, **record.objects}
    lists |= {"exposure": record.exposure} if isinstance(record.exposure, tuple) else {}
    lists |= {"jitter": record.jitter} if record.jitter is not None else {}
    for name, values in lists.items():
        if len(values) != record.frames:
            raise InputError(
                f"{path}: {name} has {len(values)} values, expected one for each of "
                f"{record.frames} frames"
            )
    for reset in record.resets:
        if not 0 <= reset < record.frames:
            raise InputError(
                f"{path}: resets has {reset}, expected frames from 0 to {record.frames - 1}"
            )
    return record


def frame_paths(
    pattern: str | os.PathLike[str], record: FramesRecord, about: str
) -> tuple[Path, ...]:
    """Return the file of each frame: in the pattern, the signs # stand for
    the digits of its number.

    `about`: the file that says which frames there are. Raises InputError for a pattern without #,
    and a frame without a file.
    """
    text = str(pattern)
    # The marks must be in one place: `a#b#` says no number.
    start, digits = text.find(_MARK), text.count(_MARK)
    if not digits or _MARK * digits not in text:
        raise InputError(
            f"test: got {text}, expected the files of all frames with # for each digit, such as "
            "frames/####.exr"
        )
    paths = []
    for frame in range(record.frames):
        number = record.first + frame
        paths.append(Path(text[:start] + f"{number:0{digits}d}" + text[start + digits :]))
        if not paths[-1].is_file():
            raise InputError(
                f"frame {frame} has no file: there is no {paths[-1]}; {about} wants "
                f"{record.frames} frames from number "
                f"{record.first} on"
            )
    return tuple(paths)


def _by_frame(read: Reader[_Value]) -> Reader[tuple[_Value, ...]]:
    """Return a reader of a list with a value for each frame."""
    return lambda what, value: tuple(
        read(f"{what}[{n}]", each) for n, each in enumerate(read_list(what, value, 0))
    )


def _stops(what: str, value: object) -> float | tuple[float, ...]:
    return _by_frame(_stop)(what, value) if isinstance(value, list) else _stop(what, value)


def _values(what: str, value: object) -> tuple[float, ...]:
    return _by_frame(_number)(what, value) if isinstance(value, list) else (_number(what, value),)


def _offset(what: str, value: object) -> tuple[float, ...]:
    offset = _by_frame(_number)(what, value)
    # A jitter of more than a pixel is in other units: of the film, or of half of it.
    if len(offset) != 2 or max(map(abs, offset)) > 1.0:
        raise InputError(f"{what}: got {value!r}, expected right and down [pixels], each at most 1")
    return offset


def _matrix(what: str, value: object) -> Matrix:
    expected = "a 4 x 4 matrix by rows: a rotation times a scale, a shift, and 0 0 0 1"
    rows = [
        [_number(what, each) for each in read_list(what, row, 0)]
        for row in read_list(what, value, 0)
    ]
    if [len(row) for row in rows] != [4] * 4 or rows[3] != [0, 0, 0, 1]:
        raise InputError(f"{what}: got {value!r}, expected {expected}")
    turn = np.array(rows)[:3, :3]
    # A scale by axis would make other shapes of spheres, a mirror would turn them inside out.
    scale = np.cbrt(np.linalg.det(turn))
    if scale <= 0 or not np.allclose(
        turn @ turn.T, scale**2 * np.eye(3), atol=1e-5 * scale**2, rtol=0
    ):
        raise InputError(
            f"{what}: got axes that are not a rotation times a scale, expected {expected}"
        )
    return tuple(map(tuple, rows))


_KINDS: dict[str, Reader[Any]] = {
    "frames": partial(read_whole, least=2, most=_MOST),
    "scene": read_word,
    "first": partial(read_whole, least=0, most=_MOST),
    "fps": partial(read_number, least=1e-6, most=_MOST),
    "exposure": _stops,
    "layer": read_word,
    "pixel": read_word,
    "resets": _by_frame(partial(read_whole, least=0, most=_MOST)),
    "jitter": _by_frame(_offset),
    "changes": by_name(_by_frame(_values)),
    "objects": by_name(_by_frame(_matrix)),
}
