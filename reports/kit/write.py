# SPDX-License-Identifier: BSD-3-Clause
"""The folder of the kit: texts of languages, scenes, and the page that a stranger reads first."""

import shutil
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from airlight.errors import InputError
from airlight.reference.storage.build import build
from airlight.reference.storage.files import ensure_folder, write_text
from airlight.reports.interchange.gltf import write_gltf
from airlight.reports.interchange.pbrt import pbrt_scene
from airlight.reports.kit.godot import PROJECT, godot_cannot, godot_scene
from airlight.reports.kit.languages import DOUBLE_REASON, TEMPLATES, language_files, templates
from airlight.reports.kit.mitsuba import mitsuba_xml
from airlight.reports.kit.rows import DOUBLE, Group, groups
from airlight.reports.kit.scenes import REASON, KitScene, kit_scenes, scene_json
from airlight.validation.scenes.loading import load_scene

_README = "README.md"


@dataclass(frozen=True)
class WrittenScene:
    """A scene of the kit as it was written."""

    name: str
    words: str
    files: tuple[str, ...]  #: in the folder of the kit
    gaps: tuple[str, ...]  #: what a form of it lacks, in words


@dataclass(frozen=True)
class WrittenKit:
    """The kit as it was written."""

    files: tuple[str, ...]  #: in the folder of the kit, those of scenes excepted
    scenes: tuple[WrittenScene, ...]
    groups: tuple[Group, ...]


def write_kit(folder: Path) -> WrittenKit:
    """Write the kit into a new or empty folder.

    Raises InputError for a folder that has files: somebody may have changed them.
    """
    if folder.is_dir() and any(folder.iterdir()):
        raise InputError(
            f"kit: got {str(folder)!r}, which has files; expected a new or an empty folder: give "
            "another name"
        )
    ensure_folder(folder)
    try:
        return _write(folder)
    except BaseException:
        # A kit is whole or not there: the folder was empty.
        for path in folder.iterdir():
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)
        raise


def _write(folder: Path) -> WrittenKit:
    rows = groups()
    scenes = tuple(_write_scene(folder, scene) for scene in kit_scenes())
    texts = language_files(rows)
    texts["scenes/project.godot"] = PROJECT
    texts["LICENSE"] = _template("LICENSE")
    texts[_README] = (
        templates()
        .get_template(f"{_README}.j2")
        .render(
            build=build().words,
            groups=rows,
            double=DOUBLE,
            double_reason=DOUBLE_REASON,
            reason=REASON,
            scenes=scenes,
        )
    )
    for name, text in texts.items():
        write_text(folder / name, text)
    return WrittenKit(tuple(texts), scenes, rows)


def _write_scene(folder: Path, scene: KitScene) -> WrittenScene:
    place = folder / "scenes" / scene.name
    gaps = [f"Godot: {why}" for why in godot_cannot(scene)]
    files = dict(_texts(scene))
    for name, text in files.items():
        write_text(place / name, text)
    # The other forms are written from the scene that Mitsuba has read.
    loaded = replace(load_scene(str(place / "scene.xml")), name=scene.name)
    write_gltf(place / "scene.glb", loaded)
    written = [*files, "scene.glb"]
    try:
        write_text(place / "scene.pbrt", pbrt_scene(loaded))
    except InputError as error:
        gaps.insert(0, f"no scene.pbrt: {error}")
    else:
        written.append("scene.pbrt")
    names = tuple(f"scenes/{scene.name}/{name}" for name in written)
    return WrittenScene(scene.name, scene.words, names, tuple(gaps))


def _texts(scene: KitScene) -> Iterator[tuple[str, str]]:
    head = (
        f"{scene.name}: {scene.words} Written by airlight {build().words}. "
        "SPDX-License-Identifier: MIT-0"
    )
    yield "scene.json", scene_json(scene)
    yield "scene.xml", mitsuba_xml(scene.data, head)
    yield "blender.py", _template("blender.py")
    yield "scene.tscn", godot_scene(scene)
    yield "godot.gd", _template("godot.gd")


def _template(name: str) -> str:
    """Return a text without a value to fill in."""
    return (TEMPLATES / f"{name}.j2").read_text(encoding="utf-8")
