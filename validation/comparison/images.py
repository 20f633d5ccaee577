# SPDX-License-Identifier: BSD-3-Clause
"""Comparison of two image files: how large the error is, and whether it is more than noise."""

import math
import os
import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from airlight.errors import InputError
from airlight.reference.storage.exr import (
    BATCHES,
    BOUND,
    MODEL,
    NOTE,
    PIXEL,
    SHARED,
    TOTAL,
    Image,
    layer_names,
    read_exr,
)
from airlight.reference.storage.exr import layer as image_layer
from airlight.validation.arrays import Array, Bools
from airlight.validation.columns import columns_of, shown_values
from airlight.validation.metrics.colour import ColourDifference, colour_difference
from airlight.validation.metrics.errors import Metrics, compared, error_metrics, wrong_pixels
from airlight.validation.metrics.flip import Flip, flip_hdr
from airlight.validation.metrics.other_tools import PublishedErrors, published_errors
from airlight.validation.statistics.comparison import (
    LEVEL,
    NoisyImage,
    check_margin,
    compare_statistics,
)
from airlight.validation.statistics.estimate import Answer, Estimate, Kind
from airlight.validation.statistics.records import Statistics

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

_ORDER = re.compile(r"airlight_\d+(_(\d+|inf))?")


@dataclass(frozen=True)
class StatedErrors:
    """The errors without noise that two files state of their own pixels, and what they
    make of the relative bias.
    """

    #: mean of its layer, and of the error of its pixels [W/(m^2 sr)]; None if not stated
    reference: Estimate | None
    test: Estimate | None  #: the same of the test image
    #: by how much both can change the relative bias [1]; None where it is not known
    bias_error: float | None
    kind: Kind  #: proven if all stated errors are
    #: that these errors alone decide on; standard errors have it in `Statistics`
    margin: float | None = None
    equivalent: bool | None = None  #: whether the relative bias is known to be within the margin


@dataclass(frozen=True)
class Comparison:
    """The numbers that `airlight compare` prints."""

    layer: str  #: the layer that was compared
    metrics: Metrics  #: of all pixels that the mask leaves
    statistics: Statistics | None  #: None where neither image has standard errors
    stated: StatedErrors | None = None  #: None where neither file states an error of the layer
    masked: int = 0  #: pixels that the mask leaves out
    errors: PublishedErrors | None = None  #: as other tools print them
    #: the same with the mean of the reference as the unit
    errors_normalised: PublishedErrors | None = None
    colour: ColourDifference | None = None  #: None if it was not asked for
    flip: Flip | None = None  #: None if it was not asked for
    #: of the layers by order of scattering that both images have
    orders: tuple["Comparison", ...] = ()
    notes: tuple[str, ...] = ()  #: what was changed or left out when files were read
    #: Why the comparison must be called failed: pixels that are not finite or negative,
    #: a bias beyond the margin.
    failures: tuple[str, ...] = ()

    def summary(self) -> str:
        """Return the numbers as text, a line for each group."""
        # The errors, which every comparison has.
        m = self.metrics
        lines = [
            f"layer            {self.layer}, {m.pixels} pixels, {self.masked} masked, "
            f"{m.nonfinite} not finite, "
            f"{m.negative} negative",
            f"bias             {shown(m.bias)} W/(m^2 sr), relative {percent(m.relative_bias)}",
            f"rmse             {shown(m.rmse)} W/(m^2 sr), relative {percent(m.relative_rmse)}",
            f"relative error   p50 {shown(m.p50, 3)}, p99 {shown(m.p99, 3)}, max {shown(m.max, 3)}",
        ]
        if m.bias is not None and m.relative_bias is None:
            lines.append(
                "  undefined      the mean of the reference is not above zero: nothing is relative "
                "to it"
            )
        # The errors of both images, and the numbers of other tools, where there are any.
        lines += [] if self.stated is None else _stated_lines(self.stated)
        if self.statistics is not None:
            lines += statistics_lines(self.statistics)
        records: dict[str, DataclassInstance | None] = {
            "other tools": self.errors,
            "over the mean": self.errors_normalised,
            "colour": self.colour,
            "FLIP": self.flip,
        }
        for name, record in records.items():
            lines += [] if record is None else record_lines(name, record)
        lines += [order_line(each.layer, each.metrics, each.statistics) for each in self.orders]
        lines += [f"file             {note}" for note in self.notes]
        return "\n".join(lines + [f"failed           {reason}" for reason in self.failures])


