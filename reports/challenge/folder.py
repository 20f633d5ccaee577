# SPDX-License-Identifier: BSD-3-Clause
"""The folder of a challenge: challenge.json, and the scenes as files without answers."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from airlight.errors import InputError
from airlight.reference.storage.build import build
from airlight.reference.storage.files import ensure_folder, write_text
from airlight.reports.challenge.draw import (
    DrawnScene,
    draw_scenes,
    load_drawn,
    scenes_digest,
)
from airlight.reports.challenge.seed import FORMAT, SIZE, check_seed
from airlight.reports.data.records import read_versioned
from airlight.reports.interchange.gltf import write_gltf
from airlight.reports.interchange.scene import describe_scene
from airlight.validation.columns import plain

FILE, SCENES = "challenge.json", "scenes"  #: in the folder of a challenge
LAYER = "airlight"  #: of the images of an entry


@dataclass(frozen=True)
class Program:
    """The airlight that wrote a file."""

    airlight: str
    commit: str

    @classmethod
    def this(cls) -> "Program":
        """Return the one that runs."""
        return cls(build().airlight, build().commit)


@dataclass(frozen=True, kw_only=True)
class ListedScene:
    """A scene in challenge.json."""

    name: str
    kind: str  #: of `challenge.draw.KINDS`
    purpose: str
    image: str  #: name of the file to write
    files: Mapping[str, str]  #: SHA-256 of the files of the scene by name, in the folder `SCENES`


@dataclass(frozen=True, kw_only=True)
class Challenge:
    """The content of challenge.json."""

    schema: str
    seed: str
    entry: str  #: the words that the seed was made of; empty where it was given
    digest: str  #: of the Mitsuba files and meshes of all scenes
    program: Program
    size: tuple[int, int]  #: width and height of the images [pixels]
    write: str  #: what to write, in words
    scenes: tuple[ListedScene, ...]


_WRITE = (
    "NAME.exr for each scene, beside this file: OpenEXR, half or float, with the layer airlight "
    "(airlight.R, airlight.G, airlight.B), the light that fog scatters once towards the camera "
    "[W/(m^2 sr)], along the ray through the centre of each pixel"
)


def write_challenge(folder: Path | str, seed: str, entry: str = "") -> Challenge:
    """Draw the scenes of a seed and write them, challenge.json last; return its content."""
    place = ensure_folder(folder)
    scenes = draw_scenes(seed)
    for scene in scenes:
        _write_scene(place / SCENES, scene)
    challenge = Challenge(
        schema=FORMAT,
        seed=seed,
        entry=entry,
        digest=scenes_digest(scenes),
        program=Program.this(),
        size=SIZE,
        write=_WRITE,
        scenes=tuple(_listed(place / SCENES, scene) for scene in scenes),
    )
    text = json.dumps(plain(challenge), indent=1, ensure_ascii=False, allow_nan=False)
    write_text(place / FILE, text + "\n")
    return challenge


def _write_scene(folder: Path, scene: DrawnScene) -> None:
    """Write the files of a scene, then its description and glTF file, which are made of these."""
    loaded = load_drawn(folder, scene)
    described = _without_place(describe_scene(loaded), scene)
    text = json.dumps(described, indent=1, ensure_ascii=False, allow_nan=False)
    write_text(folder / f"{scene.name}.json", text + "\n")
    write_gltf(folder / f"{scene.name}.glb", loaded)


def _without_place(described: dict[str, Any], scene: DrawnScene) -> dict[str, Any]:
    """Return a description that is the same in every folder."""
    return described | {"source": scene.file}


def _listed(folder: Path, scene: DrawnScene) -> ListedScene:
    names = [*scene.files, f"{scene.name}.json", f"{scene.name}.glb"]
    files = {name: _sha256((folder / name).read_bytes()) for name in names}
    return ListedScene(
        name=scene.name,
        kind=scene.kind,
        purpose=scene.purpose,
        image=f"{scene.name}.exr",
        files=files,
    )


def read_challenge(file: Path) -> Challenge:
    """Return the content of challenge.json; refuse a file of another kind or version."""
    wanted = f"{FILE} of `airlight challenge new`"
    challenge = read_versioned(file, Challenge, FORMAT, wanted, "write the scenes again")
    check_seed(challenge.seed, challenge.entry, str(file))
    return challenge


def check_scenes(challenge: Challenge, folder: Path, scenes: Sequence[DrawnScene]) -> None:
    """Refuse a challenge whose scenes are not those of its seed, and files that were changed.

    `folder`: of challenge.json, in which the scenes may be left out.
    """
    digest = scenes_digest(scenes)
    if challenge.digest != digest:
        raise InputError(
            f"{folder / FILE}: the scenes of the seed {challenge.seed} have the digest "
            f"{digest[:12]}, the file says {challenge.digest[:12]}; expected scenes as `airlight "
            "challenge new` writes them: write them again, and render these"
        )
    for scene in challenge.scenes:
        for name, known in scene.files.items():
            path = folder / SCENES / name
            if path.is_file() and _sha256(path.read_bytes()) != known:
                raise InputError(
                    f"{path} was changed since it was written; expected the scene as it was drawn: "
                    "write the scenes again, and render these"
                )


def _sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
