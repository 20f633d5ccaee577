# SPDX-License-Identifier: BSD-3-Clause
"""How far single values of an image may be off, from what a fit leaves of it.

Noise of renderers has a part that is the same everywhere and one that grows with the radiance f, so

    sigma^2 = a^2 + b^2 f^2,    a, b >= 0,

is fitted to the scatter of the residuals in groups of like radiance. The scatter of a group is 1.4826 times the median
of |residual|, the standard deviation of a normal distribution, which pixels that are wrong by any amount do not move as
long as they are less than half. Values that are off by more than six sigma are outliers: of a million normal ones none
is. They are left out, and so is all of their pixel. Least squares with weights 1/sigma^2 that depend on the model, not
on the values, stays unbiased even if the noise is skewed.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

OUTLIER = 6.0  #: standard deviations beyond which a value is left out
_GROUPS = 24
_ROUNDING = 2e-7  # of the radiance: values are float32


def noise_of(radiance: Array, residual: Array) -> Array:
    """Return the standard deviation of each value.

    Parameters
    ----------
    radiance, residual
        Of the model, and image minus model, (n,) each [W/(m^2 sr)].
    """
    usual = float(np.mean(np.abs(radiance + residual)))  # of the image
    least = _ROUNDING * (np.abs(radiance) + 1e-3 * usual) + 1e-140
    order = np.argsort(radiance)
    groups = [group for group in np.array_split(order, min(_GROUPS, max(1, len(order) // 8))) if len(group)]
    scatter = np.array([1.4826 * np.median(np.abs(residual[group])) for group in groups])
    scatter = np.maximum(scatter, [np.median(least[group]) for group in groups])
    squares = np.array([np.median(radiance[group] ** 2) for group in groups])
    scale = max(float(squares.max()), 1e-280)
    rows = np.stack([np.ones_like(squares), squares / scale], axis=1) / scatter[:, None] ** 2
    (constant, relative), _ = nnls(rows, np.ones(len(rows)))
    return np.sqrt(constant + relative * radiance**2 / scale + least**2)


def outliers(residual: Array, sigma: Array) -> Bools:
    """Return which pixels have a value that is off by more than `OUTLIER` sigma; both (pixels, 3) -> (pixels,)."""
    return np.asarray(np.any(np.abs(residual) > OUTLIER * sigma, axis=1))
