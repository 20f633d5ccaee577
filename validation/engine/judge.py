# SPDX-License-Identifier: BSD-3-Clause
"""Whether an image that another renderer made of a scene is right, against the reference
of that scene at its size.

**Pixels.** A renderer that filters its samples by a box writes means over the areas of pixels, one
that traces a ray through each centre does not, and few say which. The two differ where the radiance
changes within a pixel: at edges, and beside a light, by 10 % and more. Only values that differ can
decide, so only these values are compared. With r the reference of either kind and t the image,
without the faults of the whole that `hints.py` finds, the error is the mean of

    |t - r| / max(|t|, |r|, 0.001 mean(r))

No single value decides this mean. The kind with the smaller error fits.

The verdict is that of `verdict.py`.
"""

import math
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.reference.quadrature.image import ReferenceImage
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.quadrature.replicates import REPLICATES
from airlight.reference.scene.model import PHYSICAL, Model
from airlight.reference.scene.read import read_reference
from airlight.reference.storage.exr import (
    BATCHES,
    BOUND,
    NOTE,
    SHARED,
    TOTAL,
    Attribute,
    Image,
    read_exr,
)
from airlight.validation.arrays import Array, Bools, Progress
from airlight.validation.comparison.images import Comparison, compare_images, read_mask
from airlight.validation.engine.error_place import ErrorPlace, error_place
from airlight.validation.engine.hints import GAIN, Hints, find_hints
from airlight.validation.engine.model_errors import ModelErrors, model_errors
from airlight.validation.engine.observation import (
    KINDS,
    PIXEL_WORDS,
    JudgedLayer,
    PixelKind,
    decide_pixel,
    expected_layer,
    judged_layer,
    pixel_kinds,
    relative_errors,
    scene_of_size,
)
from airlight.validation.engine.other_orders import OtherOrders, other_orders
from airlight.validation.engine.verdict import Verdict, block_errors, judge
from airlight.validation.estimates.agreement import pixel_angle
from airlight.validation.estimates.quadrature import (
    known_to,
    known_words,
    off_by,
    reference_error,
    reference_layer,
    shared_part,
    stated_error,
)
from airlight.validation.metrics.errors import FLOOR
from airlight.validation.scenes.changes import UNCHANGED, Changes
from airlight.validation.scenes.loading import LoadedScene
from airlight.validation.statistics.comparison import check_margin
from airlight.validation.statistics.estimate import Estimate

ReferenceOf = Callable[[str], ReferenceImage]  #: returns the reference for 'centre' or 'area'


@dataclass(frozen=True)
class EngineComparison:
    """How far an image from elsewhere is from the reference of a scene."""

    scene: str
    path: str
    size: tuple[int, int]  #: width and height [pixels]
    #: what a pixel is, and how well either kind fits where the two references differ
    kind: PixelKind
    hints: Hints  #: what may be wrong with the image as a whole
    expected: str  #: what the layer was compared with: 'airlight', 'surface', or 'total' for both
    #: mean of the layer of the reference, and the error of this mean [W/(m^2 sr)]
    known: Estimate
    comparison: Comparison
    place: ErrorPlace | None  #: where most of the error lies; None where there is none
    verdict: Verdict  #: by the reference of the model where the scene has one
    note: str  #: what the reader of the file changed or left out
    #: the reference that it was judged by, and its layer
    layers: ReferenceImage = field(repr=False, compare=False)
    reference: NDArray[np.floating] = field(repr=False, compare=False)
    image: NDArray[np.floating] = field(repr=False, compare=False)  #: the layer that was judged
    model: ModelErrors | None = None  #: where the reference is that of a model

    @property
    def pixel(self) -> str:
        """Where a pixel of the reference is taken: at its 'centre' or over its 'area'."""
        return self.kind.pixel

    def summary(self) -> str:
        """Return the numbers as text, a line for each group."""
        of = "airlight + surface" if self.expected == TOTAL else self.expected
        name = "reference" if self.model is None else "reference of the model"
        lines = [
            f"scene            {self.scene}, {self.size[0]} x {self.size[1]}; {name}: {of}, "
            f"{PIXEL_WORDS[self.pixel]}, {known_words(self.known)}",
            f"pixels           {self.kind.words}",
            self.comparison.summary(),
        ]
        hints = self.hints
        fitted = (
            f"{hints.factor:.6g} times the image leaves a relative rmse of "
            f"{100 * hints.factor_rmse:.4g} %"
        )
        lines.append(f"best factor      {f'none: {hints.reason}' if hints.reason else fitted}")
        lines += [] if self.place is None else [f"where            {self.place.words}"]
        lines += [f"suspect          {words}" for words in self.hints.words]
        lines += [f"file             {self.note}"] if self.note else []
        if self.model is None:
            return "\n".join([*lines, f"verdict          {self.verdict.words}"])
        own = "it is judged by the equation of the model, which is not the physical one"
        return "\n".join(
            [*lines, *self.model.lines, f"verdict          {self.verdict.words}; {own}"]
        )


