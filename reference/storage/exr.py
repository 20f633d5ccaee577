# SPDX-License-Identifier: BSD-3-Clause
"""Layered OpenEXR images: radiance by layer, depth, standard errors, and in
the header what made them.

A file is one part of scan lines in float32 with ZIP compression, which every viewer reads. A layer
is three channels `name.R`, `name.G`, `name.B`; the total, `airlight + surface`, is in plain `R`,
`G`, `B`, so that viewers show it.

The binding of OpenEXR 3.5 writes an array with strides as if it were contiguous, drops the upper
half of an integer attribute, changes the header dictionary that it is given, refuses NumPy's
scalars, and leaves out parts that it cannot read: hence the conversions and checks below.
"""

import contextlib
import difflib
import os
import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.reference.storage.files import NO_SPACE, atomic_path

TOTAL = "total"  #: the layer in the plain channels R, G, B
NOTE = "airlight:read"  #: the attribute in which the reader says what it changed or left out
MODEL = "airlight:model"  #: header attribute: the model of a reference that is not physical
PIXEL = "airlight:pixel"  #: header attribute: 'centre' or 'area', what the values of a pixel are
BATCHES = "airlight:batches"  #: header attribute: how many batch means gave the standard errors
#: header attribute: the standard error of the mean of a layer over the mean of those of its values
SHARED = "airlight:shared"
#: header attribute: of what kind the error in the layer `<layer>_bound` is. Files of airlight 1.0
#: say `estimated` there too; since then such an error is the layer `<layer>_error`
BOUND = "airlight:bound"

Attribute = str | int | float
Window = tuple[int, int, int, int]  #: first column and row, and those after the last
#: the values of one channel, (rows, columns)
Pixels: TypeAlias = NDArray[np.float16 | np.float32 | np.uint32]

# Attributes that the format itself puts into a header.
# fmt: off
_STANDARD = frozenset((
    "channels", "chunkCount", "compression", "dataWindow",
    "deepImageState", "displayWindow", "lineOrder", "maxSamplesPerPixel",
    "name", "pixelAspectRatio", "screenWindowCenter", "screenWindowWidth",
    "tiles", "type", "version", "view",
))
# fmt: on
_ONE_LEVEL = str(OpenEXR.ONE_LEVEL)
_INTEGERS = "colours in unsigned integers"
# as other programs name channels
_COLOURS = {"r": "R", "g": "G", "b": "B", "red": "R", "green": "G", "blue": "B"}
_WHOLE = frozenset((*_COLOURS, "y"))
_ENCODED = "its values are encoded for a screen: save linear radiance as EXR"
_CONVERTED = "convert it, for example by oiiotool FILE -o FILE.exr"
#: How files of other kinds begin, what they are, and what to do.
_OTHERS = (
    (b"\x89PNG", " but PNG", _ENCODED),
    (b"\xff\xd8\xff", " but JPEG", _ENCODED),
    (b"#?", " but Radiance HDR", _CONVERTED),
    (b"PF", " but PFM", _CONVERTED),
    (b"II*\x00", " but TIFF", _CONVERTED),
    (
        b"\x93NUMPY",
        " but an array of NumPy",
        "from Python give the array: airlight.compare(SCENE, numpy.load(FILE))",
    ),
    (b"", "", "expected linear radiance as EXR: save it again"),
)
_PLAIN = frozenset(("", "rgb", "rgba"))  # names of a part whose channels are the image itself


@dataclass(frozen=True)
class Image:
    """A layered image.

    Attributes
    ----------
    layers
        Arrays (height, width, 3) by name: `airlight`, `surface`, their standard errors
        `airlight_se`, `surface_se` [W/(m^2 sr)], and `total`.
    depth
        Distance along the ray to the visible surface [m], (height, width); infinite
        where the ray hits nothing.
    attributes
        Header attributes such as `airlight:method`.
    window
        First column and row, and those after the last, of the pixels that the file holds, where
        these are a part of the frame: the others are 0 and say nothing.
    """

    layers: Mapping[str, NDArray[np.floating]]
    depth: NDArray[np.floating] | None = None
    attributes: Mapping[str, Attribute] = field(default_factory=dict)
    window: tuple[int, int, int, int] | None = None

    def with_data(self, mask: NDArray[np.bool_] | None = None) -> NDArray[np.bool_] | None:
        """Return which pixels of a mask the file holds, (height, width); None where that is all.

        A mask of another size comes back as it is, for those who compare to refuse it.
        """
        if self.window is None or not self.layers:
            return mask
        inside = np.zeros(next(iter(self.layers.values())).shape[:2], dtype=bool)
        if mask is not None and np.shape(mask) != inside.shape:
            return mask
        # Pixels outside of the window are 0, and no data.
        left, top, right, bottom = self.window
        inside[top:bottom, left:right] = True
        return inside if mask is None else inside & (np.asarray(mask) != 0)


