# SPDX-License-Identifier: BSD-3-Clause
"""The airlight integral of one segment by adaptive quadrature, in three forms that share only their inputs.

Start from the single-scattering integral of Biri 2006 (eq. 1) and Billeter 2010 (eq. 1), with s = x - foot and
r = sqrt(height^2 + s^2):

    J = int_{x0}^{x1} exp(-sigma_t (x + r)) p(cos) / r^2 dx,        cos = -s/r.                             (distance)

**Angle.** Put s = h tan(theta). Then r = h/cos(theta), dx = h/cos^2(theta) dtheta = r^2/h dtheta, cos = -sin(theta),
and the path is x + r = foot + h (sin(theta) + 1)/cos(theta) = foot + h tan(theta/2 + pi/4):

    J = exp(-sigma_t foot)/h  int exp(-sigma_t h tan(theta/2 + pi/4)) p(-sin(theta)) dtheta.                   (angle)

The code counts the angle from the ray instead, phi = pi/2 - |theta|, on either side of the foot: close to the light
theta is close to +-pi/2, where its rounding would cost digits, and phi is close to 0. Before the foot the tangent is
tan(phi/2) and cos = cos(phi); behind it 1/tan(phi/2) and -cos(phi).

**Path.** Put q = s + r. From (r + s)(r - s) = h^2 follow r = (q + h^2/q)/2 and s = (q - h^2/q)/2, so that
dx = (1 + h^2/q^2)/2 dq = r/q dq, dx/r^2 = dq/(q r) = 2 dq/(q^2 + h^2), and cos = -s/r = (h^2 - q^2)/(h^2 + q^2):

    J = int_{q0}^{q1} exp(-sigma_t (foot + q)) p((h^2 - q^2)/(h^2 + q^2)) 2/(h^2 + q^2) dq                      (path)
      = (1/h) int_{w0}^{w1} exp(-sigma_t (foot + h e^w)) p(-tanh w) / cosh w dw,          q = h e^w.

The first two are integrated by QUADPACK's Gauss-Kronrod rules, the third by tanh-sinh. Oracles of `analytic.panels`:
a call takes milliseconds.
"""

import itertools
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import quad, tanhsinh

from analytic.errors import InputError
from analytic.phase import PhaseFunction

_UNDERFLOW = 745.0  # exp(-745) is the smallest positive float64
_BESIDE = 1e-12  # height over distance to the segment below which the height changes J by less than 1e-20
_AT_LIGHT = 1e-290  # height [m] below which J would overflow
_EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True)
class Estimate:
    """A number and an estimate of its absolute error, in the unit of the number."""

    value: float
    error: float


@dataclass(frozen=True)
class _Segment:
    """One regular segment: not empty, the light not on it, all numbers checked."""

    foot: float
    height: float  # > 0
    start: float  # s0 = x0 - foot
    length: float  # x1 - x0, may be infinite
    sigma_t: float
    phase: PhaseFunction


def integrate_distance(
    foot: float, height: float, x0: float, x1: float, sigma_t: float, phase: PhaseFunction, *, rtol: float = 1e-11
) -> Estimate:
    """Integrate J over the distance x (module docstring, form "distance").

    Parameters
    ----------
    foot, height
        Signed distance of the foot point along the ray and distance from the light to the ray [m].
    x0, x1
        Ends of the segment [m], x0 <= x1; x1 may be infinite.
    sigma_t
        Extinction coefficient [1/m], >= 0.
    phase
        Phase function.
    rtol
        Relative tolerance of every piece between two break points.

    Returns
    -------
    Estimate
        J [1/m]: 0 for an empty segment, +inf (error inf) if the light is on the segment.

    Raises
    ------
    InputError
        For numbers out of their ranges.

    Notes
    -----
    Valid for all finite inputs, height 0 and sigma_t 0 among them, as are the two other forms.
    """
    segment = _prepared(foot, height, x0, x1, sigma_t, phase)
    if isinstance(segment, Estimate):
        return segment
    total = [_distance_side(segment, *side, rtol=rtol) for side in _sides(segment)]
    return _with_rounding(segment, _sum(total))


def integrate_angle(
    foot: float, height: float, x0: float, x1: float, sigma_t: float, phase: PhaseFunction, *, rtol: float = 1e-11
) -> Estimate:
    """Integrate J over the angle at the light [1/m] (module docstring, form "angle").

    Parameters, `Returns` and `Raises` are those of `integrate_distance`.
    """
    segment = _prepared(foot, height, x0, x1, sigma_t, phase)
    if isinstance(segment, Estimate):
        return segment
    total = _sum([_angle_side(segment, *side, rtol=rtol) for side in _sides(segment)])
    return _with_rounding(segment, Estimate(total.value / segment.height, total.error / segment.height))


