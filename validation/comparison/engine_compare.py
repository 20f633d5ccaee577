# SPDX-License-Identifier: BSD-3-Clause
"""An image that another renderer made of a scene, against the truth of that scene at the image's size.

The errors of the whole image are those against the truth that fits, at pixel centres or over their areas.
"""

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from reference.quadrature.light_points import REPLICATES
from reference.quadrature.ray_values import TruthImage
from reference.scene.read import read_truth
from reference.storage.exr import NOTE, TOTAL, Image, read_exr
from validation.comparison.engine_hints import GAIN, Hints
from validation.comparison.engine_layers import KINDS, JudgedLayer, expected_layer, judged_layer
from validation.comparison.engine_pixels import PIXELS, PixelFit, fit_pixel
from validation.comparison.engine_verdict import ErrorPlace, Verdict, error_place, judge
from validation.comparison.images import BATCHES, Comparison, compare_images, read_mask
from validation.estimates.agreement import pixel_angle
from validation.estimates.quadrature import truth_image
from validation.estimates.reference_layers import reference_error, reference_layer
from validation.metrics.errors import plain
from validation.scenes.loading import LoadedScene, load_scene

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class EngineComparison:
    """How far an image from elsewhere is from the truth of a scene."""

    scene: str
    path: str
    size: tuple[int, int]  #: width and height [pixels]
    fit: PixelFit  #: what a pixel of the truth is, and what is wrong with the image as a whole
    expected: str  #: what the layer was compared with: 'airlight', 'surface', or 'total' for both
    truth_error: float  #: bound of the error of the truth's airlight, with its standard error, relative to its mean
    comparison: Comparison
    place: ErrorPlace | None  #: where most of the error lies; None where there is none
    verdict: Verdict
    note: str  #: what the reader of the file changed or left out
    margin: float | None  #: largest relative bias that counts as agreement
    truth: NDArray[np.floating] = field(repr=False, compare=False)  #: what the image was compared with
    image: NDArray[np.floating] = field(repr=False, compare=False)  #: the layer that was judged

    @property
    def layer(self) -> str:
        """The layer that was judged."""
        return self.comparison.layer

    @property
    def pixel(self) -> str:
        """What a pixel of the truth is: its 'centre' or its 'area'."""
        return self.fit.pixel

    @property
    def hints(self) -> Hints:
        """What may be wrong with the image as a whole."""
        return self.fit.hints

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
            "pixel_errors": {"centre": plain(self.fit.centre_error), "area": plain(self.fit.area_error)},
            "where": None if self.place is None else self.place.to_json(),
            "verdict": self.verdict.to_json(),
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
            f"pixels           {self.fit.words}",
            self.comparison.summary(),
        ]
        hints = self.hints
        fitted = f"{hints.factor:.6g} times the image leaves a relative rmse of {100 * hints.factor_rmse:.4g} %"
        lines.append(f"best factor      {f'none: {hints.reason}' if hints.reason else fitted}")
        lines += [] if self.place is None else [f"where            {self.place.words}"]
        lines += [f"suspect          {words}" for words in self.hints.words]
        lines += [f"file             {self.note}"] if self.note else []
        own = self.failures[len(self.comparison.failures) :]
        lines += [f"failed           {reason}" for reason in own]
        return "\n".join([*lines, f"verdict          {self.verdict.words}"])