def layer(
    image: Image, name: str, path: str | os.PathLike[str] = "the image"
) -> NDArray[np.floating]:
    """Return a layer in the unit of the file, radiance [W/(m^2 sr)] in ours, (height, width, 3).

    `name`: of the layer; the empty name is the total; `path`: name of the image in messages. Raises
    InputError for a layer that is not there, with the layers that are and the nearest name.
    """
    name = name or TOTAL
    if name in image.layers:
        return image.layers[name]
    near = difflib.get_close_matches(name, sorted(image.layers), n=1, cutoff=0.4)
    hint = f"did you mean '{near[0]}'?" if near else "ask for one of them"
    raise InputError(f"{path} has no layer '{name}'; it has {layer_names(image)}; {hint}")


def layer_names(image: Image) -> str:
    """Return the layers that an image has for a message, or why it has none."""
    if image.layers:
        return ", ".join(sorted(image.layers))
    note = str(image.attributes.get(NOTE, ""))
    why = f" ({note})" if note else ""
    way = "it in half or float" if _INTEGERS in note else "channels R, G, B"
    return f"no layer of colours at all{why}; write {way}"


def write_exr(path: str | os.PathLike[str], image: Image, *, finite: bool = True) -> None:
    """Write an image as a single-part float32 EXR, whole or not at all.

    If there is an airlight, `R`, `G`, `B` hold the total: the airlight plus the surface, or the
    airlight alone. The format keeps attributes in 32 bits: a float keeps about 7 digits, and a
    number beyond their range becomes text.

    Raises
    ------
    InputError
        If there are no layers, or they have two sizes, another shape than (height, width, 3), or
        values too large for float32; if a `total` is given that is not the sum; if an attribute has
        a name of the format's own; for values that are not finite, unless `finite` is False, as for
        an image of another program that is to be judged.
    OSError
        If the disk is full; the file is as it was.
    """
    channels = _channels(image)
    if finite:
        _check_finite(image)
    # The binding changes the header that it is given: a new one for each file.
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    for key, value in image.attributes.items():
        header[key] = _attribute(key, value)
    with atomic_path(path) as temporary, _system_errors():
        OpenEXR.File(header, channels).write(str(temporary))


def read_exr(path: str | os.PathLike[str]) -> Image:
    """Read an image written by `write_exr` or by another program.

    Plain `R`, `G`, `B` (or `r`, `Red` and so on) become the layer `total`, half floats float32, a
    lone `Y` three equal channels; the attribute `airlight:read` says so, and names the channels
    left out (alpha, integers, incomplete layers). All parts of a file are read: a channel that
    names no layer belongs to the layer with the name of its part. The image is the display window:
    a data window is cut off beyond it, and missing pixels are 0, see `Image.window`. A subsampled
    channel is repeated.

    Raises
    ------
    InputError
        If the file is missing, broken, not an EXR file, deep, a mipmap, stored as luminance and
        chroma, or has a channel twice.
    """
    _check_kind(path)
    try:
        with _quiet(), OpenEXR.File(str(path), header_only=True) as file:
            # Headers alone, to know how many parts and levels there are before pixels are read.
            declared = len(file.parts)
            levels = any(
                str(getattr(part.header.get("tiles"), "mode", _ONE_LEVEL)) != _ONE_LEVEL
                for part in file.parts
            )
        with _quiet(), OpenEXR.File(str(path), separate_channels=True) as file:
            # The binding empties its own headers when the file is closed.
            parts = [_read_part(part) for part in file.parts]
    except (RuntimeError, ValueError, MemoryError, TypeError) as error:
        raise InputError(
            f"{path} is a broken EXR file: its pixels cannot be read; write or copy it again"
        ) from error
    if levels:
        raise InputError(
            f"{path} has tiles of several resolutions, a mipmap; save it with one level, or in "
            "scan lines"
        )
    if len(parts) != declared:  # the binding leaves out a part that it cannot read
        raise InputError(
            f"{path} is a broken EXR file: of its {declared} parts {len(parts)} can be read; copy "
            "it again"
        )
    if not any(part.planes for part in parts):
        raise InputError(f"{path} is a broken EXR file: it has no channels; write or copy it again")
    channels, window, notes = _channels_of(parts, path)
    # x and y of red, green, blue and white: the default of the format.
    srgb = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.329)
    chromaticities = np.asarray(parts[0].header.get("chromaticities", srgb))
    if not np.allclose(chromaticities, srgb, atol=0.002):
        notes.append("colours of other primaries than sRGB's, read as they are")
    return _image(channels, parts[0].header, window, notes)