def integrate_path(
    foot: float, height: float, x0: float, x1: float, sigma_t: float, phase: PhaseFunction, *, rtol: float = 1e-11
) -> Estimate:
    """Integrate J over w, the logarithm of the path [1/m] (module docstring, form "path").

    Parameters, `Returns` and `Raises` are those of `integrate_distance`.
    """
    segment = _prepared(foot, height, x0, x1, sigma_t, phase)
    if isinstance(segment, Estimate):
        return segment
    s0, s1, h = segment.start, segment.start + segment.length, segment.height
    r0, r1 = math.hypot(h, s0), math.hypot(h, s1)
    e0 = (s0 + r0) / h if s0 >= 0 else h / (r0 - s0)
    w0 = math.asinh(s0 / h)
    if math.isinf(s1):
        width = math.inf
    elif s0 * s1 > 0:  # the difference of the two asinh without cancellation, by the addition theorem of sinh
        width = math.asinh(segment.length * (s0 + s1) / (s1 * r0 + s0 * r1))
    else:
        width = math.asinh(s1 / h) - w0
    width = min(width, max(-w0, 0.0) + 90)  # 1/cosh w falls by e^-90 behind the foot
    if sigma_t > 0:
        width = min(width, math.log1p(_UNDERFLOW / (sigma_t * h * e0)))

    def integrand(u: np.ndarray) -> np.ndarray:
        e = e0 * np.exp(u)
        return np.exp(-sigma_t * (foot + h * e)) * phase.from_half(*_half(e)) * (2 / (e + 1 / e))

    def pieces(count: int) -> float:
        ends = _between(np.concatenate([np.linspace(0.0, width, count + 1), np.arctanh(-phase.kinks) - w0]), width)
        with np.errstate(under="ignore"):
            result = tanhsinh(integrand, ends[:-1], ends[1:], rtol=max(1e-3 * rtol, 1e-15), atol=0.0, maxlevel=12)
        return float(np.sum(result.integral)) / h

    # The rule's own error estimate extrapolates, often too far; two subdivisions that share no node do not.
    count = math.ceil(width / 3)
    value = pieces(count)
    return _with_rounding(segment, Estimate(value, abs(value - pieces(count + 1))))


def _sides(segment: _Segment) -> list[tuple[bool, float, float]]:
    """Split at the foot: (before the foot or not, distance of the nearer end from the foot, length) of each part.

    Counted from the foot, no distance on either side cancels.
    """
    s0, s1 = segment.start, segment.start + segment.length
    sides = []
    if s0 < 0:
        sides.append((True, max(-s1, 0.0), segment.length if s1 <= 0 else -s0))
    if s1 > 0:
        sides.append((False, max(s0, 0.0), segment.length if s0 >= 0 else s1))
    return sides


def _distance_side(segment: _Segment, before: bool, nearest: float, length: float, *, rtol: float) -> Estimate:
    """Integrate over the distance from the foot on one side of it."""
    h, foot, sigma_t = segment.height, segment.foot, segment.sigma_t

    def integrand(v: float) -> float:
        s = nearest + v
        r = math.hypot(h, s)
        q = h * (h / (r + s)) if before else s + r
        return math.exp(-sigma_t * (foot + q)) * float(segment.phase.from_half(*_half(q / h))) / r / r

    # The integrand changes over the distance to the foot, not less than h, and over 1/(2 sigma_t) behind the foot.
    kinks = np.sinh(np.arctanh(segment.phase.kinks if before else -segment.phase.kinks))
    marks = h * np.concatenate([4.0 ** np.arange(-1, 60), kinks]) - nearest
    end = length
    if sigma_t > 0 and not before:
        marks = np.concatenate([marks, 4.0 ** np.arange(-1, 6) / (2 * sigma_t)])
        end = min(end, h + _UNDERFLOW / sigma_t)
    if math.isfinite(end):
        return _pieces(integrand, end, marks, rtol=rtol)
    # A vacuum without end: up to a distance well off, then the 1/s^2 decay, mapped to a finite range by v = far/z.
    far = 16 * max(nearest, h, h * float(np.max(kinks, initial=0.0)))
    tail = _pieces(lambda z: integrand(far / z) * far / z / z, 1.0, (), rtol=rtol)
    return _sum([_pieces(integrand, far, marks, rtol=rtol), tail])