def compare_images(
    reference: Image,
    test: Image,
    *,
    layer: str | None = None,
    mask: ArrayLike | None = None,
    margin: float | None = None,
    all_metrics: bool = False,
    names: tuple[str, str] = ("the reference", "the test image"),
) -> Comparison:
    """Compare a layer of two images whose errors are independent, `total` for the plain channels.

    By default that is the airlight where both have one, else the plain channels; with the airlight
    also the layers by order of scattering that both have, such as `airlight_3_4`.

    Statistics need the standard errors in the layer `<layer>_se` of either image; with both, both
    count. The header attribute `airlight:batches` says from how many batch means they come, and
    `airlight:shared` how far pixels share their errors, see `NoisyImage`; without it they are
    independent. An
    error that is no noise is in the layer `<layer>_bound` of either image where it is proven, and
    in `<layer>_error` where it is estimated; older files have estimates in `<layer>_bound` too, and
    the attribute `airlight:bound` says which it is.

    The mask says which pixels to compare, (height, width) of truth values; pixels of the frame that
    a file does not hold are left out too. The `margin` is the largest relative bias that counts as
    agreement; it needs errors of either kind, and counts all that there are. `all_metrics` adds the
    errors by the formulae of other tools, the colour differences and HDR-FLIP. Messages call the
    images by their `names`.
    """
    check_margin(margin)
    named = tuple(zip(names, (reference, test)))
    chosen = test.with_data(reference.with_data(None if mask is None else np.asarray(mask)))
    name = common_layer(*named) if layer is None else layer
    whole = _compared(named, name, chosen, margin, all_metrics=all_metrics)
    orders = [each for each in reference.layers if _ORDER.fullmatch(each) and each in test.layers]
    orders = sorted(orders, key=lambda each: int(each.split("_")[1])) if name == "airlight" else []
    by_order = tuple(_compared(named, each, chosen) for each in orders)
    return replace(
        whole,
        orders=by_order,
        notes=(
            *(
                f"{path}: {image.attributes[NOTE]}"
                for path, image in named
                if NOTE in image.attributes
            ),
            *_apart(named),
        ),
        failures=whole.failures
        + tuple(f"{each.layer}: {why}" for each in by_order for why in each.failures),
    )


def _apart(named: Sequence[tuple[str, Image]]) -> list[str]:
    """Return a note for each attribute by which two images should differ."""
    notes = []
    for key, words in ((PIXEL, "pixels"), (MODEL, "equation")):
        said = []
        for path, image in named:
            # Only our own files say nothing of an equation that is the physical one.
            own = key == MODEL and any(each.startswith("airlight:") for each in image.attributes)
            value = image.attributes.get(key, "physical" if own else None)
            if value is not None:
                said.append((path, value))
        if len({value for _, value in said}) == 2:
            notes.append("; ".join(f"{words} of {path}: {value}" for path, value in said))
    return notes


def _compared(
    named: Sequence[tuple[str, Image]],
    layer: str,
    mask: Bools | None,
    margin: float | None = None,
    *,
    all_metrics: bool = False,
) -> Comparison:
    """Compare a layer of two images, each with its name."""
    expected, tested = (_estimate(path, image, layer) for path, image in named)
    metrics = error_metrics(expected.mean, tested.mean, mask=mask)
    stated, statistics = _stated_errors(named, layer, mask), None
    # The verdict on a margin counts noise and stated errors together.
    if expected.standard_error is not None or tested.standard_error is not None:
        own = (
            0.0 if stated is None else math.inf if stated.bias_error is None else stated.bias_error
        )
        statistics = compare_statistics(expected, tested, mask=mask, margin=margin, stated=own)
        equivalent = statistics.equivalent
    elif stated is not None and margin is not None:
        bias = Estimate(metrics.relative_bias, stated.bias_error, stated.kind)
        equivalent = bias.within(margin) is Answer.YES
        stated = replace(stated, margin=margin, equivalent=equivalent)
    elif margin is None:
        equivalent = None
    else:
        raise InputError(
            f"a margin needs errors, and neither {named[0][0]} nor {named[1][0]} has a layer "
            f"'{layer}_se' or "
            f"'{layer}_error'; leave the margin out, or make the reference by airlight reference"
        )
    # Pixels that are wrong, and a bias that may be too large, are failures.
    images: tuple[ArrayLike, ArrayLike] = (expected.mean, tested.mean)
    ref, tst, chosen = compared(*images, mask)
    finite = (np.isfinite(ref) & np.isfinite(tst)).all(axis=2)
    failures = wrong_pixels(chosen & ~finite, "NaN or infinite")
    failures += wrong_pixels(chosen & (tst < 0).any(axis=2), "negative in the test image")
    if equivalent is False:
        failures += (f"the relative bias is not shown to be within +-{margin:.3g}",)
    return Comparison(
        layer,
        metrics,
        statistics,
        stated,
        failures=failures,
        masked=0 if mask is None else int((~np.asarray(mask)).sum()),
        errors=published_errors(*images, mask=mask) if all_metrics else None,
        errors_normalised=published_errors(*images, mask=mask, unit=None) if all_metrics else None,
        colour=colour_difference(*images, mask=mask) if all_metrics else None,
        flip=flip_hdr(*images, mask=mask)[0] if all_metrics else None,
    )