def compare_scene(
    scene: str,
    path: str | os.PathLike[str],
    *,
    layer: str | None = None,
    holds: str | None = None,
    pixel: str | None = None,
    mask: str | os.PathLike[str] | None = None,
    margin: float | None = None,
    margin_total: float | None = None,
    all_metrics: bool = False,
    changes: Changes = UNCHANGED,
    model: Model | None = None,
    progress: Progress | None = None,
) -> EngineComparison:
    """Compare an EXR file with the reference of a scene at the file's size.

    Parameters
    ----------
    scene
        A built-in scene or a Mitsuba XML or pbrt file.
    path
        The EXR file.
    layer, holds
        The layer to judge and what it holds, see `validation.engine.observation.judged_layer`.
    pixel
        'centre' or 'area', see `reference.quadrature.image.quadrature_image`; by default what the
        image says of itself, or what fits.
    mask
        An EXR file that is 0 in pixels to leave out.
    margin
        Largest relative bias [1] that counts as agreement; an image with standard errors must show
        with them that its bias is within it. It holds the error of the reference too.
    margin_total
        With a model: the largest relative bias against the physical equation [1].
    all_metrics
        See `validation.comparison.images.compare_images`.
    changes
        Values by name that replace those of the scene, see `validation.scenes.changes`.
    model
        The equation to judge by, in the place of that which the scene names.
    progress
        Called with (fraction done, what).
    """
    # The layer, the scene at the size of the image, and the pixels that file and mask have.
    image = read_exr(path)
    judged = judged_layer(image, path, name=layer, holds=holds)
    loaded = scene_of_size(scene, judged.size, path, changes, model)
    if margin_total is not None and loaded.model.is_physical:
        raise InputError(
            "margin_total: the scene is judged by the physical equation; expected a model beside it, "
            "or margin"
        )
    check_margin(margin_total)
    chosen = image.with_data(None if mask is None else read_mask(mask))
    compared = judge_image(
        image,
        judged,
        loaded,
        references(loaded, progress),
        path=path,
        pixel=pixel,
        mask=chosen,
        margin=margin,
        all_metrics=all_metrics,
    )
    if not compared.verdict.right:
        at_size = partial(scene_of_size, scene, path=path, changes=changes, model=model)
        orders = other_orders(
            loaded, at_size, judged.holds, compared.comparison.metrics.relative_bias
        )
        compared = compared if orders is None else _with_orders(compared, orders, chosen)
    compared = with_model(compared, judged, loaded, chosen, progress)
    if margin_total is None:
        return compared
    return _within_total(compared, judged, loaded, chosen, margin_total, progress)


def _with_orders(
    compared: EngineComparison, orders: OtherOrders, mask: Bools | None
) -> EngineComparison:
    """Return a comparison that says which orders of scattering the image may hold.

    Where these dominate, no factor of single scattering says anything of the image.
    """
    words = (orders.words,) if orders.dominate else (*compared.hints.words, orders.words)
    hints = replace(compared.hints, words=words)
    correct, image = (np.asarray(v, dtype=np.float64) for v in (compared.reference, compared.image))
    # Pixels outside of the mask count nowhere.
    image = image if mask is None else np.where(np.asarray(mask)[:, :, None], image, np.nan)
    verdict = judge(correct, image, hints, compared.comparison.failures)
    return replace(compared, hints=hints, verdict=verdict)


