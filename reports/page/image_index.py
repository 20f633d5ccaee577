# SPDX-License-Identifier: BSD-3-Clause
"""The images of a report as data for its page: packed, with an index that the page's script reads.

Each scene becomes one string of base64 that holds all of its packed planes, and an entry of the index that says where
each lies (`reports.page.image_codec` says how it is coded). A page has a limit of bytes; the largest scenes go down
`STRIDES` until all fit: every pixel is kept, every second, third ... The index has which, and the page says so.
"""

import base64
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from reference.storage.exr import TOTAL, read_exr
from reports.data.records import Scene
from reports.page.image_codec import (
    DIFFERENCE_BITS,
    FLIP_BITS,
    REFERENCE_BITS,
    K,
    S,
    difference_codes,
    pack_planes,
    reference_codes,
    reference_values,
)
from validation.metrics.errors import FLOOR

Array = NDArray[np.float64]

LAYERS = ("airlight", "surface")
FLIP_LAYER = "flip"
FLIP_LEVELS = 255  #: code of an HDR-FLIP of 1
STRIDES = (1, 2, 3, 4, 6, 8, 12, 16)  #: of the pixels that are kept


@dataclass(frozen=True)
class SceneImages:
    """The images of one scene for the page."""

    index: dict[str, Any]  #: what the page's script reads, JSON-ready; offsets count the bytes before base64
    data: str  #: all packed planes, in base64


def page_images(scenes: Sequence[Scene], folder: Path, limit: int) -> list[SceneImages]:
    """Return the images of scenes of report.json from a folder, all together in at most `limit` characters.

    Every scene begins with all pixels; while the page is too large the largest goes down `STRIDES`.
    """
    packed = [packed_scene(scene, folder, STRIDES[0]) for scene in scenes]
    while (total := sum(len(images.data) for images in packed)) > limit:
        coarser = [place for place, images in enumerate(packed) if images.index["stride"] < STRIDES[-1]]
        if not coarser:
            raise InputError(
                f"report: the images take {total / 1e6:.1f} MB of the page even with one pixel in {STRIDES[-1]} "
                f"along both axes, expected at most {limit / 1e6:.1f} MB; report fewer scenes or methods at once"
            )
        largest = max(coarser, key=lambda place: len(packed[place].data))
        stride = STRIDES[STRIDES.index(packed[largest].index["stride"]) + 1]
        packed[largest] = packed_scene(scenes[largest], folder, stride)
    return packed


def read_images(scene: Scene, folder: Path) -> list[dict[str, Array]]:
    """Return the layers of the files of a scene of report.json: of the reference, then of each method with images."""
    reference = _layers(folder / scene.files.exr)
    files = [folder / entry.files["exr"] for entry in scene.methods if entry.files]
    methods = [_layers(path) for path in files]  # not in parallel: reading turns the standard error stream off
    size = reference["airlight"].shape
    for path, layers in zip(files, methods):
        for layer in layers.values():
            if layer.shape != size:
                raise InputError(
                    f"{path}: got {layer.shape[1]} x {layer.shape[0]} pixels, expected the {size[1]} x {size[0]} of "
                    "the scene's reference; make the report again"
                )
    return [reference, *methods]


def _layers(path: Path) -> dict[str, Array]:
    """Return the layers of a file that the page shows: airlight and surface, or the total where it has no airlight."""
    layers = read_exr(path).layers
    wanted = [*(LAYERS if "airlight" in layers else (TOTAL,)), FLIP_LAYER]
    return {name: np.asarray(layers[name], dtype=np.float64) for name in wanted if name in layers}


def packed_scene(scene: Scene, folder: Path, stride: int) -> SceneImages:
    """Return the images of a scene of report.json for the page: one pixel in `stride` along both axes."""

    def thin(layers: Mapping[str, Array]) -> dict[str, Array]:
        return {name: layer[::stride, ::stride] for name, layer in layers.items()}

    store = bytearray()

    def add(planes: bytes) -> dict[str, int]:
        store.extend(planes)
        return {"at": len(store) - len(planes), "bytes": len(planes)}

    reference, *tested = read_images(scene, folder)
    exact = thin(reference)
    exact.setdefault("surface", np.zeros_like(exact["airlight"]))
    codes = {name: reference_codes(exact[name]) for name in LAYERS}
    # The floors are those of the whole image, so that they do not depend on which pixels are kept.
    whole = dict(reference)
    whole[TOTAL] = whole["airlight"] + whole.get("surface", 0)
    floors = {name: _floor(whole.get(name)) for name in (*LAYERS, TOTAL)}
    exact[TOTAL] = exact["airlight"] + exact["surface"]
    rounded = {name: reference_values(codes[name]) for name in LAYERS}
    rounded[TOTAL] = rounded["airlight"] + rounded["surface"]
    shown = [entry for entry in scene.methods if entry.files]

    def packed(number: int) -> dict[str, bytes]:
        """Return the packed layers of a method."""
        packed_layers = {}
        for name, layer in thin(tested[number]).items():
            if name == FLIP_LAYER:
                levels = np.round(FLIP_LEVELS * np.clip(np.nan_to_num(layer[..., :1]), 0, 1)).astype(np.int32)
                packed_layers[name] = pack_planes(levels, FLIP_BITS)
            else:
                relative = relative_difference(exact[name], rounded[name], layer, floors[name])
                packed_layers[name] = pack_planes(difference_codes(relative), DIFFERENCE_BITS)
        return packed_layers

    with ThreadPoolExecutor() as pool:
        references = list(pool.map(lambda name: pack_planes(codes[name], REFERENCE_BITS), LAYERS))
        methods = list(pool.map(packed, range(len(shown))))
    height, width = codes["airlight"].shape[:2]
    full_height, full_width = reference["airlight"].shape[:2]
    index = {
        "name": scene.name,
        "size": [width, height],
        "full": [full_width, full_height],
        "stride": stride,
        "exposure": scene.exposure,
        "floors": floors,
        "scale": [K, S],
        "reference": {name: add(plane) for name, plane in zip(LAYERS, references)},
        "methods": [
            {"label": entry.label, "layers": {name: add(what) for name, what in layers.items()}}
            for entry, layers in zip(shown, methods)
        ],
    }
    return SceneImages(index, base64.b64encode(store).decode("ascii"))


def relative_difference(exact: Array, rounded: Array, test: Array, floor: float) -> Array:
    """Return the difference of an image from the reference, in units of the larger of that and a positive floor.

    `rounded` is the reference as the page will have it, which it multiplies with.
    """
    with np.errstate(invalid="ignore"):
        difference = test - np.where(np.isfinite(exact), exact, 0)
        unit = np.maximum(np.abs(np.where(np.isfinite(rounded), rounded, 0)), floor)
        return difference / unit


def _floor(reference: Array | None) -> float:
    """Return the radiance below which errors are relative to it; 1 where the reference is black."""
    if reference is None:
        return 1.0
    finite = np.isfinite(reference)
    mean = float(reference[finite].mean()) if finite.any() else 0.0
    return FLOOR * mean if mean > 0 else 1.0
