# SPDX-License-Identifier: BSD-3-Clause
"""Images as results: frozen, NumPy arrays where one is wanted, pictures in a
notebook, words on a terminal.

Arrays are (height, width, 3) of linear RGB radiance [W/(m^2 sr)], the first row at the top, and
read-only. They keep the precision of what made them: float32 from a method in single precision,
float64 from one in double and from the reference, whose error is far below what float32 can hold.
"""

import os
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from airlight.errors import InputError
from airlight.reference.storage.exr import MODEL, TOTAL, Image
from airlight.reference.storage.exr import layer as image_layer
from airlight.reports.data.records import Reference as QuadratureReference
from airlight.reports.plotting.pictures import (
    ToneCurve,
    exposure,
    png_bytes,
    preview,
    tone_curve,
    tone_mapped,
    write_png,
)
from airlight.reports.tables.methods import rate_words
from airlight.reports.tables.record import OfScene, Result
from airlight.validation.columns import plain
from airlight.validation.estimates.images import MonteCarloReference
from airlight.validation.scenes.models import model_line, model_parts
from airlight.validation.timing import FrameTimes

Array = NDArray[np.floating]
_NOTHING = "nothing written"
_MADE = ("pixel", "spp", "batch_spp", "batches", "seeds")  # of the header of a reference


def sealed(image: Image) -> Image:
    """Return a layered image whose arrays cannot be written to."""
    layers = {name: read_only(values) for name, values in image.layers.items()}
    depth = None if image.depth is None else read_only(image.depth)
    return Image(layers, depth, dict(image.attributes))


def read_only(values: Any) -> Array:
    """Return an array that cannot be written to."""
    # The flag is set on a view: the array of the caller stays writable.
    view = np.asarray(values).view()
    view.flags.writeable = False
    return view