def with_model(
    compared: EngineComparison,
    judged: JudgedLayer,
    loaded: LoadedScene,
    mask: Bools | None = None,
    progress: Progress | None = None,
) -> EngineComparison:
    """Return a comparison with the errors of the equation apart from those of the algorithm, where
    the scene has a model.
    """
    if loaded.model.is_physical:
        return compared
    return replace(compared, model=errors_of(compared, judged, loaded, mask, progress))


def errors_of(
    compared: EngineComparison,
    judged: JudgedLayer,
    loaded: LoadedScene,
    mask: Bools | None = None,
    progress: Progress | None = None,
) -> ModelErrors:
    """Return the errors of the scene's equation, which may be the physical one, and of an image
    against both.
    """
    shown = judged.values.astype(np.float64)
    if mask is not None:
        shown = np.where(np.asarray(mask)[:, :, None], shown, np.nan)
    tell, side = _telling(progress), compared.verdict.block
    return model_errors(
        shown,
        loaded.model,
        lambda model: expected_layer(
            reference_image(loaded.scene, pixel=compared.pixel, model=model, progress=tell), judged
        ),
        lambda correct, other: block_errors(correct, other, side)[0],
    )


def _within_total(
    compared: EngineComparison,
    judged: JudgedLayer,
    loaded: LoadedScene,
    mask: Bools | None,
    margin: float,
    progress: Progress | None,
) -> EngineComparison:
    """Return a comparison that fails where the bias against the physical equation is beyond a
    margin, with what the reference and a noisy image may be off, or is not known.
    """
    errors = compared.model
    assert errors is not None, "a margin against physics is refused without a model"
    bias = None if errors.total is None else errors.total.mean
    words = f"the relative bias against physics is not known, not within +-{margin:.3g}"
    if bias is not None:
        tell = _telling(progress)
        physical = reference_image(
            loaded.scene, pixel=compared.pixel, model=PHYSICAL, progress=tell
        )
        off = off_by(physical, judged.holds, emitted=judged.emitted, mask=mask)[0]
        statistics = compared.comparison.statistics
        if statistics is not None:
            # The interval is relative to the mean of the model's reference.
            low, high = statistics.relative_bias_ci
            equation = None if errors.against_physics is None else errors.against_physics.mean
            if low is None or high is None or equation is None:
                off = math.inf
            else:
                off += (high - low) / 2 * (1 + equation)
        if abs(bias) + off <= margin:
            return compared
        shown = "" if abs(bias) > margin else f"shown to be (it may be off by {off:.2g}) "
        words = (
            f"the relative bias against physics is {bias:+.3g}, not {shown}within +-{margin:.3g}"
        )
    comparison = compared.comparison
    failed = replace(comparison, failures=(*comparison.failures, words))
    return replace(compared, comparison=failed)


