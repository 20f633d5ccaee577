# SPDX-License-Identifier: BSD-3-Clause
"""One answer that is known, and how an estimator is held against it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference.monte_carlo.single_scatter.integrator import single_scatter_batch
from reference.monte_carlo.volpath.integrator import volpath_batch
from reference.quadrature.image import quadrature_image
from reference.scene.read import TruthScene

Array = NDArray[np.float64]

ESTIMATORS = ("quadrature", "single-scatter", "volpath")
EXACT = (1e-10, "tolerance of the integrals")
FLOAT32 = (2e-5, "float32 arithmetic, the same random numbers on both sides")
_SAMPLES = 32


@dataclass(frozen=True)
class KnownAnswer:
    """How far an estimator is from an answer that is known."""

    name: str  #: what is known
    estimator: str  #: 'quadrature', 'single-scatter' or 'volpath'
    measured: float  #: largest difference, relative to the largest pixel unless the reason says otherwise
    bound: float  #: the most that it may be [1]
    reason: str  #: why the bound is what it is

    @property
    def passed(self) -> bool:
        """Whether the difference is within the bound."""
        return self.measured <= self.bound


def layers(truth: TruthScene, estimator: str) -> Array:
    """Return airlight and surface by an estimator, (2, pixels, 3) [W/(m^2 sr)]."""
    if estimator == "quadrature":
        image = quadrature_image(truth)
        return np.stack([image.airlight, image.surface]).reshape(2, -1, 3)
    batch = single_scatter_batch if estimator == "single-scatter" else volpath_batch
    return batch(truth, 1, _SAMPLES).mean


def largest_difference(computed: Array, expected: Array) -> float:
    """Return the largest difference of two images of one shape over the largest value of the second [1]."""
    return float(np.abs(computed - expected).max() / np.abs(expected).max())
