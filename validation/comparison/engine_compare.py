# SPDX-License-Identifier: BSD-3-Clause
"""An image that another renderer made of a scene, against the truth of that scene at the image's size."""

import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from reference.quadrature.ray_values import TruthImage
from reference.storage.exr import NOTE, TOTAL, Image, layer, read_exr
from validation.comparison.engine_hints import Hints, find_hints
from validation.comparison.images import Comparison, compare_images, read_mask
from validation.estimates.quadrature import truth_image
from validation.metrics.errors import plain
from validation.scenes.loading import LoadedScene, load_scene

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class EngineComparison:
    """How far an image from elsewhere is from the truth of a scene."""

    scene: str
    path: str
    size: tuple[int, int]  #: width and height [pixels]
    pixel: str  #: 'centre' or 'area': what a pixel of the truth is
    expected: str  #: what the layer was compared with: 'airlight', 'surface', or 'total' for both
    truth_error: float  #: bound of the error of the truth's airlight, relative to its mean
    comparison: Comparison
    hints: Hints
    note: str  #: what the reader of the file changed or left out
    margin: float | None  #: largest relative bias that counts as agreement

    @property
    def failures(self) -> tuple[str, ...]:
        """Why the comparison must be called failed; empty if it is not."""
        bias = self.comparison.metrics.relative_bias
        reasons = self.comparison.failures
        if self.margin is not None and self.comparison.statistics is None and not abs(bias) <= self.margin:
            reasons = (*reasons, f"the relative bias, {bias:+.3g}, is not within +-{self.margin:.3g}")
        return reasons

    def to_json(self) -> dict[str, Any]:
        """Return every number by name, those of `Comparison.to_json` among them."""
        return {
            "scene": self.scene,
            "file": self.path,
            "size": list(self.size),
            "pixel": self.pixel,
            "expected": self.expected,
            "truth_error": plain(self.truth_error),
            **self.comparison.to_json(),
            "factor": plain(self.hints.factor),
            "factor_rmse": plain(self.hints.factor_rmse),
            "hints": list(self.hints.words),
            "note": self.note,
            "failures": list(self.failures),
        }

    def summary(self) -> str:
        """Return the numbers as text, a line for each group."""
        of = "airlight + surface" if self.expected == TOTAL else self.expected
        pixel = "at pixel centres" if self.pixel == "centre" else "means over pixels"
        lines = [
            f"scene            {self.scene}, {self.size[0]} x {self.size[1]}; truth: {of}, {pixel}, airlight known to "
            f"{self.truth_error:.2g} of its mean",
            self.comparison.summary(),
            f"best factor      {self.hints.factor:.6g} times the image leaves a relative rmse of "
            f"{100 * self.hints.factor_rmse:.4g} %",
        ]
        lines += [f"suspect          {words}" for words in self.hints.words]
        lines += [f"file             {self.note}"] if self.note else []
        own = self.failures[len(self.comparison.failures) :]
        return "\n".join(lines + [f"failed           {reason}" for reason in own])