def judge_image(
    image: Image,
    judged: JudgedLayer,
    loaded: LoadedScene,
    reference_of: ReferenceOf,
    *,
    path: str | os.PathLike[str] = "the image",
    pixel: str | None = None,
    mask: Bools | None = None,
    margin: float | None = None,
    all_metrics: bool = False,
) -> EngineComparison:
    """Judge a layer of an image by the reference of its scene, as in `compare_scene` and reports.

    Parameters
    ----------
    image, judged
        The image, and the layer of it.
    loaded, reference_of
        The scene at the size of the image, and a function that computes its reference for 'centre'
        or 'area'.
    path
        The name of the image in messages.
    pixel, margin
        See `compare_scene`.
    mask
        Which pixels are compared, (height, width); all by default.
    all_metrics
        See `validation.comparison.images.compare_images`.
    """
    # Pixels outside of the mask count nowhere: neither in what pixels are, nor in the verdict.
    check_margin(margin)
    kinds = pixel_kinds(image, pixel)
    if mask is not None and np.shape(mask) == judged.values.shape[:2]:
        judged = replace(
            judged, values=np.where(np.asarray(mask)[:, :, None], judged.values, np.nan)
        )
    kind, hints = fitting_kind(judged, reference_of, kinds)
    # An image of another kind of light does not say what its pixels are: either reference may fit.
    other = _other_light(judged, [reference_of(each) for each in (kinds[0], kind.pixel)])
    hints, fitting = replace(hints, words=(*hints.words, *other)), reference_of(kind.pixel)
    # The comparison gets the layer and the reference under one name, with their standard errors if
    # the image has any.
    name, with_errors = judged.name, f"{judged.name}_se" in image.layers
    layers = {name: image.layers[name]} | (
        {f"{name}_se": image.layers[f"{name}_se"]} if with_errors else {}
    )
    correct = expected_layer(fitting, judged)
    expected = {name: correct}
    own_error = reference_error(fitting, judged.holds, emitted=judged.emitted)
    made: dict[str, Attribute] = {BATCHES: REPLICATES}
    if with_errors and own_error is not None:
        made[SHARED] = shared_part(fitting, judged.holds)
        # Where no path of the image arrived it has no standard error: the reference alone
        # must not judge such a value.
        expected[f"{name}_se"] = np.where(layers[f"{name}_se"] > 0, own_error, 0.0)
    if with_errors and margin is not None:
        # A margin holds the error of the reference that is no noise, too; NaN where nobody knows it.
        stated = stated_error(fitting, judged.holds)
        expected[f"{name}_bound"] = (
            np.full(correct.shape, math.nan) if stated is None else stated[0]
        )
        made[BOUND] = "estimated" if stated is None else stated[1]
    comparison = compare_images(
        Image(expected, attributes=made),
        Image(layers, attributes=image.attributes),
        layer=name,
        mask=mask,
        margin=margin if with_errors else None,
        all_metrics=all_metrics,
    )
    # Without standard errors of the image a margin holds its bias and, beside that, what the mean
    # of the reference may be off.
    bias = comparison.metrics.relative_bias
    if margin is not None and not with_errors:
        off = off_by(fitting, judged.holds, emitted=judged.emitted, mask=mask)[0]
        if bias is None or abs(bias) + off > margin:
            bias_words = "undefined" if bias is None else f"{bias:+.3g}"
            words = f"the relative bias, {bias_words}, is not within +-{margin:.3g}"
            if bias is not None and abs(bias) <= margin:
                words = (
                    f"the relative bias, {bias_words}, is not shown to be within +-{margin:.3g}: "
                    f"the mean of the reference may be off by {off:.2g}"
                )
            comparison = replace(comparison, failures=(*comparison.failures, words))
    test = judged.values.astype(np.float64)
    return EngineComparison(
        scene=loaded.name,
        path=str(path),
        size=judged.size,
        kind=kind,
        hints=hints,
        expected=judged.holds,
        known=known_to(fitting, judged.holds, emitted=judged.emitted),
        comparison=comparison,
        place=error_place(correct, test, lamp_distance(loaded, fitting)),
        verdict=judge(correct, test, hints, comparison.failures),
        note=str(image.attributes.get(NOTE, "")),
        layers=fitting,
        reference=correct,
        image=image.layers[name],
    )


def references(
    loaded: LoadedScene, progress: Progress | None = None
) -> Callable[[str], ReferenceImage]:
    """Return a function that computes the reference at pixel centres or over their
    areas, or reads the cache.
    """
    tell = _telling(progress)
    return cache(
        lambda pixel: reference_image(loaded.scene, pixel=pixel, model=loaded.model, progress=tell)
    )


def _telling(progress: Progress | None) -> Callable[[int, int, str], None] | None:
    return None if progress is None else lambda done, total, what: progress(done / total, what)


def lamp_distance(loaded: LoadedScene, reference: ReferenceImage) -> Array:
    """Return the distance of each pixel from the nearest light, (height, width) [pixels in the
    middle of the image].
    """
    angle = pixel_angle(read_reference(loaded.scene, loaded.model))  # zero in an image of one pixel
    return (
        reference.light_angle / angle
        if angle > 0
        else np.full(reference.light_angle.shape, math.inf)
    )


