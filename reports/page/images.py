# SPDX-License-Identifier: BSD-3-Clause
r"""The images of a report as data for its page: packed, with an index that the page's script reads.

Each scene becomes one string of base64 that holds all of its packed planes, and an entry of the
index that says where each lies. A page has a limit of bytes; the largest scenes go down `STRIDES`
until all fit: every pixel is kept, every second, third ... The index has which, and the page says
so.

A page holds hundreds of images, as integers that compress well and that the browser decodes.
Readers look at the errors, which must not drown in the rounding of the encoding: a half float moves
a radiance by up to 5e-4, a good method by 1e-6. Therefore only the reference is stored as radiance;
every other image is stored as its difference from the reference, relative as in
`validation.metrics.errors`:

    d = (test - reference) / max(|reference|, floor),        floor = 0.001 mean(reference)
    code = round(k asinh(d / s)),       k = 250, s = 1e-4     16 bits

which is linear for |d| < s and logarithmic above, so that the rounding of d is at most

    (1/2k) sqrt(s^2 + d^2)  (+ terms of second order in 1/k)

that is 0.2 % of a large error, and 2e-7 of the reference for a small one. The largest code stands
for d = 1e52, which float32 does not reach. The reference keeps the upper 24 bits of each float32,
rounded: 16 binary digits, to 2^-16 = 1.5e-5 relative at most. `d` is taken against the rounded
reference in the denominator and against the exact one in the difference, so that the errors do not
see that rounding.

A code is then predicted from the left, in the second and third channel from the first too; what
remains, zigzag coded (0, -1, 1, -2, ...), goes byte by byte, low bytes first, into zlib. All
arithmetic is modulo 2^bits, so decoding is exact. `templates/codec.js` is the decoder of the page.
"""

import base64
import zlib
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.reference.storage.exr import TOTAL, read_exr
from airlight.reports.data.records import Scene
from airlight.validation.metrics.errors import FLOOR

Codes = NDArray[np.int32]
Array = NDArray[np.float64]

LAYERS = ("airlight", "surface")
FLIP_LAYER = "flip"
STRIDES = (1, 2, 3, 4, 6, 8, 12, 16)  #: of the pixels that are kept
REFERENCE_BITS, DIFFERENCE_BITS, FLIP_BITS = 24, 16, 8
LARGEST = 32766  #: code of the largest finite difference
NAN, INFINITE = -32768, 32767  #: codes of values that are not finite; minus infinity is -INFINITE
#: codes for each factor e of a large difference, and where the scale turns from linear
K, S = 250.0, 1e-4


@dataclass(frozen=True)
class SceneImages:
    """The images of one scene for the page."""

    #: what the page's script reads, JSON-ready; offsets count the bytes before base64
    index: dict[str, Any]
    data: str  #: all packed planes, in base64


def page_images(scenes: Sequence[Scene], folder: Path, limit: int) -> list[SceneImages]:
    """Return the images of scenes of report.json from a folder, all together in at
    most `limit` characters.

    Every scene begins with all pixels; while the page is too large the largest goes down `STRIDES`.
    """
    # Every scene at full size first; most pages fit.
    packed = [packed_scene(scene, folder, STRIDES[0]) for scene in scenes]
    while (total := sum(len(images.data) for images in packed)) > limit:
        coarser = [
            place for place, images in enumerate(packed) if images.index["stride"] < STRIDES[-1]
        ]
        # Every scene is at the last stride already.
        if not coarser:
            raise InputError(
                f"report: the images take {total / 1e6:.1f} MB of the page even with one pixel in "
                f"{STRIDES[-1]} "
                f"along both axes, expected at most {limit / 1e6:.1f} MB; report fewer scenes or "
                "methods at once"
            )
        # The largest scene loses pixels first, by one stride, and the sum is looked at again.
        largest = max(coarser, key=lambda place: len(packed[place].data))
        stride = STRIDES[STRIDES.index(packed[largest].index["stride"]) + 1]
        packed[largest] = packed_scene(scenes[largest], folder, stride)
    return packed


def read_images(scene: Scene, folder: Path) -> list[dict[str, Array]]:
    """Return the layers of the files of a scene of report.json: of the reference, then of
    each method with images.
    """
    reference = _layers(folder / scene.files.exr)
    files = [folder / entry.files["exr"] for entry in scene.methods if entry.files]
    # not in parallel: reading turns the standard error stream off
    methods = [_layers(path) for path in files]
    # An image of another size would be subtracted from the wrong pixels.
    size = reference["airlight"].shape
    for path, layers in zip(files, methods):
        for layer in layers.values():
            if layer.shape != size:
                raise InputError(
                    f"{path}: got {layer.shape[1]} x {layer.shape[0]} pixels, expected the "
                    f"{size[1]} x {size[0]} of "
                    "the scene's reference; make the report again"
                )
    return [reference, *methods]


def _layers(path: Path) -> dict[str, Array]:
    """Return the layers of a file that the page shows: airlight and surface, or the total
    where it has no airlight.
    """
    layers = read_exr(path).layers
    wanted = [*(LAYERS if "airlight" in layers else (TOTAL,)), FLIP_LAYER]
    return {name: np.asarray(layers[name], dtype=np.float64) for name in wanted if name in layers}


