# SPDX-License-Identifier: BSD-3-Clause
"""Packed images kept between runs: a page drawn again from the same files need not code them again.

Their key is of the bytes of the files, of what of report.json goes into the index, and of the code that packs.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from analytic.errors import InputError
from reference.storage.kept import key_of, load, stopwatch, store
from reports.page.image_index import LADDER, SceneImages, packed_scene, read_images


def page_images(scenes: Sequence[Mapping[str, Any]], folder: Path, limit: int) -> list[SceneImages]:
    """Return the images of scenes, all together in no more than so many characters.

    Every scene begins with the finest rung of `LADDER`; while the page is too large the largest goes a rung down.

    Parameters
    ----------
    scenes
        Scenes of report.json.
    folder
        Where the files that they name lie.
    limit
        Of the sum of the lengths of `data`.

    Raises
    ------
    InputError
        If a file is missing or cannot be read, its size is not that of the reference, or nothing of `LADDER` fits.
    """
    contents = [_contents(scene, folder) for scene in scenes]
    rungs = [0] * len(scenes)
    packed = [_scene_images(scene, folder, files, 0) for scene, files in zip(scenes, contents)]
    while (total := sum(len(images.data) for images in packed)) > limit:
        coarser = [place for place, rung in enumerate(rungs) if rung + 1 < len(LADDER)]
        if not coarser:
            raise InputError(
                f"report: the images take {total / 1e6:.1f} MB of the page even with one pixel in {LADDER[-1][1]} "
                f"along both axes, wanted at most {limit / 1e6:.1f} MB; report fewer scenes or methods at once"
            )
        largest = max(coarser, key=lambda place: len(packed[place].data))
        rungs[largest] += 1
        packed[largest] = _scene_images(scenes[largest], folder, contents[largest], rungs[largest])
    return packed


def _scene_images(scene: Mapping[str, Any], folder: Path, contents: Sequence[str], rung: int) -> SceneImages:
    """Return the images of a scene at a rung of the ladder, kept or packed now; `contents` are those of its files."""
    labels = [method["label"] for method in scene["methods"] if method["files"]]
    asked = {"name": scene["name"], "exposure": scene["exposure"], "labels": labels, "files": contents, "rung": rung}
    key = key_of("page", packed_scene, read_images, **asked)
    kept = load(key)
    if kept is not None:
        return SceneImages(json.loads(str(kept.arrays["index"])), kept.arrays["data"].tobytes().decode("ascii"))
    spent = stopwatch()
    images = packed_scene(scene, read_images(scene, folder), *LADDER[rung])
    # On a full or read-only disk nothing can be kept, but the page can still be drawn.
    with suppress(OSError):
        data = np.frombuffer(images.data.encode("ascii"), np.uint8)
        store(key, {"index": np.array(json.dumps(images.index)), "data": data}, spent())
    return images


def _contents(scene: Mapping[str, Any], folder: Path) -> list[str]:
    """Return digests of the files of a scene's images."""
    digests = []
    for entry in (scene, *(method for method in scene["methods"] if method["files"])):
        path = folder / entry["files"]["exr"]
        try:
            digests.append(hashlib.sha256(path.read_bytes()).hexdigest())
        except OSError as error:
            raise InputError(f"cannot read {path}: {error.strerror}; it is named by report.json") from error
    return digests
