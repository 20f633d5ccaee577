# SPDX-License-Identifier: BSD-3-Clause
"""Images that another renderer wrote, such as a game engine: EXR files named by scene,
judged by the reference.

A folder holds SCENE.exr, or SCENE.NAME.exr where several images of a scene are to be told apart. An
image with a layer `airlight` is judged by that; else its plain channels are judged against airlight
plus surface. It is judged at its own size, which all images of a scene must share, and by the
reference that fits, at pixel centres or over their areas.
"""

import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError, nearest
from airlight.reference.scene.model import Model
from airlight.reference.storage.exr import MODEL, read_exr
from airlight.validation.engine.judge import (
    EngineComparison,
    ReferenceOf,
    judge_image,
    with_model,
)
from airlight.validation.engine.observation import AIRLIGHT, SURFACE, judged_layer
from airlight.validation.metrics.errors import Metrics, error_metrics
from airlight.validation.scenes.loading import LoadedScene
from airlight.validation.scenes.models import model_of
from airlight.validation.timing import Timing

TIMES = "times.json"  #: what lies beside images and says how long they took


@dataclass(frozen=True)
class EngineImage:
    """An image from elsewhere, and the scene that it claims to show."""

    scene: str  #: name of the scene
    label: str  #: NAME in its file's name, or the name of the folder
    path: Path


def find_images(
    folder: str | os.PathLike[str], scenes: Mapping[str, str]
) -> dict[str, tuple[EngineImage, ...]]:
    """Return the images in a folder by the name of their scene.

    `folder`: holds EXR files; other files are not looked at; `scenes`: the scenes that files may
    name: a name, and what `validation.scenes.loading.load_scene` takes for it.
    """
    place = Path(folder)
    if not place.is_dir():
        raise InputError(
            f"--images: got {folder}, expected a folder with EXR files named by scene, such as "
            "open-fog.exr"
        )
    # Hidden files are no images, even if their names end like one.
    files = sorted(
        path
        for path in place.iterdir()
        if path.suffix.lower() == ".exr" and not path.name.startswith(".")
    )
    if not files:
        raise InputError(
            f"--images: the folder {folder} has no EXR file; expected SCENE.exr or SCENE.NAME.exr "
            "in it"
        )
    by_scene: dict[str, tuple[EngineImage, ...]] = {}
    for path in files:
        # SCENE.NAME.exr has a label after the dot, SCENE.exr the name of the folder.
        scene = _scene_of(path, scenes)
        label = path.stem[len(scene) + 1 :] or place.resolve().name or "image"
        by_scene[scene] = (*by_scene.get(scene, ()), EngineImage(scene, label, path))
    return by_scene


def images_size(images: tuple[EngineImage, ...]) -> tuple[int, int]:
    """Return the size of the images of one scene, (width, height)."""
    sizes = {image.path: judged_layer(read_exr(image.path), image.path).size for image in images}
    first = images[0]
    for path, size in sizes.items():
        if size != sizes[first.path]:
            wanted, got = (f"{width} x {height}" for width, height in (sizes[first.path], size))
            raise InputError(
                f"--images: {path} is {got} pixels and {first.path} {wanted}; render all images of "
                "a scene at one size"
            )
    return sizes[first.path]


def measure_image(
    shown: EngineImage, loaded: LoadedScene, reference_of: ReferenceOf, *, surfaces: bool
) -> tuple[EngineComparison, Mapping[str, NDArray[np.floating]], Metrics | None]:
    """Judge an image from elsewhere by the reference of its scene at its size, or that of the
    scene's model, as `airlight compare SCENE IMAGE` does.

    `loaded`, `reference_of`: the scene at that size, and what computes its reference for 'centre'
    or 'area'; `surfaces`: whether the scene has surfaces at all. Return the judgement, the layers
    that were judged by what they hold, and the error of the surface where an image has both layers.
    """
    # The airlight of an image with both layers is judged; the surface has an error beside it.
    image = read_exr(shown.path)
    layer = judged_layer(image, shown.path)
    layers = {layer.holds: layer.values}
    if layer.name == AIRLIGHT and SURFACE in image.layers:
        layers[SURFACE] = image.layers[SURFACE]
    mask = image.with_data()
    judged = judge_image(image, layer, loaded, reference_of, path=shown.path, mask=mask)
    judged = with_model(judged, layer, loaded, mask)
    if not (surfaces and AIRLIGHT in layers and SURFACE in layers):
        return judged, layers, None
    held = image.with_data()  # pixels that the file does not hold are no error of the surface
    return judged, layers, error_metrics(judged.layers.surface, layers[SURFACE], mask=held)


def captured_model(path: Path) -> Model | None:
    """Return the equation that a capture (`airlight.capture`) says that it solves; None for others.

    A reference of a model names one too: it is no image of an engine.
    """
    attributes = read_exr(path).attributes
    words, engine = attributes.get(MODEL), attributes.get("airlight:engine")
    if not words or not engine:
        return None
    version = attributes.get("airlight:engine-version", "")
    return replace(model_of(str(words)), name=f"{engine} {version}".strip())


def notes_of(judged: EngineComparison, times: tuple[Timing, str] | None) -> str:
    """Return notes of the reader of a file, the kind of its pixels, whether it
    is right, and the device.
    """
    notes = [judged.note] if judged.note else []
    notes += (
        ["judged by the means over the areas of pixels, which fit"]
        if judged.pixel == "area"
        else []
    )
    if judged.model is not None:
        notes += [f"judged by the equation of the model {judged.model.name or judged.model.terms}"]
    notes += [judged.verdict.words]
    return "; ".join([*notes, f"timed on {times[1]}"] if times is not None and times[1] else notes)


def image_times(path: Path) -> tuple[Timing, str] | None:
    """Return the time of a frame that `times.json` in the folder of an image says, and the
    device; None for nothing.

    The file holds, by the name of the image, `{"ms": 3.1, "quartiles": [2.9, 3.4], "device": "RTX
    4090"}`, of which the last two may be missing.
    """
    file = path.with_name(TIMES)
    if not file.is_file():
        return None
    # A file in another form, or times that are no times, are one mistake of the user: one message.
    try:
        entries = json.loads(file.read_text(encoding="utf-8"))
        entry = entries.get(path.name, entries.get(path.stem))
        if entry is None:
            return None
        # A time without quartiles is its own quartiles.
        low, high = entry.get("quartiles", (entry["ms"], entry["ms"]))
        times = Timing(float(entry["ms"]), float(low), float(high), repetitions=0)
        if not 0 < times.low_ms <= times.median_ms <= times.high_ms < math.inf:
            raise ValueError("ms")
    except (OSError, ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(
            f'{file}: expected {{"{path.name}": {{"ms": 3.1, "quartiles": [2.9, 3.4], "device": '
            '"RTX 4090"}}, '
            "milliseconds of a frame above 0, the median between its quartiles"
        ) from error
    return times, str(entry.get("device", ""))


def _scene_of(path: Path, scenes: Mapping[str, str]) -> str:
    """Return the scene that a file names: the longest name that its own name begins with."""
    stem = path.stem
    names = [name for name in scenes if stem == name or stem.startswith(f"{name}.")]
    if names:
        return max(names, key=len)
    raise InputError(
        f"--images: {path} names no scene, expected SCENE.exr or SCENE.NAME.exr with one of "
        f"{', '.join(scenes)}" + nearest(stem.split(".")[0], scenes)
    )