def packed_scene(scene: Scene, folder: Path, stride: int) -> SceneImages:
    """Return the images of a scene of report.json for the page: one pixel in
    `stride` along both axes.
    """

    def thin(layers: Mapping[str, Array]) -> dict[str, Array]:
        return {name: layer[::stride, ::stride] for name, layer in layers.items()}

    store = bytearray()

    def add(planes: bytes) -> dict[str, int]:
        store.extend(planes)
        return {"at": len(store) - len(planes), "bytes": len(planes)}

    reference, *tested = read_images(scene, folder)
    # The reference: a scene without surfaces has a layer of zeros, so that every scene of the page
    # has the same layers.
    exact = thin(reference)
    exact.setdefault("surface", np.zeros_like(exact["airlight"]))
    codes = {name: reference_codes(exact[name]) for name in LAYERS}
    # Floors come from the whole image: they must not depend on which pixels the page holds.
    whole = dict(reference)
    whole[TOTAL] = whole["airlight"] + whole.get("surface", 0)
    floors = {name: _floor(whole.get(name)) for name in (*LAYERS, TOTAL)}
    exact[TOTAL] = exact["airlight"] + exact["surface"]
    rounded = {name: reference_values(codes[name]) for name in LAYERS}
    rounded[TOTAL] = rounded["airlight"] + rounded["surface"]
    # The denominator uses the reference as the browser will have it, rounded; the difference uses
    # the exact one (see the module).
    shown = [entry for entry in scene.methods if entry.files]

    def packed(number: int) -> dict[str, bytes]:
        """Return the packed layers of a method."""
        packed_layers = {}
        for name, layer in thin(tested[number]).items():
            if name == FLIP_LAYER:
                # HDR-FLIP lies in 0..1, the same in every channel: one plane of 8 bits. Pixels that
                # are not finite count as 0.
                levels = np.round(255 * np.clip(np.nan_to_num(layer[..., :1]), 0, 1)).astype(
                    np.int32
                )
                packed_layers[name] = pack_planes(levels, FLIP_BITS)
            else:
                relative = relative_difference(exact[name], rounded[name], layer, floors[name])
                packed_layers[name] = pack_planes(difference_codes(relative), DIFFERENCE_BITS)
        return packed_layers

    # zlib and NumPy let other threads run.
    with ThreadPoolExecutor() as pool:
        references = list(pool.map(lambda name: pack_planes(codes[name], REFERENCE_BITS), LAYERS))
        methods = list(pool.map(packed, range(len(shown))))
    # Offsets follow from the order in which planes are added: the reference, then the methods.
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
    """Return the difference of an image from the reference, in units of the larger of
    that and a positive floor.

    `rounded` is the reference as the page will have it, which it multiplies with.
    """
    with np.errstate(invalid="ignore"):
        # Where the reference is not finite the image itself is the difference, against the floor.
        difference = test - np.where(np.isfinite(exact), exact, 0)
        unit = np.maximum(np.abs(np.where(np.isfinite(rounded), rounded, 0)), floor)
        return difference / unit


def _floor(reference: Array | None) -> float:
    """Return the radiance below which errors are relative to it; 1 where the reference is black."""
    if reference is None:
        return 1.0
    # A floor of zero would divide by zero in black images.
    finite = np.isfinite(reference)
    mean = float(reference[finite].mean()) if finite.any() else 0.0
    return FLOOR * mean if mean > 0 else 1.0


# Images as integers


def reference_codes(radiance: NDArray[np.floating]) -> Codes:
    """Return the upper 24 bits of float32 values of any shape, rounded to nearest;
    every NaN has the same code.
    """
    with np.errstate(over="ignore"):  # values beyond float32 become infinite, as in the file
        single = np.ascontiguousarray(radiance, dtype=np.float32)
    bits = single.view(np.uint32).astype(np.int64)
    # Rounding up the largest finite numbers may reach the pattern of infinity, never beyond.
    rounded = (bits + 0x80) >> 8
    # All NaN get one code, the pattern of a quiet NaN.
    codes = np.where(np.isfinite(single), rounded, bits >> 8)
    return np.where(np.isnan(single), 0x7FC000, codes).astype(np.int32)


def reference_values(codes: Codes) -> Array:
    """Return the values that the codes of `reference_codes` stand for, in the same shape."""
    return (codes.astype(np.uint32) << np.uint32(8)).view(np.float32).astype(np.float64)


def difference_codes(difference: Array) -> Codes:
    """Return the codes of relative differences, in the same shape."""
    with np.errstate(invalid="ignore"):
        # k asinh(d / s), see the module; larger than the largest code means infinite, with the
        # sign.
        codes = np.round(K * np.arcsinh(difference / S))
    codes = np.where(np.abs(codes) > LARGEST, np.copysign(INFINITE, codes), codes)
    return np.where(np.isnan(difference), NAN, codes).astype(np.int32)


def pack_planes(codes: Codes, bits: int) -> bytes:
    """Compress planes of codes, (height, width, planes), taken modulo
    2^bits; bits are 8, 16 or 24.
    """
    parts: list[bytes] = []
    for number in range(codes.shape[-1]):
        # The second and the third channel are predicted from the first, each pixel from its left
        # neighbour. The shift to the top of the word and back keeps `bits` bits with their sign.
        plane = codes[..., number].astype(np.int32) - (codes[..., 0] if number else 0)
        rest = np.diff(plane, axis=1, prepend=np.int32(0)) << (32 - bits)
        signed = rest >> (32 - bits)  # modulo 2^bits, with its sign
        # Small residuals of either sign become small numbers, whose upper bytes are zeros that
        # compress to nothing.
        zigzag = ((signed << 1) ^ (signed >> 31)) & ((1 << bits) - 1)
        parts += [(zigzag >> shift).astype(np.uint8).tobytes() for shift in range(0, bits, 8)]
    return zlib.compress(b"".join(parts), 6)
