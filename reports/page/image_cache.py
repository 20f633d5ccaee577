# SPDX-License-Identifier: BSD-3-Clause
"""Packed images kept between runs: a page drawn again from the same files need not code them again.

A name in the cache stands for the bytes of the files, for what of report.json goes into the index, and for the code
that packs; so nothing is ever out of date, and a damaged entry is made again.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from analytic.errors import InputError
from reference.storage.cache import load_arrays, store_arrays
from reports.page.image_index import LADDER, SceneImages, packed_scene, read_images

_CODE = ("image_codec.py", "image_index.py")


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
    names = [_name(scene, folder) for scene in scenes]
    rungs = [0] * len(scenes)
    packed = [_scene_images(scene, folder, name, 0) for scene, name in zip(scenes, names)]
    while (total := sum(len(images.data) for images in packed)) > limit:
        coarser = [place for place, rung in enumerate(rungs) if rung + 1 < len(LADDER)]
        if not coarser:
            raise InputError(
                f"report: the images take {total / 1e6:.1f} MB of the page even with one pixel in {LADDER[-1][1]} "
                f"along both axes, wanted at most {limit / 1e6:.1f} MB; report fewer scenes or methods at once"
            )
        largest = max(coarser, key=lambda place: len(packed[place].data))
        rungs[largest] += 1
        packed[largest] = _scene_images(scenes[largest], folder, names[largest], rungs[largest])
    return packed


def _scene_images(scene: Mapping[str, Any], folder: Path, name: str, rung: int) -> SceneImages:
    """Return the images of a scene at a rung of the ladder, kept or packed now."""
    precision, stride = LADDER[rung]
    kept = f"{name}-{precision.k:g}-{stride}"
    images = _load(kept)
    if images is None:
        images = packed_scene(scene, read_images(scene, folder), precision, stride)
        _keep(kept, images)
    return images


def _name(scene: Mapping[str, Any], folder: Path) -> str:
    """Return what the packed images of a scene are kept under, without the rung of the ladder."""
    shown = [method for method in scene["methods"] if method["files"]]
    digest = hashlib.blake2b(digest_size=16)
    digest.update(json.dumps([scene["name"], scene["exposure"], [method["label"] for method in shown]]).encode())
    for path in (Path(__file__).with_name(name) for name in _CODE):
        digest.update(path.read_bytes())
    for entry in (scene, *shown):
        path = folder / entry["files"]["exr"]
        try:
            content = path.read_bytes()
        except OSError as error:
            raise InputError(f"cannot read {path}: {error.strerror}; it is named by report.json") from error
        digest.update(f"|{len(content)}|".encode() + content)
    return f"page-{digest.hexdigest()}"


def _load(name: str) -> SceneImages | None:
    arrays = load_arrays(name)
    if arrays is None:
        return None
    return SceneImages(json.loads(str(arrays["index"])), arrays["data"].tobytes().decode("ascii"))


def _keep(name: str, images: SceneImages) -> None:
    # On a full or read-only disk nothing can be kept, but the page can still be drawn.
    with suppress(OSError):
        data = np.frombuffer(images.data.encode("ascii"), np.uint8)
        store_arrays(name, {"index": np.array(json.dumps(images.index)), "data": data})
