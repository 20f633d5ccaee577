# SPDX-License-Identifier: BSD-3-Clause
"""The equations of both papers as they are printed, against the certified integral, on random rays in float64.

Every number is the largest relative difference over the rays. The integrands are written here as the papers print them
and integrated by QUADPACK; `analytic.panels` has other forms and another rule. Sums are over four random lit segments
of each ray.
"""

from typing import Any

import numpy as np
from scipy.integrate import quad

from analytic.panels import airlight_segments
from analytic.phase import PhaseFunction
from analytic.series import taylor_coefficients

_RAYS = 48
_HAZY = PhaseFunction("hazy")
#: Ends of shadows that overlap, in units of the ray's length: Fig. 3b of Billeter 2010.
_OVERLAPPING = ((0.2, 0.5), (0.4, 0.7))


def equations() -> dict[str, Any]:
    """Return the largest relative differences by name.

    Returns
    -------
    dict
        `distance`, `angle`, `change` (of variables), `segments` (sums of segments against sums of differences), `order`
        (of the terms), `scaling` (the integral times h against one of plain numbers), `integrated` (eq. 2 against
        quadrature of its own polynomial), `overlap` (what a signed sum over overlapping shadows loses [1]), `two_lit`
        (Fig. 2 of Billeter 2010).
    """
    random = np.random.default_rng(20060130)
    # No ray passes the light closer than 0.2: QUADPACK would need to be told of the peak.
    foot, height = random.uniform(-2, 4, _RAYS), random.uniform(0.2, 2, _RAYS)
    length, sigma = random.uniform(1, 6, _RAYS), random.uniform(0.05, 0.8, _RAYS)
    rays = list(zip(foot, height, length, sigma))
    true, _ = airlight_segments(foot, height, 0.0, length, sigma, _HAZY)
    ends = np.sort(random.uniform(0, 1, (_RAYS, 8)), axis=1) * length[:, None]
    signs = np.tile([-1.0, 1.0], 4)
    gamma = np.stack([airlight_segments(foot, height, 0.0, end, sigma, _HAZY)[0] for end in ends.T], axis=1)
    pairs = [(ends[:, k], ends[:, k + 1]) for k in range(0, 8, 2)]
    lit = np.sum([airlight_segments(foot, height, x0, x1, sigma, _HAZY)[0] for x0, x1 in pairs], axis=0)
    terms = gamma * signs
    shuffled = np.stack([terms[:, random.permutation(8)].sum(axis=1) for _ in range(20)])
    scaled, _ = airlight_segments(foot / height, 1.0, 0.0, length / height, sigma * height, _HAZY)
    return {
        "distance": _largest([_distance(*ray) for ray in rays], true),
        "angle": _largest([_angle(*ray) for ray in rays], true),
        "change": _change(random),
        "segments": _largest(terms.sum(axis=1), lit),
        "order": float(np.max(np.ptp(shuffled, axis=0) / np.abs(terms).sum(axis=1))),
        "scaling": _largest(scaled / height, true),
        "integrated": _integrated(rays),
        "overlap": _overlap(rays),
        "two_lit": _two_lit(rays),
    }


def _largest(values: Any, true: Any) -> float:
    return float(np.max(np.abs(np.asarray(values) / np.asarray(true) - 1)))


def _distance(foot: float, height: float, length: float, sigma: float) -> float:
    """Return J by the integrand of eq. 1 of both papers, as printed."""

    def integrand(x: float) -> float:
        r = np.hypot(height, x - foot)
        return np.exp(-sigma * x) * np.exp(-sigma * r) / r**2 * float(_HAZY((foot - x) / r))

    inner = [foot] if 0 < foot < length else None
    return quad(integrand, 0, length, epsabs=0, epsrel=1e-12, points=inner, limit=400)[0]


def _angle(foot: float, height: float, length: float, sigma: float) -> float:
    """Return J by the angle form of section 4.1 of Biri 2006, as printed: the phase function is p(theta + pi/2)."""

    def integrand(theta: float) -> float:
        path = (np.sin(theta) + 1) / np.cos(theta)
        return np.exp(-sigma * height * path) * float(_HAZY(np.cos(theta + np.pi / 2)))

    ends = np.arctan((0 - foot) / height), np.arctan((length - foot) / height)
    return np.exp(-sigma * foot) / height * quad(integrand, *ends, epsabs=0, epsrel=1e-12, limit=400)[0]


def _change(random: np.random.Generator) -> float:
    """Return |r / sqrt(h^2 + (x - t)^2) - 1|, with r, h and t from points in space."""
    light, direction = random.normal(size=(2, _RAYS, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    x = random.uniform(0, 5, _RAYS)
    t = np.sum(light * direction, axis=1)
    h = np.linalg.norm(light - t[:, None] * direction, axis=1)
    r = np.linalg.norm(light - x[:, None] * direction, axis=1)
    return _largest(np.sqrt(h**2 + (x - t) ** 2), r)


def _integrated(rays: list[Any]) -> float:
    """Compare eq. 2 of Biri 2006, powers of the angles, with the quadrature of the polynomial it integrates."""
    worst = 0.0
    for foot, height, length, sigma in rays:
        ends = np.arctan((0 - foot) / height), np.arctan((length - foot) / height)
        polynomial = taylor_coefficients(sigma * height, _HAZY, 4)
        closed = sum(c * (ends[1] ** (n + 1) - ends[0] ** (n + 1)) / (n + 1) for n, c in enumerate(polynomial))
        # The same polynomial integrated term by term has other rounding, relative to the sum of the terms' sizes.
        scale = abs(sum(abs(c) * (abs(ends[1]) ** (n + 1) + abs(ends[0]) ** (n + 1)) for n, c in enumerate(polynomial)))
        worst = max(worst, abs(closed - quad(_polynomial, *ends, (polynomial,), epsabs=0, epsrel=1e-12)[0]) / scale)
    return float(worst)


def _polynomial(theta: float, coefficients: Any) -> float:
    return float(np.polynomial.polynomial.polyval(theta, coefficients))


def _overlap(rays: list[Any]) -> float:
    """Return the mean share of the airlight that a signed sum over two overlapping shadows takes away too much."""
    lost = []
    for foot, height, length, sigma in rays:
        (a, b), (c, d) = (tuple(length * end for end in pair) for pair in _OVERLAPPING)
        signed = _gamma(foot, height, sigma, length)
        signed += sum(_gamma(foot, height, sigma, x) for x in (a, c)) - sum(
            _gamma(foot, height, sigma, x) for x in (b, d)
        )
        true = (
            _gamma(foot, height, sigma, a)
            + _gamma(foot, height, sigma, length)
            - _gamma(foot, height, sigma, max(b, d))
        )
        lost.append((true - signed) / true)
    return float(np.mean(lost))


def _two_lit(rays: list[Any]) -> float:
    """Compare L(0, x0) - L(0, x1) + L(0, x2) with L(0, x0) + L(x1, x2)."""
    worst = 0.0
    for foot, height, length, sigma in rays:
        x0, x1, x2 = 0.3 * length, 0.6 * length, length
        second = float(airlight_segments(foot, height, x1, x2, sigma, _HAZY)[0][0])
        whole = _gamma(foot, height, sigma, x0) + second
        signed = sum(sign * _gamma(foot, height, sigma, x) for sign, x in ((1, x0), (-1, x1), (1, x2)))
        worst = max(worst, abs(signed / whole - 1))
    return worst


def _gamma(foot: float, height: float, sigma: float, x: float) -> float:
    return float(airlight_segments(foot, height, 0.0, x, sigma, _HAZY)[0][0])
