# SPDX-License-Identifier: BSD-3-Clause
r"""One regression: ridge regression, with its residuals on scenes that it has not seen.

With the features X, standardised, and the values y less their mean, the coefficients are

    b = (X^T X + lambda I)^(-1) X^T y,    H = X (X^T X + lambda I)^(-1) X^T + 1/n.

The residual of a scene that is left out of the fit needs no second fit: r_i / (1 - H_ii) (Allen 1974; exact but for the
means, which keep the scene). The penalty lambda is the one of `_PENALTIES` whose left-out residuals have the least sum
of squares. The allowance of a prediction is the ceil((n + 1) q)-th of the n left-out residuals, in order (conformal
prediction, Vovk, Gammerman, Shafer 2005): another scene of the same kind is above it with a chance of at most 1 - q.
Where n is too small for a share q, the largest residual stands for it, and `covered` says which share it covers.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_PENALTIES = tuple(float(value) for value in 10.0 ** np.arange(-1, 4.5, 0.5))
_BEYOND = 0.5  # standard deviations beyond the range of the fitted scenes, to which features are held


@dataclass(frozen=True)
class Regression:
    """A linear regression of the logarithm of something."""

    mean: Array  #: of the features
    spread: Array  #: of the features; 1 where all scenes have the same
    low: Array  #: least of the fitted scenes, standardised
    high: Array  #: largest
    coefficients: Array  #: of the standardised features
    constant: float
    residuals: Array  #: of the left-out scenes, ascending
    penalty: float

    def predict(self, features: Array) -> float:
        """Return the logarithm; features beyond those of the fitted scenes are held near their range."""
        standard = (features - self.mean) / self.spread
        held = np.clip(standard, self.low - _BEYOND, self.high + _BEYOND)
        return float(self.constant + held @ self.coefficients)

    def beyond(self, features: Array) -> NDArray[np.bool_]:
        """Return which features are held because they lie beyond those of the fitted scenes."""
        standard = (features - self.mean) / self.spread
        return np.asarray((standard < self.low - _BEYOND) | (standard > self.high + _BEYOND))

    def allowance(self, share: float) -> float:
        """Return what is added to a prediction so that at least that share of scenes lies below."""
        count = len(self.residuals)
        return float(self.residuals[min(math.ceil((count + 1) * share), count) - 1])

    def covered(self, share: float) -> float:
        """Return which share the allowance covers."""
        count = len(self.residuals)
        return min(math.ceil((count + 1) * share), count) / (count + 1)

    def chance(self, room: float) -> float:
        """Return in what share of scenes the value is at most `room` above the prediction, as residuals say."""
        return float(np.searchsorted(self.residuals, room, side="right")) / (len(self.residuals) + 1)

    def as_data(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {
            name: [float(f"{each:.6g}") for each in value] if isinstance(value, np.ndarray) else value
            for name, value in vars(self).items()
        }

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> "Regression":
        """Return a regression of what `as_data` returned."""
        values: dict[str, Any] = {
            name: np.array(value) if isinstance(value, list) else float(value) for name, value in data.items()
        }
        return cls(**values)


def fit_regression(features: Array, logarithm: Array) -> Regression:
    """Return the regression of values over features.

    Parameters
    ----------
    features
        (scenes, n).
    logarithm
        What to predict, (scenes,).
    """
    mean, spread = features.mean(axis=0), features.std(axis=0)
    spread = np.where(spread > 1e-9, spread, 1.0)
    standard = (features - mean) / spread
    constant = float(logarithm.mean())
    left, values, right = np.linalg.svd(standard, full_matrices=False)
    projected = left.T @ (logarithm - constant)
    best: tuple[float, float, Array] | None = None
    for penalty in _PENALTIES:
        kept = values**2 / (values**2 + penalty)
        leverage = np.sum(left**2 * kept, axis=1) + 1 / len(logarithm)
        residuals = (logarithm - constant - left @ (kept * projected)) / np.maximum(1 - leverage, 1e-3)
        score = float(residuals @ residuals)
        if best is None or score < best[0]:
            best = score, penalty, residuals
    assert best is not None
    _, penalty, residuals = best
    coefficients = right.T @ (values / (values**2 + penalty) * projected)
    return Regression(
        mean, spread, standard.min(axis=0), standard.max(axis=0), coefficients, constant, np.sort(residuals), penalty
    )
