# SPDX-License-Identifier: BSD-3-Clause
"""How fast kernels converge: the order or the rate that a family declares, and the measured one.

A kernel of size N whose error falls like N^-k has the *order* k, one whose error falls like q^N the *rate* q < 1. Both
follow from where the integrand is singular:

* Midpoint steps have order 2; so has linear interpolation in a table, in the entries along a side.
* Gauss's rule with n nodes on [m - H, m + H] has the rate rho^-2 a node, where rho = |z + sqrt(z^2 - 1)| (the root for
  which rho > 1) and z = (s - m)/H for the singularity s with the least rho (Trefethen 2013, *Approximation Theory and
  Approximation Practice*, theorem 19.3). In w = asinh(q/h) an isotropic vacuum has 1/cosh w, singular at +-i pi/2; in
  terms of theta, q/h = tan(theta/2 + pi/4). In the angle theta it is Henyey-Greenstein's 1 + g^2 + 2 g sin theta = 0,
  at s = -pi/2 +- i log(1/g) for g > 0; its power -3/2 there adds a factor N^(1/2) to the error.
* A Taylor series about theta = 0 has the rate |theta1|/|s| a degree, s the singularity closest to 0. The coefficients
  of (1 - theta/s)^(-3/2) grow like n^(1/2), which the integral divides by n: the error falls like N^(-1/2) q^N.

Complex singularities make the error swing below its envelope as N grows, at other N for other rays: fitted is the
largest error of rays that share the rate, at each size or any later one. Errors are of float64; those of rounding are
left out.
"""

import cmath
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from analytic.cases import Cases
from analytic.errors import InputError
from validation.configurations.kernel_names import find_kernel, sized
from validation.kernels.errors import relative_error
from validation.kernels.rays import table, with_truth
from validation.kernels.values import evaluate_cases

Array = NDArray[np.float64]

_FLOOR = 3e-12  # of the error: below it the truth and rounding count
_CEILING = 0.3  # above it nothing has converged yet


@dataclass(frozen=True)
class Declared:
    """What a family of kernels promises, and the rays and sizes that show it."""

    kind: str  #: 'order' or 'rate'
    value: float  #: k or q
    sizes: tuple[int, ...]
    cases: Cases
    power: float = 0.0  #: kind 'rate': the error falls like N^power q^N


@dataclass(frozen=True)
class Convergence:
    """Errors of a kernel at several sizes and what they say."""

    kernel: str
    sizes: tuple[int, ...]
    errors: tuple[float, ...]  #: largest relative error at each size
    order: float | None  #: k of the best fit of N^-k, None for fewer than two sizes that count
    rate: float | None  #: q of the best fit of N^power q^N
    declared: Declared | None = None

    @property
    def measured(self) -> float | None:
        """The measured value of what is declared."""
        if self.declared is None:
            return None
        return self.order if self.declared.kind == "order" else self.rate


def convergence(kernel: str, sizes: Sequence[int] | None = None, *, cases: Cases | None = None) -> Convergence:
    """Measure the order and the rate of a family of kernels over its parameter.

    Parameters
    ----------
    kernel
        A name of the registry.
    sizes
        Values of its parameter, those of its declaration by default.
    cases
        Rays with known J; those of its declaration by default.

    Raises
    ------
    InputError
        For a kernel that declares nothing, if sizes or cases are missing.
    """
    promise = declared().get(kernel)
    if promise is not None:
        own = cases is None
        sizes, cases = sizes or promise.sizes, cases or promise.cases
    elif sizes is None or cases is None:
        raise InputError(f"kernel: {kernel!r} declares no order or rate; give sizes and cases")
    else:
        own = False
    errors = tuple(_largest(sized(kernel, size), cases) for size in sizes)
    order, rate = _slopes(
        np.array(sizes, dtype=np.float64), np.array(errors), promise.power if own and promise else 0.0
    )
    return Convergence(kernel, tuple(sizes), errors, order, rate, promise if own else None)