def _other_light(judged: JudgedLayer, fitting: list[ReferenceImage]) -> tuple[str, ...]:
    """Return a sentence where an image is the airlight or the surface alone, or all light, and was
    taken for another of these.
    """
    # The mean square error against each kind of light, by the reference that fits better, and the
    # mean square of that light itself.
    errors, powers = {}, {}
    if judged.holds == TOTAL and judged.emitted and fitting[0].emitted is not None:
        # An image of all light may leave out the area lights that the camera sees.
        with_lights, without_lights = (
            min(
                _mean_square(judged.values - reference_layer(reference, TOTAL, emitted=emitted))
                for reference in fitting
            )
            for emitted in (True, False)
        )
        if GAIN**2 * without_lights < with_lights:
            return (
                "the image does not show the area lights that the camera sees: "
                "compare its airlight",
            )
    for name in KINDS:
        layers = [reference_layer(reference, name, emitted=judged.emitted) for reference in fitting]
        errors[name] = min(_mean_square(judged.values - values) for values in layers)
        # The same pixels count in both: a mask has made the others of the image NaN.
        powers[name] = _mean_square(np.where(np.isfinite(judged.values), layers[0], np.nan))
    nearest = min(errors, key=errors.__getitem__)
    # A dim image is near to a layer without light, but not nearer than a tenth of that layer's own.
    if nearest == judged.holds or not GAIN**2 * errors[nearest] < min(
        errors[judged.holds], powers[nearest]
    ):
        return ()
    if nearest == TOTAL:
        return (f"the image is all light: say --layer {judged.name}=total",)
    channels = ", ".join(f"{nearest}.{channel}" for channel in "RGB")
    return (
        f"the image is the {nearest} alone: name its channels {channels}, or say --layer "
        f"{judged.name}={nearest}",
    )


def _mean_square(values: NDArray[np.floating]) -> float:
    finite = values[np.isfinite(values)]
    return float(np.mean(finite**2)) if finite.size else math.inf


def fitting_kind(
    judged: JudgedLayer, reference_of: ReferenceOf, kinds: Sequence[str]
) -> tuple[PixelKind, Hints]:
    """Return the kind of an image's pixels, by the reference that fits it, and the suspected
    faults of the whole image.

    `reference_of`: computes a reference; asked for the means only if the image does not fit the
    centres to 0.1 %; `kinds`: what its pixels may be, see
    `validation.engine.observation.pixel_kinds`.
    """

    def attempt(kind: str) -> tuple[Array, Hints]:
        correct = expected_layer(reference_of(kind), judged)
        return correct, find_hints(correct, judged.values)

    def errors(attempts: Sequence[tuple[Array, Hints]]) -> list[float]:
        (centre, _), (area, _) = attempts
        # Where the references differ by 1 % of the larger one, a value says which of them fits. A
        # centre at a light itself is infinite, and counts too.
        apart = np.abs(area - centre) > 0.01 * np.maximum(area, centre)
        return [_error(correct, hints.corrected, apart) for correct, hints in attempts]

    kind, (_, hints) = decide_pixel(
        kinds, attempt, errors, lambda each: _fits(each[0], each[1].corrected)
    )
    return kind, hints


def _fits(reference: Array, image: Array) -> bool:
    """Return whether an image fits so well that nothing can fit better: to a relative rmse of
    0.1 %.
    """
    # Pixels outside of a mask are NaN, and count nowhere.
    finite = np.isfinite(reference) & np.isfinite(image)
    if not finite.any():
        return False
    difference, power = (image - reference)[finite], float(np.mean(reference[finite] ** 2))
    return bool(np.mean(difference**2) <= 1e-3**2 * power)


def _error(reference: Array, image: Array, where: Bools) -> float:
    """Return the error over some values; an infinite reference is wrong by all of it."""
    finite, chosen = np.isfinite(reference), where & np.isfinite(image)
    if not chosen.any():
        return 0.0
    floor = FLOOR * float(reference[finite].mean()) if finite.any() else 0.0
    return float(np.abs(relative_errors(reference[chosen], image[chosen], floor)).mean())