class _Plane(NamedTuple):
    """A channel of a part."""

    pixels: Pixels
    across: int  #: how many columns share a pixel
    down: int  #: how many rows share one


@dataclass(frozen=True)
class _Part:
    """A part of a file."""

    name: str
    header: Mapping[str, object]
    frame: Window  #: of the display
    data: Window  #: that holds pixels
    planes: Mapping[str, _Plane]  #: by the name of the channel


def _read_part(part: "OpenEXR.Part") -> _Part:
    return _Part(
        part.name(),
        dict(part.header),
        _window(part.header["displayWindow"]),
        _window(part.header["dataWindow"]),
        {
            key: _Plane(channel.pixels, channel.xSampling, channel.ySampling)
            for key, channel in part.channels.items()
        },
    )


def _channels_of(
    parts: list[_Part], path: str | os.PathLike[str]
) -> tuple[dict[str, Pixels], Window | None, list[str]]:
    """Return the channels of all parts by name, in the frame of the first part; which pixels have
    data, None for all; and notes of what was changed.
    """
    channels: dict[str, Pixels] = {}
    windows: list[Window] = []
    notes: list[str] = []
    # The display window of the first part is the frame: channels of all parts are brought into it.
    frame = parts[0].frame
    for part in parts:
        if any(key.rpartition(".")[2] in ("RY", "BY") for key in part.planes):
            raise InputError(
                f"{path} is stored as luminance and chroma (Y, RY, BY); convert it to R, G, B "
                "channels"
            )
        data = part.data
        # The data that lie in the frame.
        inside = (
            max(data[0], frame[0]),
            max(data[1], frame[1]),
            min(data[2], frame[2]),
            min(data[3], frame[3]),
        )
        if inside[0] >= inside[2] or inside[1] >= inside[3]:
            raise InputError(
                f"{path} holds no pixel of its frame: the data window {data} lies beside {frame}"
            )
        if inside != data and _CUT not in notes:
            notes.append(_CUT)
        windows.append(inside)
        # A channel without a layer belongs to the layer with the name of its part. A part that
        # holds a single colour gives the channel its own name.
        prefix = "" if len(parts) == 1 or part.name.lower() in _PLAIN else f"{part.name}."
        named = len(part.planes) == 1 and part.name.rpartition(".")[2].lower() in _COLOURS
        for key, (pixels, across, down) in part.planes.items():
            name = part.name if named else key if "." in key else prefix + key
            if name in channels:
                raise InputError(
                    f"{path} has the channel '{name}' in two parts; save each layer once"
                )
            if across * down != 1:
                notes.append(f"'{name}' has a value for {across} x {down} pixels")
                # The last repeated value may reach beyond the data window.
                rows, columns = data[3] - data[1], data[2] - data[0]
                pixels = np.repeat(np.repeat(pixels, down, axis=0), across, axis=1)[:rows, :columns]
            channels[name] = _framed(pixels, data, inside, frame)
    firsts_x, firsts_y, ends_x, ends_y = zip(*windows, strict=True)
    # Only pixels that every part has count as data.
    common = max(firsts_x), max(firsts_y), min(ends_x), min(ends_y)
    if common == frame:
        return channels, None, notes
    left, top, right, bottom = (
        common[0] - frame[0],
        common[1] - frame[1],
        common[2] - frame[0],
        common[3] - frame[1],
    )
    notes.append(
        f"data in columns {left} to {right - 1} and rows {top} to {bottom - 1} of the frame alone"
    )
    return channels, (left, top, right, bottom), notes


_CUT = "pixels beyond the frame cut off"


def _window(box: Iterable[Iterable[int]]) -> Window:
    """Return a window from its first and its last pixel."""
    (left, top), (right, bottom) = ([int(value) for value in corner] for corner in box)
    return left, top, right + 1, bottom + 1


