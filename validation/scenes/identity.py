# SPDX-License-Identifier: BSD-3-Clause
"""What a scene is, in keys of results."""

import hashlib
from functools import lru_cache
from pathlib import Path

from reference.storage.scene_digest import scene_digest
from validation.scenes.loading import load_scene
from validation.scenes.random.ranges import FILE as RANGES
from validation.scenes.random.scene import PREFIX, is_random, random_parts
from validation.scenes.registry import SCENES


def scene_identity(scene: str) -> str:
    """Return what a scene is: a name or seed with a digest of its description or files, the digest of a file's scene.

    Raises
    ------
    InputError
        If a file cannot be read, as of `validation.scenes.loading.load_scene`.
    """
    if scene in SCENES:
        return f"{scene} {SCENES[scene].digest}"
    if is_random(scene):
        seed, given = random_parts(scene)
        places = [RANGES, *(place for _, place in sorted(given.items()))]
        files = [path for place in places for path in (sorted(place.iterdir()) if place.is_dir() else [place])]
        stamps = tuple((path, path.stat().st_mtime_ns, path.stat().st_size) for path in files if path.is_file())
        return f"{PREFIX}{seed} {sorted(given)} {_files_digest(stamps)}"
    return scene_digest(load_scene(scene).scene)


@lru_cache(maxsize=8)
def _files_digest(stamps: tuple[tuple[Path, int, int], ...]) -> str:
    """Return a digest of files by their names and contents; a file that changed has another stamp."""
    digest = hashlib.sha256()
    for path, _, _ in stamps:
        digest.update(f"|{path.name} ".encode() + hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()
