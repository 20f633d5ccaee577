# SPDX-License-Identifier: BSD-3-Clause
"""Loading of scenes by name or by path; input is checked before any work is done."""

from __future__ import annotations

import hashlib
import re
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import count
from pathlib import Path
from types import MappingProxyType

import mitsuba as mi

from airlight.errors import InputError
from airlight.realtime.scene.rounding import check_rounding
from airlight.reference.scene.model import PHYSICAL, Model
from airlight.reference.storage.code import source_digest
from airlight.reference.storage.scene_digest import give_description, is_whole, scene_digest
from airlight.validation.scenes.bodies import check_bodies
from airlight.validation.scenes.changes import (
    change_scene,
    checked_changes,
    isotropic_media,
    scene_with_lobes,
)
from airlight.validation.scenes.files.camera import Lens, x_fov
from airlight.validation.scenes.files.text import named_in
from airlight.validation.scenes.height_fog import register_height_fog
from airlight.validation.scenes.models import DEFAULT, model_of
from airlight.validation.scenes.names import PREFIX, is_random, random_parts, scene_file
from airlight.validation.scenes.numbers import check_numbers
from airlight.validation.scenes.random.design import FILE as RANGES
from airlight.validation.scenes.random.design import read_ranges
from airlight.validation.scenes.registry import SCENES, Animation, SceneRecord

_LARGEST = 16384


@dataclass(frozen=True)
class LoadedScene:
    """A Mitsuba scene and where it came from."""

    name: str  #: name of the built-in or random scene, or stem of the file
    scene: mi.Scene
    purpose: str  #: one sentence: what the scene is for
    published: str  #: the published figure that it stands for; empty for a file
    path: Path | None = None  #: of the file; None for a built-in or random scene
    animation: Animation = field(default_factory=Animation)  #: what moves in it
    model: Model = PHYSICAL  #: the equation that its file names
    fog_engine: str = ""  #: the engine whose height fog its file has
    lens: Lens | None = None  #: of its description; None for a horizontal angle of view


def load_scene(
    name_or_path: str,
    size: tuple[int, int] | None = None,
    changes: Mapping[str, Sequence[float]] = MappingProxyType({}),
) -> LoadedScene:
    """Load a built-in scene, a Mitsuba XML file or a pbrt file into the active variant.

    `name_or_path`: a name of `validation.scenes.registry.SCENES`, `random:SEED`, or the path of a
    scene file of Mitsuba, or of pbrt, which ends in .pbrt; `size`: width and height of the image
    [pixels], by default the size that the scene has; another one keeps the angle of view along the
    axis that a file of Mitsuba says, else the horizontal one; `changes`: values by name that
    replace those of the scene, see `validation.scenes.changes`.

    Raises InputError for an unknown name, a missing or malformed file, a size that no image can
    have, and a change that the scene cannot have. Whether methods and reference support the scene
    is checked when they read it.
    """
    register_height_fog()
    if size is not None:
        _check_size(size)
    record = find_record(name_or_path)
    path = Path()
    if record is not None:
        # Not optimised: merged shapes would lose their names.
        built = mi.load_dict(record.build(), optimize=False)
        # Where Mitsuba does not tell every property of a built scene, the name and the digest of
        # the code that builds it are its identity.
        if record.digest and not is_whole(built):
            give_description(
                built, f"{record.name} {source_digest('airlight.validation.scenes.registry')}"
            )
        loaded = LoadedScene(
            record.name, built, record.purpose, record.published, animation=record.animation
        )
    else:
        path = scene_file(name_or_path)
        (scene, lens), named = _read(path), named_in(path, DEFAULT)
        loaded = LoadedScene(
            path.stem,
            scene,
            f"The user's own scene, {path.name}.",
            "",
            path,
            model=PHYSICAL if named.model is None else _model(path, named.model),
            fog_engine=named.engine,
            lens=lens,
        )
    # Changes are checked first: Mitsuba must not build a phase function of an impossible g.
    if changes:
        checked_changes(loaded.scene, changes)
    # The g of an isotropic medium has no parameter to set: such a scene is built again with phase
    # functions of another type.
    isotropic = isotropic_media(loaded.scene) if changes else {}
    lobes = {
        isotropic[name]: value[0]
        for name, value in changes.items()
        if name in isotropic and any(value)
    }
    if lobes:
        scene = (
            scene_with_lobes(record.build(), lobes) if record is not None else _read(path, lobes)[0]
        )
        name_shapes(scene)
        loaded = replace(loaded, scene=scene)
    if size is not None:
        resize(loaded.scene, size, loaded.lens)
    # After the size: a size that is given removes a crop, or a film that is too large.
    _check_films(loaded)
    if changes:
        change_scene(loaded.scene, changes)
        check_rounding(loaded.scene)
    return loaded


def find_record(name: str) -> SceneRecord | None:
    """Return the record of a built-in or random scene; None where the name must be a path."""
    if not is_random(name):
        return SCENES.get(name)
    from airlight.validation.scenes.random.scene import random_record

    return random_record(name)