def compare_scene(
    scene: str,
    path: str | os.PathLike[str],
    *,
    layer: str | None = None,
    holds: str | None = None,
    pixel: str | None = None,
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
    layer, holds
        The layer to judge and what it holds, see `validation.comparison.engine_layers.judged_layer`.
    pixel
        'centre' or 'area', see `reference.quadrature.image.quadrature_image`; by default what fits.
    mask, all_metrics, flip, exposure
        See `validation.comparison.images.compare_files`.
    margin
        Largest relative bias [1] that counts as agreement; with standard errors, what they can show counts.

    Raises
    ------
    InputError
        For a scene or a file that cannot be read, a layer that is not there, and a size of another aspect than the
        scene's.
    """
    if margin is not None and not 0 < margin < math.inf:
        raise InputError(f"margin: got {margin}, wanted a relative bias above 0, such as 0.005")
    if pixel is not None and pixel not in PIXELS:
        raise InputError(f"--pixel {pixel}; wanted 'centre' or 'area'")
    image = read_exr(path)
    judged = judged_layer(image, path, name=layer, holds=holds)
    chosen = image.with_data(None if mask is None else read_mask(mask))
    loaded = scene_of_size(scene, judged.size, path)
    truth_of = truths(loaded, progress)
    fit = fit_pixel(judged, truth_of, pixel)
    # Light of another kind says nothing of the pixels: either truth may fit it.
    other = _other_light(judged, [truth_of(each) for each in ((fit.pixel,) if pixel else ("centre", fit.pixel))])
    fit = replace(fit, hints=replace(fit.hints, words=(*fit.hints.words, *other)))
    name, with_errors = judged.name, f"{judged.name}_se" in image.layers
    layers = {name: judged.values} | ({f"{name}_se": image.layers[f"{name}_se"]} if with_errors else {})
    wanted = expected_layer(fit.truth, judged)
    expected = {name: wanted}
    own_error = reference_error(fit.truth, judged.holds)
    if with_errors and own_error is not None:
        # Where no path of the image arrived it has no standard error: the truth alone must not judge such a value.
        expected[f"{name}_se"] = np.where(layers[f"{name}_se"] > 0, own_error, 0.0)
    comparison = compare_images(
        Image(expected, attributes={BATCHES: REPLICATES}),
        Image(layers, attributes=image.attributes),
        layer=name,
        mask=chosen,
        margin=margin if with_errors else None,
        all_metrics=all_metrics,
        flip=flip,
        exposure=exposure,
    )
    compared = wanted if chosen is None else np.where(chosen[:, :, None], wanted, np.nan)
    test = judged.values.astype(np.float64)
    return EngineComparison(
        scene=loaded.name,
        path=str(path),
        size=judged.size,
        fit=fit,
        expected=judged.holds,
        truth_error=relative_bound(fit.truth),
        comparison=comparison,
        place=error_place(compared, test, lamp_distance(loaded, fit.truth)),
        verdict=judge(compared, test, fit.hints, comparison.failures),
        note=str(image.attributes.get(NOTE, "")),
        margin=margin,
        truth=wanted,
        image=judged.values,
    )


def truths(loaded: LoadedScene, progress: Progress | None = None) -> Callable[[str], TruthImage]:
    """Return a function that computes the truth at pixel centres or over their areas, or takes it from the cache."""
    tell = None if progress is None else lambda done, total, what: progress(done / total, what)
    return cache(lambda pixel: truth_image(loaded.scene, pixel=pixel, progress=tell))


def relative_bound(truth: TruthImage) -> float:
    """Return how well the airlight is known relative to its mean, where both are finite: its bound + standard error."""
    error = truth.airlight_bound if truth.airlight_se is None else truth.airlight_bound + truth.airlight_se
    finite = np.isfinite(truth.airlight) & np.isfinite(error)
    mean = float(truth.airlight[finite].mean()) if finite.any() else 0.0
    return float(error[finite].mean()) / mean if mean > 0 else 0.0


def lamp_distance(loaded: LoadedScene, truth: TruthImage) -> NDArray[np.float64]:
    """Return how far the nearest lamp is from each pixel, (height, width) [pixels in the middle of the image]."""
    angle = pixel_angle(read_truth(loaded.scene))  # zero in an image of one column
    return truth.light_angle / angle if angle > 0 else np.full(truth.light_angle.shape, math.inf)


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


def _other_light(judged: JudgedLayer, fitting: list[TruthImage]) -> tuple[str, ...]:
    """Say so where an image is the airlight or the surface alone, or all light, and not what it was taken for."""
    errors, powers = {}, {}
    if judged.holds == TOTAL and judged.emitted and fitting[0].emitted is not None:
        shown, hidden = (
            min(_mean_square(judged.values - reference_layer(truth, TOTAL, emitted=emitted)) for truth in fitting)
            for emitted in (True, False)
        )
        if GAIN**2 * hidden < shown:
            return ("the image does not show the area lights that the camera sees: compare its airlight",)
    for name in KINDS:
        layers = [reference_layer(truth, name, emitted=judged.emitted) for truth in fitting]
        errors[name] = min(_mean_square(judged.values - values) for values in layers)
        powers[name] = _mean_square(layers[0])
    nearest = min(errors, key=errors.__getitem__)
    # A dim image is near to a layer without light, but not nearer than a tenth of that layer's own.
    if nearest == judged.holds or not GAIN**2 * errors[nearest] < min(errors[judged.holds], powers[nearest]):
        return ()
    if nearest == TOTAL:
        return ("the image is all light: say --holds total",)
    channels = ", ".join(f"{nearest}.{channel}" for channel in "RGB")
    return (f"the image is the {nearest} alone: name its channels {channels}, or say --holds {nearest}",)


def _mean_square(values: NDArray[np.floating]) -> float:
    finite = values[np.isfinite(values)]
    return float(np.mean(finite**2)) if finite.size else math.inf