class Pictured(Result):
    """A result that a notebook shows as a PNG picture."""

    @abstractmethod
    def picture(self) -> NDArray[np.uint8]:
        """Return the picture, (height, width, 3)."""

    @cached_property
    def _png(self) -> bytes:
        return png_bytes(self.picture())

    def _repr_png_(self) -> bytes:
        return self._png


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class LayeredImage(Pictured, OfScene):
    """Layers of radiance and the depth, shared by renderings and references; see the module."""

    #: the layers as they are written to a file, with what made them
    image: Image = field(repr=False)

    @property
    def airlight(self) -> Array:
        """The in-scattered radiance alone [W/(m^2 sr)], (height, width, 3)."""
        return image_layer(self.image, "airlight")

    @property
    def surface(self) -> Array:
        """The radiance of the lit surface through the medium [W/(m^2 sr)], (height, width, 3)."""
        return image_layer(self.image, "surface")

    @cached_property
    def total(self) -> Array:
        """Airlight, surface and the sky behind clouds [W/(m^2 sr)], (height, width, 3); the layer
        `emitted` of a reference, light that the camera sees of lamps and skies, is no part of it.
        """
        # The sky is a layer of its own only in references of clouds.
        background = self.image.layers.get("background")
        return read_only(self.airlight + self.surface + (0.0 if background is None else background))

    def layer(self, name: str) -> Array:
        """Return a layer by its name, such as 'airlight_3_4' or 'opacity', (height, width, 3).

        Raises
        ------
        InputError
            For a layer that the image lacks.
        """
        return image_layer(self.image, name)

    @property
    def depth(self) -> Array:
        """The distance along the ray to the visible surface, infinite where there is
        none [m], (height, width).
        """
        assert self.image.depth is not None
        return self.image.depth

    @property
    def size(self) -> tuple[int, int]:
        """Width and height [pixels]."""
        height, width = self.airlight.shape[:2]
        return width, height

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> Array:
        return as_array(self.total, dtype, copy)

    def to_dict(self) -> dict[str, Any]:
        """Return the fields of the record and the size, as JSON has them."""
        return super().to_dict() | {"size": list(self.size)}

    def with_total(self) -> Image:
        """Return the layers and the total among them."""
        return replace(self.image, layers=dict(self.image.layers) | {TOTAL: self.total})

    def picture(self, layer: str = TOTAL) -> NDArray[np.uint8]:
        """Return a layer, such as 'airlight' or 'surface', in the exposure of the
        total, (height, width, 3).
        """
        radiance = np.asarray(image_layer(self.with_total(), layer), dtype=np.float64)
        return tone_mapped(radiance, exposure(np.asarray(self.total, dtype=np.float64)))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the layers as EXR or a picture of the total as PNG, by the suffix of
        the path; return the path.

        Parameters
        ----------
        path
            Ends in .exr, or in .png for a picture through `reports.plotting.pictures.tone_curve`.

        Raises
        ------
        InputError
            For another suffix, or if the file cannot be written.
        """
        write_image(Path(path), self.image, total=self.total)
        return Path(path)

    def _repr_html_(self) -> str:
        from airlight.reports.tables.record import block, bullets, picture

        title = self.title
        # All light, and the airlight beside it where surfaces would hide it.
        shown = [picture(self._png, self.size[0], alt=f"{title}, all light", caption="all light")]
        if np.any(self.surface):
            png = png_bytes(self.picture("airlight"))
            shown.append(
                picture(png, self.size[0], alt=f"{title}, the airlight", caption="airlight")
            )
        said = [line for line in self.lines[1:] if not line.startswith(_NOTHING)]
        return block(title, *shown, bullets(said))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.title}, {self.size[0]} x {self.size[1]})"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Rendering(LayeredImage):
    """A frame by a real-time method."""

    method: str
    kernel: str | None  #: None for a method that calls none
    parameters: Mapping[str, Any]  #: parameters that differ from the method's defaults
    label: str  #: method, kernel and parameters in one
    precision: str  #: 'single' or 'double'
    plan: Mapping[str, str]  #: what the scene needs of a method, in words
    notes: tuple[str, ...] = ()  #: notes on the scene
    times: FrameTimes | None = None  #: what a frame costs, if that was measured
    samples: int = 1  #: rays a pixel
    device: str = ""  #: where it was rendered
    files: tuple[str, ...] = ()  #: that were written
    tone_curve: str | None = None  #: of the pictures among these

    @property
    def lines(self) -> Sequence[str]:
        """The cost of the frame, and the files that were written."""
        # A frame that was not timed tells how to time it.
        lines = [f"{self.title}" + ("" if self.times else "; --timed measures what a frame costs")]
        if self.times is not None:
            # A user's shader is one pass, which cannot be parted into surface and airlight.
            ms = {name: f"{time:.3g} ms" for name, time in self.times.medians.items()}
            whole = f"  {ms['frame']} a frame ({rate_words(self.times.frame.median_ms)})"
            lines += (
                [f"{whole}: all passes of the shader", f"  {self.device}"]
                if self.times.surface is None
                else [
                    f"{whole}: surface {ms['surface']}, airlight {ms['airlight']}",
                    f"  {ms['light_moved']} after the light moved, {ms['objects_moved']} after "
                    "objects moved",
                    f"  camera rays cached: {ms['light_moved_camera_cached']} after the light "
                    "moved, "
                    f"{ms['colours_changed']} after only medium or colours changed",
                    f"  {self.device}",
                ]
            )
        lines += [f"  picture: {self.tone_curve}"] if self.tone_curve else []
        # Averaging over a pixel hides the error of a method at pixel centres.
        if self.samples > 1:
            lines.append(
                f"  {self.samples} rays a pixel: a picture; a method's error is measured at pixel "
                "centres"
            )
        return [*lines, *_written(self.files, self.size)]

    @property
    def title(self) -> str:
        """Title of the frame."""
        return f"{self.scene} by {self.label}"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Reference(LayeredImage):
    """The reference of a scene, with its error."""

    estimator: str  #: 'quadrature', 'single-scatter', 'volpath' or 'cloud-paths'
    #: the mean error of the airlight over its mean, or the relative standard error of the image
    relative_error: float
    #: Shadow rays that checked the quadrature, or batches of an estimator that
    #: samples; None of merged files.
    how: QuadratureReference | MonteCarloReference | None = None

    @property
    def error(self) -> Array | None:
        """The error of the airlight without that of samples [W/(m^2 sr)], (height, width, 3).

        It is proven where it is a `bound`, else estimated; None for an estimator that samples.
        """
        return self.image.layers.get("airlight_error", self.bound)

    @property
    def bound(self) -> Array | None:
        """The proven bound of the error of the airlight [W/(m^2 sr)], (height, width, 3).

        None where the error is estimated, as in density grids, or statistical.
        """
        return self.image.layers.get("airlight_bound")

    @property
    def surface_error(self) -> Array | None:
        """The estimated error of the surface without that of samples [W/(m^2 sr)],
        (height, width, 3); None for an estimator that samples.
        """
        return self.image.layers.get("surface_error")

    @property
    def standard_error(self) -> Array | None:
        """The standard error of the airlight [W/(m^2 sr)], (height, width, 3); None
        where nothing is sampled.
        """
        return self.image.layers.get("airlight_se")

    @property
    def surface_standard_error(self) -> Array | None:
        """The standard error of the surface [W/(m^2 sr)], (height, width, 3); None
        where nothing is sampled.
        """
        return self.image.layers.get("surface_se")

    @property
    def emitted_standard_error(self) -> Array | None:
        """The standard error of the light that the camera sees of area lights and the sky
        [W/(m^2 sr)], (height, width, 3); None but for means over pixels.
        """
        return self.image.layers.get("emitted_se")

    def to_dict(self) -> dict[str, Any]:
        """Return the fields of the record, the means of the layers, and what the
        header says of the samples.
        """
        # JSON has the mean of each layer, (channels,), not its pixels.
        means = {name: layer.mean(axis=(0, 1)) for name, layer in self.image.layers.items()}
        said = {name: self.image.attributes.get(f"airlight:{name}") for name in _MADE}
        known = {
            name: value
            for name, value in {**said, "model": self.model}.items()
            if value is not None
        }
        return super().to_dict() | plain({"means": means, **known})

    @property
    def failures(self) -> Sequence[str]:
        """The error that was asked for, where it is not known to be reached."""
        missed = isinstance(self.how, MonteCarloReference) and self.how.reached is False
        return ["the target error was not reached"] if missed else []

    @property
    def lines(self) -> Sequence[str]:
        """Its means and its error."""
        # The opacity is a fraction and has no unit.
        lines, made = [self.title], self.to_dict()
        if self.model is not None:
            lines.append(f"  {model_line(**self.model)}")
        for name, mean in made["means"].items():
            unit = "" if name == "opacity" else " W/(m^2 sr)"
            lines.append(f"  {name}: mean {', '.join(f'{value:.6g}' for value in mean)}{unit}")
        # The quadrature states the errors of both layers, and what they are: proven, estimated or
        # statistical.
        how = self.how
        if isinstance(how, QuadratureReference) and how.relative_error is not None:
            lines.append(f"  airlight known to {how.relative_error:.2g} of its mean ({how.kind})")
        if isinstance(how, QuadratureReference) and how.surface_error is not None:
            lines.append(
                f"  surface known to {how.surface_error:.2g} of its mean ({how.surface_kind})"
            )
        if "batches" not in made:
            return lines
        batches = int(made["batches"])
        # A quadrature traces nothing: it has batches only where lights or positions are
        # sampled, and they have no seeds.
        if "spp" in made:
            kind = "batches"
            lines.append(
                f"  {made['spp']} samples a pixel in {batches} batches, seeds {made['seeds']}"
            )
        else:
            kind = "sets"
            drawn = "positions in each pixel" if made.get("pixel") == "area" else "light samples"
            lines.append(f"  standard errors from {batches} independent sets of {drawn}")
        # Merged files have batches and no run: cache and target belong to runs.
        if isinstance(how, MonteCarloReference):
            lines += [f"  {how.cached} of {batches} batches from the cache"] if how.cached else []
            files = "file" if how.damaged == 1 else "files"
            lines += (
                [f"  {how.damaged} damaged {files} of the cache traced again"]
                if how.damaged
                else []
            )
            lines.append(f"  standard error {_error_words(how)}")
        if batches < 32:
            # The relative standard error of a standard error from n normal values is 1 / sqrt(2 (n
            # - 1)); from 32 batches on it is below 13 % and not worth a line.
            known = 100 / (2 * (batches - 1)) ** 0.5
            lines.append(f"  a standard error from {batches} {kind} is known to {known:.0f} % only")
        return [*lines, *(f"  {failure}" for failure in self.failures)]

    @property
    def title(self) -> str:
        """Title of the reference, of a model by its name."""
        model = self.model
        of = "" if model is None else f" of the model {model['name'] or model['terms']}"
        return f"{self.scene}, the reference{of} by {self.estimator}"

    @property
    def model(self) -> dict[str, str] | None:
        """Name and terms of the model whose reference it is; None of the physical equation."""
        words = self.image.attributes.get(MODEL)
        return None if words is None else model_parts(str(words))


def _error_words(how: MonteCarloReference) -> str:
    errors = how.errors
    if errors.pooled is None or errors.worst is None:
        return f"unknown: {errors.unknown}"
    left_out = f"; {how.masked} pixels beside a light left out" if how.masked else ""
    return f"{100 * errors.pooled:.3g} % of the image, {100 * errors.worst:.3g} % of the worst pixel{left_out}"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RenderedFrames(OfScene):
    """The frames of an animation, which were written as files, and what they cost."""

    method: str
    moves: tuple[str, ...]
    size: tuple[int, int]
    frames: int
    move_ms: float  #: median of the frames after the first, as are the other times
    render_ms: float
    frame_ms: float
    recordings: Mapping[str, int]  #: how often each stage was compiled
    device: str
    files: tuple[str, ...]

    @property
    def title(self) -> str:
        """The scene, the method, and what moves."""
        return (
            f"{self.scene}, {self.method}: {self.frames} frames, {' and '.join(self.moves)} moving"
        )

    @property
    def lines(self) -> Sequence[str]:
        """The cost of a frame, and the files that were written."""
        lines = [
            self.title,
            f"  {self.frame_ms:.3g} ms a frame ({rate_words(self.frame_ms)}): {self.move_ms:.3g} "
            "ms to move, "
            f"{self.render_ms:.3g} ms to render, reusing what stood still; {self.device}",
        ]
        # One line for all files of a kind; the JSON file says what changes from frame to frame.
        for ending in dict.fromkeys(Path(path).suffix for path in self.files):
            own = [path for path in self.files if path.endswith(ending)]
            pixels = (
                f"{own[0]} to {own[-1]}: {len(own)} files, {' x '.join(map(str, self.size))} pixels"
            )
            lines.append(f"wrote {f'{own[0]}: what changes' if ending == '.json' else pixels}")
        return lines


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Plan(OfScene):
    """The features that a scene needs of a method."""

    plan: Mapping[str, str]  #: by feature, in words
    notes: tuple[str, ...] = ()  #: on the scene

    @property
    def title(self) -> str:
        """The scene."""
        return self.scene

    @property
    def lines(self) -> Sequence[str]:
        """A line for each feature, and the notes."""
        return [*(f"{name}: {said}" for name, said in self.plan.items()), *self.notes]


def write_image(
    path: Path, image: Image, curve: ToneCurve | None = None, *, total: Array | None = None
) -> None:
    """Write layers as .exr, or their total as .png through a tone curve; by
    default one that suits it.
    """
    from airlight.reference.storage.exr import write_exr
    from airlight.reports.machine.environment import stamped

    # An EXR file gets the versions and the build in its header.
    if path.suffix.lower() == ".exr":
        write_exr(path, stamped(image))
    elif path.suffix.lower() == ".png":
        light = image.layers["airlight"] + image.layers["surface"] if total is None else total
        write_png(path, preview(np.asarray(light, dtype=np.float64), curve or tone_curve(light)))
    else:
        raise InputError(
            f"save: got {str(path)!r}, expected a path that ends with .exr (all layers) or .png "
            "(picture)"
        )


def _written(files: Sequence[str], size: tuple[int, int]) -> list[str]:
    shown = " x ".join(map(str, size))
    what = {True: "airlight, surface, their sum, depth", False: "a picture"}
    lines = [
        f"wrote {path}: {what[path.lower().endswith('.exr')]}, {shown} pixels" for path in files
    ]
    return lines or [f"{_NOTHING}: -o NAME.png writes a picture, -o NAME.exr the layers"]


def as_array(values: Array, dtype: DTypeLike | None, copy: bool | None) -> Array:
    """Answer NumPy's protocol: a view, or a copy for another type; raises ValueError if a
    needed copy is forbidden.
    """
    # numpy.asarray(result, copy=False) forbids the copy that another type needs.
    if dtype is not None and np.dtype(dtype) != values.dtype:
        if copy is False:
            raise ValueError(f"a copy is needed to turn {values.dtype} into {np.dtype(dtype)}")
        return values.astype(dtype)
    return values.copy() if copy else values