def _framed(pixels: Pixels, data: Window, inside: Window, frame: Window) -> Pixels:
    """Return the pixels of a frame from those of a data window, 0 where it has none; `inside`: the
    part of the data window in the frame.
    """
    if data == frame:
        return pixels
    # Rows and columns of the overlap, in the frame and in the data window.
    whole = np.zeros((frame[3] - frame[1], frame[2] - frame[0]), pixels.dtype)
    rows, columns = (
        slice(inside[1] - frame[1], inside[3] - frame[1]),
        slice(inside[0] - frame[0], inside[2] - frame[0]),
    )
    whole[rows, columns] = pixels[
        inside[1] - data[1] : inside[3] - data[1], inside[0] - data[0] : inside[2] - data[0]
    ]
    return whole


def _channels(image: Image) -> dict[str, NDArray[np.float32]]:
    """Name the channels of an image, each contiguous in float32."""
    if not image.layers:
        raise InputError(
            "an image without layers cannot be written; give at least one, such as 'airlight'"
        )
    layers = {
        name or TOTAL: _float32(np.asarray(values), name) for name, values in image.layers.items()
    }
    # All layers have the shape of the first one.
    first = next(iter(layers))
    for name, values in layers.items():
        if values.ndim != 3 or values.shape[2] != 3 or values.size == 0:
            raise InputError(
                f"layer '{name}' has shape {values.shape}; expected (height, width, 3), none of "
                "them zero"
            )
        if values.shape != layers[first].shape:
            raise InputError(
                f"layers of two sizes: '{first}' {layers[first].shape}, '{name}' {values.shape}"
            )
    if "airlight" in layers:
        total = layers["airlight"]
        if "surface" in layers:
            total = _float32(total.astype(np.float64) + layers["surface"], TOTAL)
        # A total read from a file is the same sum; one that is not is a stale or foreign one.
        given = layers.get(TOTAL, total)
        if not np.allclose(given, total, rtol=1e-5, atol=0, equal_nan=True):
            raise InputError(
                "layer 'total' is not airlight + surface; leave it out and it is written for you"
            )
        layers[TOTAL] = total
    # The binding writes an array with strides as if it were contiguous: each channel is a copy.
    channels = {}
    for name, values in layers.items():
        prefix = "" if name == TOTAL else f"{name}."
        for index, suffix in enumerate("RGB"):
            channels[prefix + suffix] = np.ascontiguousarray(values[:, :, index])
    if image.depth is not None:
        depth = _float32(np.asarray(image.depth), "depth")
        if depth.shape != layers[first].shape[:2]:
            raise InputError(
                f"depth has shape {depth.shape}; expected that of the layers, "
                f"{layers[first].shape[:2]}"
            )
        channels["depth.Z"] = np.ascontiguousarray(depth)
    return channels


def _float32(values: NDArray[np.floating], name: str) -> NDArray[np.float32]:
    """Round to float32; refuse finite numbers that would become infinite."""
    with np.errstate(over="ignore", under="ignore"):
        rounded = values.astype(np.float32)
    lost = int(np.count_nonzero(np.isinf(rounded) & np.isfinite(values)))
    if lost:
        raise InputError(
            f"{lost} values of '{name}' exceed what float32 holds (3.4e38); scale the radiance down"
        )
    return rounded


def _check_finite(image: Image) -> None:
    """Refuse layers with NaN or infinity, and depths with NaN: where a ray hits nothing the depth
    is infinite.
    """
    layers = dict(image.layers)
    if image.depth is not None:
        layers["depth"] = np.where(np.isinf(image.depth), 0, image.depth)[..., None]
    for name, values in layers.items():
        wrong = ~np.isfinite(values).all(axis=2)
        if wrong.any():
            row, column = np.argwhere(wrong)[0]
            raise InputError(
                f"layer '{name}': {int(wrong.sum())} of {wrong.size} pixels are not finite, first "
                f"in column {column} of row {row}; an image is written whole, or with finite=False "
                "as it is"
            )


def _attribute(key: str, value: object) -> Attribute:
    """Turn an attribute into one of the three types that the format keeps."""
    if key in _STANDARD or not 0 < len(key.encode()) <= 255:
        raise InputError(
            f"'{key}' cannot name a header attribute of ours; choose one such as "
            f"'airlight:{key[:40]}'"
        )
    if isinstance(value, str):
        return value
    if isinstance(value, int | np.integer):
        # The format keeps 32 bits of an integer, and about 7 digits of a float; what it would cut
        # becomes text.
        return int(value) if -(2**31) <= value < 2**31 else str(int(value))
    if isinstance(value, float | np.floating):
        number = float(value)
        return (
            str(number)
            if np.isfinite(number) and abs(number) > float(np.finfo(np.float32).max)
            else number
        )
    raise InputError(
        f"attribute '{key}' is a {type(value).__name__}; expected text, an integer or a float"
    )