def compare_scene(
    scene: str,
    path: str | os.PathLike[str],
    *,
    layer: str | None = None,
    pixel: str = "centre",
    mask: str | os.PathLike[str] | None = None,
    margin: float | None = None,
    all_metrics: bool = False,
    flip: bool = False,
    exposure: float | None = None,
    progress: Progress | None = None,
) -> EngineComparison:
    """Compare an EXR file with the truth of a scene at the file's size.

    Parameters
    ----------
    scene
        A built-in scene or a Mitsuba XML file.
    path
        The EXR file.
    layer
        The layer to judge: by default 'airlight' where the file has it, else the plain channels, else its only layer.
        'airlight' and 'surface' are compared with those layers of the truth, any other with their sum.
    pixel
        'centre' or 'area', see `reference.quadrature.image.quadrature_image`.
    mask, all_metrics, flip, exposure
        See `validation.comparison.images.compare_files`.
    margin
        Largest relative bias [1] that counts as agreement; with standard errors, what they can show counts.
    progress
        Called with (share done, what) while the truth is computed.

    Raises
    ------
    InputError
        For a scene or a file that cannot be read, a layer that is not there, and a size of another aspect than the
        scene's.
    """
    if margin is not None and not margin > 0:
        raise InputError(f"margin: got {margin}, wanted a relative bias above 0, such as 0.005")
    image = read_exr(path)
    chosen = _chosen_layer(image, layer, path)
    loaded = scene_of_size(scene, _size(image, chosen, path), path)
    truth = truth_image(
        loaded.scene,
        pixel=pixel,
        progress=None if progress is None else lambda done, total, what: progress(done / total, what),
    )
    expected = chosen if chosen in ("airlight", "surface") else TOTAL
    layers = {name: values for name, values in image.layers.items() if name in (chosen, f"{chosen}_se")}
    with_errors = f"{chosen}_se" in layers
    comparison = compare_images(
        Image({chosen: truth_layer(truth, expected)}),
        Image(layers, attributes=image.attributes),
        layer=chosen,
        mask=None if mask is None else read_mask(mask),
        margin=margin if with_errors else None,
        all_metrics=all_metrics,
        flip=flip,
        exposure=exposure,
    )
    hints = find_hints(truth_layer(truth, expected), layers[chosen])
    if expected == TOTAL:
        hints = replace(hints, words=(*hints.words, *_without_surface(truth, layers[chosen])))
    return EngineComparison(
        scene=loaded.name,
        path=str(path),
        size=(int(layers[chosen].shape[1]), int(layers[chosen].shape[0])),
        pixel=pixel,
        expected=expected,
        truth_error=float(truth.airlight_bound.mean() / truth.airlight.mean()) if truth.airlight.any() else 0.0,
        comparison=comparison,
        hints=hints,
        note=str(image.attributes.get(NOTE, "")),
        margin=margin,
    )


def truth_layer(truth: TruthImage, name: str) -> NDArray[np.float64]:
    """Return 'airlight', 'surface' or their sum, 'total', (height, width, 3) [W/(m^2 sr)]."""
    return truth.airlight + truth.surface if name == TOTAL else getattr(truth, name)


def scene_of_size(scene: str, size: tuple[int, int], path: str | os.PathLike[str]) -> LoadedScene:
    """Return a scene at the size of an image of it.

    Raises
    ------
    InputError
        If the image has another aspect ratio than the scene by more than a pixel: it shows more or less of it.
    """
    loaded = load_scene(scene)
    width, height = (int(n) for n in loaded.scene.sensors()[0].film().size()) if loaded.scene.sensors() else size
    if abs(size[0] * height / width - size[1]) >= 1 and abs(size[1] * width / height - size[0]) >= 1:
        raise InputError(
            f"{path} is {size[0]} x {size[1]} pixels, {size[0] / size[1]:.4g} to 1; {loaded.name} is {width} x "
            f"{height}, {width / height:.4g} to 1: render it at that size or a multiple or share of it"
        )
    return load_scene(scene, size)


def _chosen_layer(image: Image, name: str | None, path: str | os.PathLike[str]) -> str:
    """Return the layer to judge, checked."""
    if name is not None:
        layer(image, name, path)
        return name or TOTAL
    colours = [each for each in image.layers if not each.endswith("_se")]
    for usual in ("airlight", TOTAL):
        if usual in colours:
            return usual
    if len(colours) != 1:
        raise InputError(
            f"{path} has no channels R, G, B and no layer 'airlight'; it has "
            f"{', '.join(sorted(colours)) or 'no layer of colours at all'}; name one by --layer"
        )
    return colours[0]


def _size(image: Image, name: str, path: str | os.PathLike[str]) -> tuple[int, int]:
    height, width, _ = layer(image, name, path).shape
    return width, height


def _without_surface(truth: TruthImage, image: NDArray[np.floating]) -> tuple[str, ...]:
    """Say so where an image of all light is the airlight alone, or the surface alone."""
    wholes = {"": truth_layer(truth, TOTAL), "airlight": truth.airlight, "surface": truth.surface}
    errors = {name: float(np.nanmean((image - values) ** 2)) for name, values in wholes.items()}
    for name in ("airlight", "surface"):
        if 100 * errors[name] < errors[""]:  # a tenth, before the root
            return (f"the image is the {name} alone: name its channels {name}.R, {name}.G, {name}.B",)
    return ()
