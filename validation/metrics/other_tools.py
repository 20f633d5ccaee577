# SPDX-License-Identifier: BSD-3-Clause
r"""The error metrics that other tools print, each by its own formula, and one
that has no floor in it.

Definitions of the same name disagree between tools, so every name here says whose formula it is.
With r the reference, t the test, d = t - r, and means over all values (pixels times channels):

    mse, rmse      mean d^2, its root                            all
    mae            mean of the absolute d                        all
    rae_tev        mean of abs(d) / (r + 0.01)                   tev, "relative absolute error"
    rse_tev        mean of d^2 / (r^2 + 0.01)                    tev, "relative squared error"
    mrse_pbrt      mean of d^2 / (r + 0.01)^2                    pbrt-v4, imgtool error --metric MRSE
    relmse         mean of d^2 / (r^2 + 0.01)                    SimpleImageIO, relative_mse; the same number as tev's
    relmse_trim    that without the largest 0.1 % of values      SimpleImageIO, relative_mse_outlier_rejection
    mape           mean of abs(d) / (abs(r) + 0.01)              JERI
    smape          mean of 2 abs(d) / (abs(r) + abs(t) + 0.02)   JERI; at most 2
    mrse_jeri      mean of d^2 / (r^2 + 0.0001)                  JERI
    psnr           10 log10(max(r)^2 / mse) [dB]                 the usual one with the peak of the reference
    relative       mean of abs(d) / r where r >= f               ours
    relative_max   max of abs(d) / r where r >= f                ours
    dark_max       max of abs(d) where r < f, over mean(r)       ours

**The epsilons have a unit.** 0.01 is a radiance: airlight of 0.001 W/(m^2 sr) drowns in it, and a
scene in other units has another error. The images may therefore be divided by a `unit` first. With
1 the numbers are as the tools print them; with the mean of the reference they do not depend on the
unit, and 0.01 is one percent of the mean.

**Ours** divides by the reference itself. Where it is below f = 0.001 mean(r), black pixels among
them, a ratio says nothing: these values are left out of the mean and counted (`dark`), and their
largest error is given in absolute terms, so that they are not forgotten.

**PSNR** has no meaning of its own for radiance without an upper bound; with the reference's peak it
is -10 log10 of a relative mean square error, and one bright pixel rules it. It is here because
papers print it.

Sources read: tev src/ImageCanvas.cpp, pbrt-v4 src/pbrt/util/image.cpp, SimpleImageIO
Core/error_metrics.cpp, JERI src/shaders/frag.glsl. They work in float32 and differ in what they do
with infinities (pbrt takes them as zero); here everything is float64, and pixels that are not
finite are left out and counted.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from airlight.errors import InputError
from airlight.validation.arrays import Array
from airlight.validation.columns import column, record_of
from airlight.validation.metrics.errors import FLOOR, RADIANCE, compared

EPSILON = 0.01  #: added to denominators by tev, pbrt, SimpleImageIO and JERI [units of radiance]
EPSILON_JERI_SQUARED = 1e-4  #: JERI's under squares, 0.01 squared
TRIMMED = 0.001  #: fraction of the largest values that `relmse_trim` leaves out


@dataclass(frozen=True)
class PublishedErrors:
    """Error of a test image against a reference as other tools print it
    (formulae: see the module).
    """

    unit: float = column(
        "unit", RADIANCE, "radiance that counts as 1: both images were divided by it"
    )
    values: int = column("values", "1", "compared")
    nonfinite: int = column(
        "not finite", "pixels", "left out because either image is NaN or infinite there"
    )
    dark: int = column("dark values", "1", "whose reference is below 0.001 of its mean")
    mse: float | None = column("MSE", "unit^2", "mean square error")
    rmse: float | None = column("RMSE", "unit", "root of the mean square error")
    mae: float | None = column("MAE", "unit", "mean absolute error")
    rae_tev: float | None = column("RAE (tev)", "1", "tev's relative absolute error")
    rse_tev: float | None = column("RSE (tev)", "1", "tev's relative squared error")
    mrse_pbrt: float | None = column("MRSE (pbrt)", "1", "pbrt's MRSE")
    relmse: float | None = column("relMSE", "1", "SimpleImageIO's relative MSE")
    relmse_trim: float | None = column(
        "relMSE, trimmed", "1", "that without the largest 0.1 % of the values"
    )
    mape: float | None = column("MAPE", "1", "JERI's MAPE")
    smape: float | None = column("SMAPE", "1", "JERI's SMAPE")
    mrse_jeri: float | None = column("MRSE (JERI)", "1", "JERI's MRSE")
    psnr: float | None = column(
        "PSNR", "dB", "peak signal to noise, with the reference's peak; none for equal images"
    )
    relative: float | None = column(
        "relative", "1", "mean of |error| over the reference where that is not dark"
    )
    relative_max: float | None = column("relative, largest", "1", "largest of the same")
    dark_max: float | None = column(
        "in the dark", "1", "largest |error| of dark values, over the reference's mean"
    )


def published_errors(
    reference: ArrayLike,
    test: ArrayLike,
    *,
    mask: ArrayLike | None = None,
    unit: float | None = 1.0,
) -> PublishedErrors:
    """Compare a test image with a reference by the formulae of other tools.

    Images and mask are those of `validation.metrics.errors.error_metrics`. The `unit` is the
    radiance that counts as 1; None for the mean of the reference over the pixels compared, or 1 if
    that is not above zero.

    If no pixel is finite in both images, no error is known. Negative values stay in; an error whose
    denominator they make zero is not known. Nor are, if the reference is black, `relative`,
    `dark_max` and `psnr`.
    """
    if unit is not None and not 0 < unit < np.inf:
        raise InputError(
            f"unit: got {unit}, expected a radiance above 0, or none for the mean of the reference"
        )
    ref, tst, chosen = compared(reference, test, mask)
    finite = chosen & (np.isfinite(ref) & np.isfinite(tst)).all(axis=2)
    r, t = ref[finite].ravel(), tst[finite].ravel()
    if unit is None:
        mean = float(r.mean()) if r.size else 0.0
        unit = mean if mean > 0 else 1.0
    counts = {"values": r.size, "nonfinite": int(chosen.sum() - finite.sum())}
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return record_of(
            {"unit": unit} | counts | _errors(r / unit, t / unit) | _without_floor(r, t),
            PublishedErrors,
        )


def _errors(r: Array, t: Array) -> dict[str, float]:
    """Return the metrics of the table except for ours."""
    size = np.abs(t - r)
    square = size**2
    mse = _mean(square)
    relative_square = square / (r**2 + EPSILON)
    # SimpleImageIO cuts the number of outliers down to an integer: none of
    # fewer than a thousand values.
    trimmed = np.sort(relative_square)[: r.size - int(r.size * TRIMMED)]
    peak = float(r.max()) if r.size else float("nan")
    return {
        "mse": mse,
        "rmse": float(np.sqrt(mse)),
        "mae": _mean(size),
        "rae_tev": _mean(size / (r + EPSILON)),
        "rse_tev": _mean(relative_square),
        "mrse_pbrt": _mean(square / (r + EPSILON) ** 2),
        "relmse": _mean(relative_square),
        "relmse_trim": _mean(trimmed),
        "mape": _mean(size / (np.abs(r) + EPSILON)),
        "smape": _mean(2 * size / (np.abs(r) + np.abs(t) + 2 * EPSILON)),
        "mrse_jeri": _mean(square / (r**2 + EPSILON_JERI_SQUARED)),
        "psnr": float(10 * np.log10(np.float64(peak) ** 2 / mse)) if peak > 0 else float("nan"),
    }


def _without_floor(r: Array, t: Array) -> dict[str, float]:
    """Return ours: relative where the reference is bright enough for that, absolute elsewhere."""
    nan = float("nan")
    mean = _mean(r)
    if not mean > 0:
        return {"dark": r.size, "relative": nan, "relative_max": nan, "dark_max": nan}
    bright = r >= FLOOR * mean
    size = np.abs(t - r)
    relative = size[bright] / r[bright]
    dark = size[~bright]
    return {
        "dark": dark.size,
        "relative": _mean(relative),
        # the largest value is never below a thousandth of the mean
        "relative_max": float(relative.max()),
        "dark_max": float(dark.max(initial=0.0)) / mean,
    }


def _mean(values: Array) -> float:
    return float(values.mean()) if values.size else float("nan")