def _check_kind(path: str | os.PathLike[str]) -> None:
    """Refuse a file whose first two words are not those of a flat EXR file: for such a file the
    library prints to the terminal and gives no reason.
    """
    try:
        with open(path, "rb") as stream:
            start = stream.read(8)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"cannot read {path}: {reason}; give an EXR file that exists") from error
    if len(start) < 8 or struct.unpack("<I", start[:4])[0] != 20000630:  # OpenEXR's magic number
        kind, way = next((kind, way) for first, kind, way in _OTHERS if start.startswith(first))
        raise InputError(f"{Path(path)} is not an EXR file{kind}; {way}")
    flags = struct.unpack("<I", start[4:])[0]
    if flags & 0x800:  # the bit of deep data
        raise InputError(f"{path} is a deep EXR file; save it flat")


@contextlib.contextmanager
def _system_errors() -> Iterator[None]:
    """Turn OpenEXR's words for a full disk back into the system's error."""
    try:
        yield
    except RuntimeError as error:
        for code in NO_SPACE:
            if os.strerror(code) in str(error):
                raise OSError(code, os.strerror(code)) from error
        raise


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Suppress the messages that OpenEXR's C code prints about a broken file: the exception says it
    once.
    """
    with (
        open(os.devnull, "w") as sink,
        contextlib.redirect_stdout(sink),
        contextlib.redirect_stderr(sink),
    ):
        # The C code writes to the file descriptor, past Python's streams.
        saved = os.dup(2)
        try:
            os.dup2(sink.fileno(), 2)
            yield
        finally:
            os.dup2(saved, 2)
            os.close(saved)


def _image(
    channels: dict[str, Pixels],
    header: Mapping[str, object],
    window: Window | None,
    notes: list[str],
) -> Image:
    """Group channels into layers; note the channels that are changed or left out."""
    floats = {
        k: v.astype(np.float32, copy=False) for k, v in channels.items() if v.dtype.kind == "f"
    }
    # Channels by layer: `groups[layer][suffix]` is the name of the channel.
    groups: dict[str, dict[str, str]] = {}
    for key in floats:
        name, _, suffix = key.rpartition(".")
        groups.setdefault(name, {})[suffix] = key
    layers, used, grey = {}, set(), []
    # Plain channels come first: a layer that is called `total` beside them is left out.
    for name, group in sorted(groups.items()):
        if (name or TOTAL) in layers:
            continue
        # Some programs write r, g, b or Red, Green, Blue.
        colours = {
            _COLOURS[suffix.lower()]: key
            for suffix, key in group.items()
            if suffix.lower() in _COLOURS
        } | group
        if {"R", "G", "B"} <= colours.keys():
            keys = [colours[suffix] for suffix in "RGB"]
        # A lone Y is grey; beside other channels it is no colour.
        elif (grey_key := group.get("Y", group.get("y"))) and group.keys() <= {"Y", "y", "A", "Z"}:
            keys = [grey_key] * 3
            grey.append(name or TOTAL)
        else:
            continue
        layers[name or TOTAL] = np.stack([floats[key] for key in keys], axis=-1)
        used |= set(keys)
    # With an X it is a component of a vector.
    depth_key = next(
        (key for key in ("depth.Z", "Z") if key in floats and key[:-1] + "X" not in floats), None
    )
    used |= {depth_key} if depth_key else set()
    if grey:
        notes.append(f"grey, Y repeated as R, G, B: {', '.join(sorted(grey))}")
    if any(channels[key].dtype == np.float16 for key in used):
        notes.append("half floats (relative rounding 5e-4)")
    # Colours in integers are values for a screen; a layer of them is named, not read.
    integers = {
        k
        for k, v in channels.items()
        if v.dtype.kind in "ui" and k.rpartition(".")[2].lower() in _WHOLE
    }
    if integers:
        notes.append(f"{_INTEGERS} left out: {', '.join(sorted(integers))}")
    if unused := sorted(channels.keys() - used - integers):
        notes.append(f"channels left out: {', '.join(unused)}")
    # Attributes of the format itself, and an earlier note of the reader, say nothing about this
    # image.
    attributes = {
        k: v
        for k, v in header.items()
        if isinstance(v, str | int | float) and k not in _STANDARD and k != NOTE
    }
    return Image(
        layers,
        floats.get(depth_key or ""),
        {**attributes, NOTE: "; ".join(notes)} if notes else attributes,
        window,
    )
