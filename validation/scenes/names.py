# SPDX-License-Identifier: BSD-3-Clause
"""The names of scenes: built-in ones, `random:SEED`, and paths of files.

A name is checked here without Mitsuba, so that a misspelt one is refused at once: the registry of
the built-in scenes imports it.
"""

import os
from functools import cache
from pathlib import Path
from urllib.parse import quote, unquote

from airlight.errors import InputError, nearest

#: The tables of the built-in scenes, in the order in which the scenes are listed.
FILES = tuple(
    Path(__file__).with_name(f"{name}.toml")
    for name in ("fog", "many_lights", "height_fog", "density_grid", "clouds")
)
PREFIX = "random:"
_SAFE = "/:\\"  # stands in a path as it is, besides letters, digits, '_', '.', '-' and '~'


@cache
def scene_names() -> tuple[str, ...]:
    """Return the names of the built-in scenes in their order."""
    import tomllib  # `airlight --help` needs none

    tables = (item for file in FILES for item in tomllib.loads(file.read_text("utf-8")).items())
    # A scene is a table with a purpose; parameters of engines have none.
    return tuple(name for name, table in tables if "purpose" in table)


def is_random(name: str) -> bool:
    """Return whether a name names a random scene."""
    return name.startswith(PREFIX)


def random_name(seed: int | str, ranges: Path | None = None) -> str:
    """Return the name of a random scene, which may be drawn from a file of ranges."""
    return f"{PREFIX}{seed}" + (
        f",ranges={quote(str(ranges.resolve()), safe=_SAFE)}" if ranges else ""
    )


def random_parts(name: str) -> tuple[int, Path | None]:
    """Return the seed in a name, and the file of ranges that it goes on with."""
    seed, comma, option = name.removeprefix(PREFIX).partition(",")
    if not (seed.isascii() and seed.isdecimal()):
        raise InputError(
            f"scene: got {name!r}, expected {PREFIX}SEED, a whole number, for example {PREFIX}7"
        )
    key, _, value = option.partition("=")
    if comma and (key != "ranges" or not value or "," in value):
        raise InputError(
            f"scene: got {option!r} in {name!r}, expected ranges=FILE.toml after the seed"
        )
    return int(seed), Path(unquote(value)) if comma else None


def is_pbrt(path: str | os.PathLike[str]) -> bool:
    """Return whether a path is meant as a scene of pbrt."""
    return Path(path).suffix.lower() == ".pbrt"


def scene_stem(name_or_path: str) -> str:
    """Return the stem of the names of a scene's files: its name, the stem of
    its path, or 'random-7'.
    """
    if is_random(name_or_path):
        return f"{PREFIX[:-1]}-{random_parts(name_or_path)[0]}"
    return Path(name_or_path).stem


def check_scene(scene: object) -> None:
    """Refuse a word that names no scene and no file; what is no word is checked
    where it is opened.
    """
    if not isinstance(scene, str | os.PathLike):
        return
    name = os.fspath(scene)
    if is_random(name):
        random_parts(name)
    elif name not in scene_names():
        scene_file(name)


def scene_file(name_or_path: str) -> Path:
    """Return the file of a scene that is not built in; refuse a word that is none."""
    path, names = Path(name_or_path), scene_names()
    if name_or_path.strip() and path.is_dir():
        raise InputError(
            f"scene: {name_or_path} is a folder; expected the path of a Mitsuba XML or pbrt file in it"
        )
    if path.is_file():
        return path
    # A name with an extension or a separator was meant as a path; anything else as a name, whose
    # spelling the message then helps with.
    if path.suffix or os.sep in name_or_path:
        raise InputError(
            f"scene: there is no file {name_or_path}; expected a Mitsuba XML or pbrt file, random:SEED "
            f"or one of {', '.join(names)}"
        )
    raise InputError(
        f"scene: got {name_or_path!r}, expected one of {', '.join(names)}, random:SEED or the path "
        f"of a Mitsuba XML or pbrt file{nearest(name_or_path, names)}"
    )