def _angle_side(segment: _Segment, before: bool, nearest: float, length: float, *, rtol: float) -> Estimate:
    """Integrate over phi on one side of the foot, from distance `nearest` >= 0 to `nearest` + `length` off the foot."""
    h, a = segment.height, segment.sigma_t * segment.height
    farthest = nearest + length
    smallest = math.atan2(h, farthest) if math.isfinite(farthest) else 0.0
    # The angle that the side subtends at the light, of which no digits cancel.
    width = math.atan2(h * length, h * h + nearest * farthest) if smallest else math.atan2(h, nearest)

    def integrand(u: float) -> float:
        tangent = math.tan(0.5 * (smallest + u))
        if tangent == 0 and not before:
            return 0.0 if a > 0 else math.exp(-segment.sigma_t * segment.foot) * float(segment.phase(-1.0))
        e = tangent if before else 1 / tangent
        return math.exp(-(segment.sigma_t * segment.foot + a * e)) * float(segment.phase.from_half(*_half(e)))

    largest = smallest + width
    marks = [largest * 4.0**-k for k in range(1, 30)]
    marks += [math.acos(c if before else -c) for c in segment.phase.kinks]
    if a > 0 and not before:  # where the exponent has grown by 4^k since the foot's end of the side
        marks += [2 * math.atan(1 / (4.0**k / a + 1 / math.tan(0.5 * largest))) for k in range(-2, 5)]
    return _pieces(integrand, width, np.array(marks) - smallest, rtol=rtol)


def _half(e: Any) -> tuple[Any, Any]:
    """Return sin^2 and cos^2 of half the scattering angle from E = q/h: 1/(1 + E^2) is the second."""
    kernel = 1 / (e + 1 / e)
    return e * kernel, kernel / e


def _pieces(integrand: Callable[[float], float], end: float, marks: Iterable[float], *, rtol: float) -> Estimate:
    """Integrate from 0 to `end` with breaks at those marks that lie between, by Gauss-Kronrod with bisection."""
    ends = _between(marks, end)
    # full_output keeps QUADPACK from warning: what it could not reach is in the error estimate.
    parts = [
        quad(integrand, a, b, epsabs=0.0, epsrel=rtol, limit=200, full_output=1)[:2]
        for a, b in itertools.pairwise(ends)
    ]
    return _sum([Estimate(*part) for part in parts])


def _sum(parts: list[Estimate]) -> Estimate:
    return Estimate(math.fsum(p.value for p in parts), math.fsum(p.error for p in parts))


def _between(marks: Iterable[float], end: float) -> np.ndarray:
    inside = np.array([m for m in marks if 0 < m < end])
    return np.unique(np.concatenate([[0.0], inside, [end]]))


def _with_rounding(segment: _Segment, estimate: Estimate) -> Estimate:
    """Add the rounding of the exponent, which no quadrature rule can see."""
    value = estimate.value
    # exp(-exponent)/h bounds the integrand; the exponent that counts is at most the logarithm of what J lost by it.
    exponent = segment.sigma_t * (abs(segment.foot) + abs(segment.start) + segment.height)
    return Estimate(value, estimate.error + _EPSILON * (64 + 4 * min(exponent, 2 * _UNDERFLOW)) * abs(value))


def _prepared(
    foot: float, height: float, x0: float, x1: float, sigma_t: float, phase: PhaseFunction
) -> _Segment | Estimate:
    """Check the inputs; return the value itself where it is 0 or infinite."""
    for name, number in (("foot", foot), ("height", height), ("x0", x0), ("sigma_t", sigma_t)):
        if not math.isfinite(number):
            raise InputError(f"{name} is {number}; wanted a finite number")
    for name, number in (("height", height), ("sigma_t", sigma_t)):
        if number < 0:
            raise InputError(f"{name} is {number}; wanted a number >= 0")
    if not x1 >= x0:
        raise InputError(f"x1 is {x1}; wanted a number >= x0 = {x0}, or inf")
    if x0 == x1:
        return Estimate(0.0, 0.0)
    s0, s1 = x0 - foot, x1 - foot
    if height < _AT_LIGHT and s0 <= 0 <= s1:
        return Estimate(math.inf, math.inf)
    # A ray through the light, the light beside the segment: J is continuous in the height there, so take a tiny one.
    height = max(height, _BESIDE * max(s0, -s1, 0.0))
    return _Segment(foot, height, s0, x1 - x0, sigma_t, phase)