def declared() -> dict[str, Declared]:
    """Return what the families of kernels promise, by name."""
    steps, sizes = (32, 64, 128, 256), (32, 64, 128, 256, 512)
    g = np.linspace(0.45, 0.75, 7)
    singular = -0.5 * math.pi + 1j * np.log(1 / g)
    ends = [_end_of_rate(s, 0.1) for s in singular]
    flanks = [(_end_of_rate(0.5j * math.pi, 0.24, begin), begin) for begin in np.linspace(0.05, 0.6, 7)]
    panels = np.array([[_theta(begin), _theta(end)] for end, begin in flanks]).T
    return {
        "quadrature": Declared("rate", 0.24, tuple(range(4, 23, 2)), _angles(*panels)),
        "quadrature-theta": Declared(
            "rate", 0.1, tuple(range(2, 11)), _angles(ends, 0 * g, phase="hg", g=g), power=0.5
        ),
        "taylor": Declared(
            "rate", 0.7, tuple(range(4, 33, 2)), _angles(-0.7 * abs(singular), 0 * g, phase="hg", g=g), power=-0.5
        ),
        "uniform": Declared("order", 2.0, steps, _angles([-0.9], [0.7], sigma_t=0.4)),
        "equiangular": Declared("order", 2.0, steps, _angles([-0.9], [0.7], sigma_t=0.4)),
        "table": Declared("order", 2.0, sizes, _many_angles()),
        "table-tail": Declared("order", 2.0, sizes, _many_angles()),
    }


def gauss_rate(singular: complex, low: float, high: float) -> float:
    """Return by what factor a further node of Gauss's rule on [low, high] reduces the error.

    Parameters
    ----------
    singular
        The singularity of the integrand with the smallest rho.
    low, high
        The range of integration.
    """
    z = (2 * singular - (low + high)) / (high - low)
    root = cmath.sqrt(z * z - 1)
    return max(abs(z + root), abs(z - root)) ** -2


def _end_of_rate(singular: complex, rate: float, begin: float = 0.0) -> float:
    """Return the end of a range from `begin` on that has this rate: below 0 for a singularity there, else above."""
    side = -1.0 if singular.real < 0 else 1.0
    return brentq(lambda end: gauss_rate(singular, begin, end) - rate, begin + 0.01 * side, begin + 30 * side)


def _theta(w: float) -> float:
    """Return the angle at w = asinh(q/h)."""
    return 2 * math.atan(math.sinh(w)) - 0.5 * math.pi


def _angles(
    theta0: ArrayLike, theta1: ArrayLike, *, phase: str = "isotropic", g: Any = 0.0, sigma_t: Any = 0.0
) -> Cases:
    """Return segments between angles at a light that is 1 m from the ray, its foot 4 m from the camera."""
    x0, x1 = 4 + np.tan(theta0), 4 + np.tan(theta1)
    ones = np.ones(len(x0))
    names, tags = [phase] * len(ones), ["angle"] * len(ones)
    return with_truth(
        table(names, g * ones, foot=4 * ones, height=ones, x0=x0, x1=x1, sigma_t=sigma_t * ones, tags=tags)
    )


def _many_angles() -> Cases:
    """Return long segments with ends all over the cells of a table, so that its largest error is met."""
    u = np.random.default_rng(71).random((3, 2000))
    return _angles(-1.2 + 0.8 * u[0], 0.2 + 0.8 * u[1], sigma_t=0.2 + 1.5 * u[2])


def _largest(name: str, cases: Cases) -> float:
    J = evaluate_cases(cases, find_kernel(name), "double").J
    return float(np.max(relative_error(J, np.asarray(cases.value), "double")))


def _slopes(sizes: Array, errors: Array, power: float) -> tuple[float | None, float | None]:
    counts = (errors > _FLOOR) & (errors < _CEILING)
    if counts.sum() < 2:
        return None, None
    sizes, errors = sizes[counts], errors[counts]
    envelope = np.maximum.accumulate(errors[::-1])[::-1]
    order = -np.polyfit(np.log(sizes), np.log(envelope), 1)[0]
    envelope = np.maximum.accumulate((errors / sizes**power)[::-1])[::-1]
    return float(order), float(np.exp(np.polyfit(sizes, np.log(envelope), 1)[0]))
