# SPDX-License-Identifier: BSD-3-Clause
r"""One regression: ridge regression, with how far off it is in scenes that it has not seen.

With the features X, standardised, and the values y less their mean, the coefficients are

    b = (X^T X + lambda I)^(-1) X^T y,    H = X (X^T X + lambda I)^(-1) X^T + 1/n.

The residual of a scene that is left out of the fit needs no second fit: r_i / (1 - H_ii) (Allen 1974; exact but for the
means, which keep the scene). The penalty lambda is the one of `_PENALTIES` whose left-out residuals have the least sum
of squares.

Some scenes are harder to predict than others: a second regression, of the logarithm of |residual| + `_SMALL`, gives the
scale s of a scene's residual. Scores, left-out residuals over left-out scales, are alike in all scenes. So the value in
another scene of the same kind is above its prediction plus s times the ceil((n + 1) q)-th of the n scores, in order,
with a chance of at most 1 - q (conformal prediction, Vovk, Gammerman, Shafer 2005; with a scale, Lei et al. 2018, sec.
5.2). Where n is too small for a share q, the largest score stands for it, and `covered` says which share it covers.
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
_SMALL = 0.1  # decades: residuals that are smaller count as alike


@dataclass(frozen=True)
class Prediction:
    """What a regression says of one scene."""

    value: float  #: the logarithm
    scale: float  #: of how far off it is
    scores: Array  #: of the fitted scenes, ascending

    def below(self, share: float) -> float:
        """Return what the logarithm is below in at least that share of such scenes."""
        return self.value + self.scale * float(self.scores[_rank(len(self.scores), share) - 1])

    def covered(self, share: float) -> float:
        """Return which share `below` covers: the one asked for, or less where there are few scenes."""
        return min(share, _rank(len(self.scores), share) / (len(self.scores) + 1))

    def chance(self, logarithm: float) -> float:
        """Return in what share of such scenes the logarithm is at most this."""
        room = (logarithm - self.value) / self.scale
        return float(np.searchsorted(self.scores, room, side="right")) / (len(self.scores) + 1)


@dataclass(frozen=True)
class Regression:
    """A linear regression of the logarithm of something, and of the scale of its residuals."""

    mean: Array  #: of the features
    spread: Array  #: of the features; 1 where all scenes have the same
    low: Array  #: least of the fitted scenes, standardised
    high: Array  #: largest
    coefficients: Array  #: of the standardised features
    constant: float
    penalty: float
    scale_coefficients: Array  #: of the decimal logarithm of the scale
    scale_constant: float
    scores: Array  #: of the left-out scenes, ascending

    def predict(self, features: Array) -> Prediction:
        """Return what it says of a scene; features beyond those of the fitted scenes are held near their range."""
        held = np.clip(self._standard(features), self.low - _BEYOND, self.high + _BEYOND)
        scale = 10 ** float(self.scale_constant + held @ self.scale_coefficients)
        return Prediction(float(self.constant + held @ self.coefficients), scale, self.scores)

    def beyond(self, features: Array) -> NDArray[np.bool_]:
        """Return which features are held because they lie beyond those of the fitted scenes."""
        standard = self._standard(features)
        return np.asarray((standard < self.low - _BEYOND) | (standard > self.high + _BEYOND))

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

    def _standard(self, features: Array) -> Array:
        return (features - self.mean) / self.spread


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
    value = _ridge(standard, logarithm)
    sizes = np.log10(np.abs(value.residuals) + _SMALL)
    scale = _ridge(standard, sizes)
    return Regression(
        mean,
        spread,
        standard.min(axis=0),
        standard.max(axis=0),
        value.coefficients,
        value.constant,
        value.penalty,
        scale.coefficients,
        scale.constant,
        np.sort(value.residuals / 10 ** (sizes - scale.residuals)),
    )


@dataclass(frozen=True)
class _Ridge:
    coefficients: Array
    constant: float
    penalty: float
    residuals: Array  #: of the left-out scenes, in their order


def _ridge(standard: Array, values: Array) -> _Ridge:
    """Return the ridge regression whose left-out residuals are the least."""
    constant = float(values.mean())
    left, singular, right = np.linalg.svd(standard, full_matrices=False)
    projected = left.T @ (values - constant)
    best: tuple[float, float, Array] | None = None
    for penalty in _PENALTIES:
        kept = singular**2 / (singular**2 + penalty)
        leverage = np.sum(left**2 * kept, axis=1) + 1 / len(values)
        residuals = (values - constant - left @ (kept * projected)) / np.maximum(1 - leverage, 1e-3)
        score = float(residuals @ residuals)
        if best is None or score < best[0]:
            best = score, penalty, residuals
    assert best is not None
    _, penalty, residuals = best
    return _Ridge(right.T @ (singular / (singular**2 + penalty) * projected), constant, penalty, residuals)


def _rank(count: int, share: float) -> int:
    return min(math.ceil((count + 1) * share), count)
