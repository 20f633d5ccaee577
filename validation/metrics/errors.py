# SPDX-License-Identifier: BSD-3-Clause
r"""Error of one image against another.

With r the reference, t the test, d = t - r, n values (pixels times channels) and m = mean(r):

    bias          = mean(d)                     relative_bias = bias / m
    rmse          = sqrt(mean(d^2))             relative_rmse = rmse / m
    e             = |d| / max(r, 0.001 m)       p50, p99, max = its quantiles and its largest value

Channels count as values of their own: nothing is summed or weighted over them. The floor under r
scales with the image, so that every relative number is free of units, and dim airlight counts as
much as bright.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from airlight.errors import InputError
from airlight.validation.arrays import Array, Bools
from airlight.validation.columns import column

#: the least denominator of a relative error, as a fraction of the mean of the reference
FLOOR = 1e-3
RADIANCE = "W/(m^2 sr)"
_RELATIVE = "|error| over the reference, or over a thousandth of its mean where that is more"


@dataclass(frozen=True)
class Metrics:
    """Error of a test image against a reference.

    Anyone who sees `nonfinite` above zero must call the comparison failed.
    """

    pixels: int = column(
        "pixels", "pixels", "compared, those of the mask, with or without finite values"
    )
    bias: float | None = column("bias", RADIANCE, "mean error")
    relative_bias: float | None = column(
        "rel. bias", "1", "mean error over the reference's mean: below 0 is too dark"
    )
    rmse: float | None = column("RMSE", RADIANCE, "root of the mean square error")
    relative_rmse: float | None = column(
        "rel. RMSE", "1", "root of the mean square error over the reference's mean"
    )
    p50: float | None = column("median error", "1", f"half of the values err by less: {_RELATIVE}")
    p99: float | None = column("p99", "1", f"99 of 100 values err by less: {_RELATIVE}")
    max: float | None = column("max", "1", f"all values err by at most: {_RELATIVE}")
    nonfinite: int = column(
        "not finite", "pixels", "with a value that is not finite; averages leave them out"
    )
    negative: int = column(
        "negative", "pixels", "with a negative value in the test image; they stay in the averages"
    )


@dataclass(frozen=True)
class RunsError:
    """Bias and error of a method that draws random numbers, from independent runs, relative
    to the reference's mean.
    """

    runs: int = column("runs", "1", "independent renders of the frame, each image once")
    bias: float = column("bias", "1", "mean over the runs")
    bias_within: float = column(
        "bias within",
        "1",
        "half of the 95 % interval of the bias, wider by the reference's own error",
    )
    rmse: float = column("rel. RMSE", "1", "of one run, mean over the runs")
    rmse_within: float = column("RMSE within", "1", "half of the 95 % interval of that mean")
    root_bias: float | None = column(
        "bias by pixel",
        "1",
        "root of the squared bias, where its 95 % interval is above the square of the reference's "
        "own error",
    )
    most_bias: float | None = column(
        "at most",
        "1",
        "root of the upper end of that interval, and the reference's own error; null where fewer "
        "than three runs do not tell it",
    )


def error_metrics(
    reference: ArrayLike, test: ArrayLike, *, mask: ArrayLike | None = None
) -> Metrics:
    """Compare a test image with a reference (formulae: see the module).

    Parameters
    ----------
    reference
        Radiance, (height, width) or (height, width, channels) [W/(m^2 sr)].
    test
        The image to judge, of the same shape [W/(m^2 sr)].
    mask
        Pixels to compare, (height, width) of truth values; all by default.

    Returns
    -------
    Metrics
        In float64. If no pixel is finite in both images, every error is None; if the reference is
        black, the relative ones are. Quantiles are linear between order statistics.

    Raises
    ------
    InputError
        If the sizes differ, an image is empty, or the mask does not fit or leaves nothing.
    """
    ref, tst, chosen = compared(reference, test, mask)
    finite = chosen & (np.isfinite(ref) & np.isfinite(tst)).all(axis=2)
    errors: dict[str, float | None] = dict.fromkeys(
        ("bias", "relative_bias", "rmse", "relative_rmse", "p50", "p99", "max")
    )
    if finite.any():
        r, d = ref[finite], tst[finite] - ref[finite]
        mean, bias, largest = float(r.mean()), float(d.mean()), float(np.abs(d).max())
        # Scaled before squaring: the square of a very dim or bright error is out of range.
        rmse = largest * float(np.sqrt(np.mean((d / largest) ** 2))) if largest > 0 else 0.0
        errors |= {"bias": bias, "rmse": rmse}
        if mean > 0:
            relative = np.abs(d) / np.maximum(r, FLOOR * mean)
            p50, p99 = (float(q) for q in np.quantile(relative, [0.5, 0.99]))
            errors |= {"relative_bias": bias / mean, "relative_rmse": rmse / mean}
            errors |= {"p50": p50, "p99": p99, "max": float(relative.max())}
    return Metrics(
        pixels=int(chosen.sum()),
        nonfinite=int(chosen.sum() - finite.sum()),
        negative=int((chosen & (tst < 0).any(axis=2)).sum()),
        **errors,
    )


def known(value: float | None) -> float:
    """Return a number that must be known, such as the error against a
    reference that is not black.
    """
    if value is None:
        raise InputError(
            "an error is not known: no pixel is finite in both images, or the reference is black"
        )
    return value


def compared(
    reference: ArrayLike, test: ArrayLike, mask: ArrayLike | None
) -> tuple[Array, Array, Bools]:
    """Return two images as float64, (height, width, channels), and the pixels to
    compare, (height, width).

    Images of different sizes, empty ones, and a mask that does not fit or
    leaves nothing are refused.
    """
    ref, tst = np.asarray(reference, dtype=np.float64), np.asarray(test, dtype=np.float64)
    if ref.shape != tst.shape:
        raise InputError(
            f"images of two sizes: the reference is {_size(ref)}, the test {_size(tst)}; render "
            "both at one size"
        )
    if ref.ndim not in (2, 3) or ref.size == 0:
        raise InputError(
            f"images of shape {ref.shape}; expected (height, width) or (height, width, channels), "
            "not empty"
        )
    chosen = np.ones(ref.shape[:2], dtype=bool) if mask is None else np.asarray(mask)
    if chosen.dtype != np.bool_ or chosen.shape != ref.shape[:2]:
        raise InputError(
            f"a mask of {chosen.dtype} {chosen.shape}; expected truth values (bool) {ref.shape[:2]}"
        )
    if not chosen.any():
        raise InputError("the mask leaves no pixel to compare; choose at least one")
    return ref.reshape(*ref.shape[:2], -1), tst.reshape(*tst.shape[:2], -1), chosen


def wrong_pixels(wrong: Bools, what: str) -> tuple[str, ...]:
    """Return how many pixels, (height, width), are wrong and where the first is, in
    words; nothing where none is.
    """
    if not wrong.any():
        return ()
    row, column = (int(place) for place in np.argwhere(wrong)[0])
    many = int(wrong.sum())
    if many == 1:
        return (f"1 pixel is {what}, in column {column}, row {row}",)
    return (f"{many} pixels are {what}, the first in column {column}, row {row}",)


def colours(image: Array) -> Array:
    """Return an image, (height, width, channels), with three channels; one becomes grey,
    other numbers are refused.
    """
    if image.shape[2] not in (1, 3):
        raise InputError(
            f"an image of {image.shape[2]} channels has no colour; expected one (grey) or three "
            "(linear RGB)"
        )
    return np.repeat(image, 3, axis=2) if image.shape[2] == 1 else image


def _size(image: Array) -> str:
    """Say the size of an image as width x height."""
    if image.ndim not in (2, 3):
        return f"an array of shape {image.shape}"
    channels = f" with {image.shape[2]} channels" if image.ndim == 3 else ""
    return f"{image.shape[1]} x {image.shape[0]} pixels{channels}"