def scene_identity(scene: str) -> str:
    """Return the identity of a scene: its name or seed with a digest of its description, or the
    digest of a file's scene.

    A scene that has no digest has another identity each time: no result that is made of it is
    found again.
    """
    if scene in SCENES:
        return f"{scene} {SCENES[scene].digest}"
    if is_random(scene):
        seed, ranges = random_parts(scene)
        meshes = read_ranges(ranges)["meshes"] if ranges else ""
        # A random scene depends on the default ranges, a user's ranges and the meshes that these
        # name.
        files = [
            RANGES,
            *([ranges] if ranges else []),
            *(sorted(Path(meshes).iterdir()) if meshes else []),
        ]
        stamps = tuple(
            (path, path.stat().st_mtime_ns, path.stat().st_size) for path in files if path.is_file()
        )
        return f"{PREFIX}{seed} {ranges is not None} {_files_digest(stamps)}"
    return scene_digest(load_scene(scene).scene) or f"no digest, {time.time_ns()}"


@lru_cache(maxsize=8)
def _files_digest(stamps: tuple[tuple[Path, int, int], ...]) -> str:
    """Return a digest of files by their names and contents; a file that
    changed has another stamp.
    """
    digest = hashlib.sha256()
    for path, _, _ in stamps:
        digest.update(f"|{path.name} ".encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def parse_size(text: str) -> tuple[int, int]:
    """Return width and height [pixels] from 'WIDTHxHEIGHT'."""
    match = re.fullmatch(r"(\d+)[xX](\d+)", text.strip())
    if not match:
        raise InputError(
            f"size: got {text!r}, expected WIDTHxHEIGHT in pixels, for example 800x600"
        )
    return int(match[1]), int(match[2])


def _check_films(loaded: LoadedScene) -> None:
    """Refuse films without pixels, with more than any image has, and cropped ones, of
    which a part would be shown.
    """
    for sensor in loaded.scene.sensors():
        size, crop = (
            tuple(int(n) for n in pair)
            for pair in (sensor.film().size(), sensor.film().crop_size())
        )
        where = f"scene {loaded.path or loaded.name}"
        if not all(1 <= n <= _LARGEST for n in size):
            raise InputError(
                f"{where}: the camera's film has {size[0]} x {size[1]} pixels, expected at least 1 "
                "x 1 and at most "
                f"{_LARGEST} on a side; change its width and height, or give --size"
            )
        if crop != size:
            raise InputError(
                f"{where}: the camera's film is cropped to {crop[0]} x {crop[1]} of {size[0]} x "
                f"{size[1]} pixels; "
                "remove crop_width, crop_height and crop_offset from the film, or give --size"
            )


def _read(
    path: Path, lobes: Mapping[str, float] = MappingProxyType({})
) -> tuple[mi.Scene, Lens | None]:
    from airlight.validation.scenes.files.read import read_file

    scene, lens = read_file(path, lobes)
    if not isinstance(scene, mi.Scene):
        raise InputError(
            f"scene {path}: the file holds a single {type(scene).__name__}; expected a whole "
            "<scene>"
        )
    name_shapes(scene)
    check_numbers(scene)
    check_bodies(scene)
    return scene, lens


def _model(path: Path, words: str) -> Model:
    try:
        return model_of(words)
    except InputError as error:
        raise InputError(f"scene {path}: {error}") from None


def name_shapes(scene: mi.Scene) -> None:
    """Give shapes that have no id a name, such as 'sphere-2': messages and copies need names."""
    taken = {shape.id() for shape in scene.shapes()}
    for number, shape in enumerate(scene.shapes(), 1):
        if not shape.id():
            # A shape of the file may have the name already: the next number that is free is taken.
            names = (f"{shape.class_name().lower()}-{free}" for free in count(number))
            shape.set_id(next(name for name in names if name not in taken))
            taken.add(shape.id())


def _check_size(size: tuple[int, int]) -> None:
    if not all(1 <= n <= _LARGEST for n in size):
        raise InputError(
            f"size: got {size[0]}x{size[1]}, expected at least 1x1 and at most {_LARGEST} pixels "
            "on a side"
        )


def resize(scene: mi.Scene, size: tuple[int, int], lens: Lens | None = None) -> None:
    """Set the image size of all cameras of a scene in place, width and height [pixels]; horizontal
    angles of view stay, but for the `lens` of the first camera if there is one.
    """
    _check_size(size)
    for number, sensor in enumerate(scene.sensors()):
        parameters = mi.traverse(sensor)
        parameters["film.size"] = list(size)
        parameters["film.crop_size"] = list(size)
        parameters["film.crop_offset"] = [0, 0]
        if "x_fov" in parameters:
            # The sensor recomputes its projection only when one of its own parameters is set.
            kept = parameters["x_fov"]
            parameters["x_fov"] = kept if lens is None or number else x_fov(lens, size)
        parameters.update()