def common_layer(reference: tuple[str, Image], test: tuple[str, Image]) -> str:
    """Return the layer that both images have: the airlight, the plain channels, or the only one."""
    common = [name for name in reference[1].layers if name in test[1].layers]
    for usual in ("airlight", TOTAL):
        if usual in common:
            return usual
    if len(common) == 1:
        return common[0]
    have = "; ".join(f"{path} has {layer_names(image)}" for path, image in (reference, test))
    raise InputError(
        f"the files share {'no layer' if not common else 'several layers, name one by --layer'}: "
        f"{have}"
    )


def read_mask(path: str | os.PathLike[str]) -> Bools:
    """Return where the plain channels of an EXR file are not zero: truth
    values [1], (height, width).
    """
    values = np.asarray(image_layer(read_exr(path), TOTAL, path))
    if not np.isfinite(values).all():
        raise InputError(
            f"{path} as a mask has values that are not finite; expected 0 for out and 1 for in"
        )
    return (values != 0).any(axis=2)


def _estimate(path: str, image: Image, name: str) -> NoisyImage:
    """Take a layer with its standard error out of an image."""
    error = image.layers.get(f"{name}_se")
    batches = image.attributes.get(BATCHES) if error is not None else None
    if batches is not None and not isinstance(batches, int):
        raise InputError(
            f"{path} has the attribute {BATCHES} {batches!r}; expected an integer; correct it or "
            "remove it"
        )
    shared = image.attributes.get(SHARED, 0.0)
    if not isinstance(shared, int | float) or not 0 <= shared < math.inf:
        raise InputError(
            f"{path} has the attribute {SHARED} {shared!r}; expected a number from 0 on; correct it "
            "or remove it"
        )
    return NoisyImage(image_layer(image, name, path), error, batches, shared=float(shared))


def _stated_errors(
    named: Sequence[tuple[str, Image]], layer: str, mask: Bools | None
) -> StatedErrors | None:
    """Return the errors that two images, each with its name, state in the pixels that are compared.

    The true images are T +- t and R +- r in the mean: |T'/R' - T/R| is at most (t + r T/R) / (R -
    r). The rounding of a file to single precision, up to half an epsilon of each pixel, is a part
    of t and r.
    """
    errors = [_error_layer(path, image, layer) for path, image in named]
    if all(error is None for error in errors):
        return None
    layers = [np.asarray(image_layer(image, layer, path)) for path, image in named]
    *images, chosen = compared(layers[0], layers[1], mask)
    finite = chosen & np.isfinite(images).all(axis=(0, 3))
    sides = [
        None if error is None else _stated(values[finite], error[0][finite], error[1])
        for values, error in zip(layers, errors)
    ]
    # A file without a stated error is compared as it is; a stated error that is no number is
    # unknown.
    kinds = {side.kind for side in sides if side is not None}
    kind: Kind = "proven" if kinds == {"proven"} else "estimated"
    r, t = (
        0.0 if side is None else math.nan if side.error is None else side.error for side in sides
    )
    reference, test = (
        float(values[finite].mean()) if finite.any() else math.nan for values in images
    )
    bounded = math.isfinite(t) and r < reference
    change = (t + r * abs(test / reference)) / (reference - r) if bounded else None
    return StatedErrors(sides[0], sides[1], change, kind)


def _error_layer(path: str, image: Image, layer: str) -> tuple[Array, Kind] | None:
    """Return the error that is no noise of a layer, and its kind; None where an image states none."""
    if f"{layer}_error" in image.layers:
        return np.asarray(image.layers[f"{layer}_error"], dtype=np.float64), "estimated"
    if f"{layer}_bound" not in image.layers:
        return None
    kinds: dict[str, Kind] = {"proven": "proven", "estimated": "estimated"}
    said = image.attributes.get(BOUND, "estimated")
    if not isinstance(said, str) or said not in kinds:
        raise InputError(
            f"{path} has the attribute {BOUND} {said!r}; expected {' or '.join(kinds)}; correct it"
        )
    return np.asarray(image.layers[f"{layer}_bound"], dtype=np.float64), kinds[said]


def _stated(values: Array, error: Array, kind: Kind) -> Estimate:
    """Return the mean of the compared pixels of one image, and the mean of
    their errors by its file.
    """
    if not (values.size and np.isfinite(error).all() and (error >= 0).all()):
        return Estimate(float(values.mean()) if values.size else None, None, kind)
    rounding = float(np.finfo(np.result_type(values, np.float32)).eps) / 2
    mean, size = (float(each.mean(dtype=np.float64)) for each in (values, np.abs(values)))
    return Estimate(mean, float(error.mean()) + rounding * size, kind)


def _stated_lines(stated: StatedErrors) -> list[str]:
    sides = {"reference": stated.reference, "test image": stated.test}
    words = [
        f"mean of the {name} {each.words(unit=' W/(m^2 sr)')} ({each.kind})"
        for name, each in sides.items()
        if each is not None
    ]
    change = "unknown" if stated.bias_error is None else f"{percent(stated.bias_error)} at most"
    lines = [
        f"stated errors    {'; '.join(words)}",
        f"  together       of the relative bias {change} ({stated.kind})",
    ]
    if stated.margin is None:
        return lines
    return [
        *lines,
        f"margin           +-{percent(stated.margin)}: "
        f"{'inside' if stated.equivalent else 'NOT inside'}",
    ]


def statistics_lines(s: Statistics) -> list[str]:
    """Return the statistics as text."""
    low, high = s.relative_bias_ci
    lines = [
        f"relative bias    95 % interval {percent(low)} to {percent(high)}; "
        f"{percent(s.detectable_bias)} would have "
        "been found (90 % power, 5 % level)"
    ]
    if s.relative_bias_ci_batches is not None:
        low, high = s.relative_bias_ci_batches
        lines.append(f"  by batches     95 % interval {percent(low)} to {percent(high)}")
    if s.equivalent is not None and s.margin is not None:
        lines.append(
            f"margin           +-{percent(s.margin)}: {'inside' if s.equivalent else 'NOT inside'}"
        )
    return [
        *lines,
        f"variance         {percent(s.reference_variance_fraction)} of it the reference's; one "
        "pixel has up to "
        f"{percent(s.largest_fraction)}",
        f"zero reference   {s.zero_reference} values, the test image there up to "
        f"{shown(s.zero_reference_error, 3)} of the mean",
        f"z                mean {_fixed(s.z_mean)}, standard deviation {_fixed(s.z_std)}, "
        f"{s.tested} values; "
        f"{s.zero_variance} without variance differ by up to {shown(s.zero_variance_error, 3)} of "
        "the mean",
        f"rejected         {s.rejected} pixels, {s.expected_rejections:.2g} expected (Sidak level "
        f"{LEVEL:g}); "
        f"{s.rejected_blocks} of {s.blocks} blocks",
        f"exceeding        {s.exceeding} values, {s.expected_exceeding:.0f} expected (level "
        f"{LEVEL:g}), "
        f"p = {shown(s.exceeding_p, 3)}; p-values uniform: p = {shown(s.uniformity_p, 3)}",
    ]


def order_line(layer: str, m: Metrics, s: Statistics | None) -> str:
    """Return the comparison of light of some orders of scattering as a line of text."""
    interval = ""
    if s is not None:
        low, high = s.relative_bias_ci_batches or s.relative_bias_ci
        interval = f" (95 % interval {percent(low)} to {percent(high)})"
    return f"{layer:<17}relative bias {percent(m.relative_bias)}{interval}, relative rmse {percent(m.relative_rmse)}"


def record_lines(name: str, record: "DataclassInstance") -> list[str]:
    """Return the known values of a record as text, by their headings and with their units."""
    values = shown_values(record)
    words = []
    for each in columns_of(record.__class__):
        value = values[each.key]
        if value is not None and value != "":
            number = shown(value) if isinstance(value, float) else str(value)
            words.append(
                f"{each.heading} {number}"
                + ("" if each.unit in ("", "1", each.heading) else f" {each.unit}")
            )
    return textwrap.wrap(
        "; ".join(words), 117, initial_indent=f"{name:<17}", subsequent_indent=" " * 17
    )


def percent(value: float | None) -> str:
    """Return a fraction, `value` [1], as text in percent: '0.12 %' for 0.0012."""
    return shown(value) if value is None or not math.isfinite(value) else f"{shown(100 * value)} %"


def shown(value: float | None, digits: int = 4) -> str:
    """Return a number, or a word for what is none."""
    if value is None or math.isnan(value):
        return "undefined"
    return "unlimited" if math.isinf(value) else f"{value:.{digits}g}"


def _fixed(value: float | None) -> str:
    return shown(value) if value is None else f"{value:.3f}"
