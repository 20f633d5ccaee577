# SPDX-License-Identifier: BSD-3-Clause
"""Sampling distances along a camera ray, in Dr.Jit: equi-angular,
free-flight, and the two combined.

A *span* is a part of a ray between s0 and s1 = s0 + length, both measured from the foot of the
perpendicular from the light, so that r^2 = h^2 + s^2; s1 may be infinite. Distances are sampled as
y = s - s0 in [0, length].

Equi-angular (Kulla and Fajardo 2012, section 4; densities there over the same span): the angle
delta at the light from the start of the span is uniform, which gives a density proportional to
1/r^2. With r0 = sqrt(h^2 + s0^2) and the tangent of a difference of angles,

    tan(delta) = h y / (r0^2 + s0 y)        the angle between s0 and s0 + y, by the cross and dot products
    y = r0^2 sin(delta) / (h cos(delta) - s0 sin(delta))
    pdf(y) = h / (range r^2),               range = delta(length).

No angle is subtracted from another: the range of a short or distant span keeps all its digits,
in single precision too.

Free-flight: the exponential density sigma exp(-sigma y) / (1 - exp(-sigma length)), truncated to
the span. With t = tanh(sigma length / 2), 1 - exp(-sigma length) = 2 t / (1 + t), and -log(1 - z) =
2 atanh(z / (2 - z)) gives

    y = 2 atanh(u t / (1 + t (1 - u))) / sigma,

again free of cancellation, down to sigma length = 0, the uniform density. Where the extinction
depends on the channel, the density is the mean over the channels (spectral multiple importance
sampling).

Combined: the density is the mean of the two. The estimator f(y)/pdf(y) is then the balance
heuristic with even odds (Veach 1997, theorem 9.4): sum over both techniques of the weight
pdf_t/(pdf_1 + pdf_2) times f/pdf_t. Its variance is finite for every ray that does not meet the
light: f r^2 is bounded (by sigma_s I max p) and pdf r^2 >= h/(2 range), whatever the free-flight
density and whatever channel f is of.

Nothing falls with the distance to a light from infinity: what varies along a stretch of length d is
exp(-sigma y) of the camera ray, the transmittance of the segment, which may fall or rise, and
shadows. There the density is the mean of the uniform one, 1/d, and of free flights. Half of the
unit interval goes to the former, half to the latter: with n samples in n cells either technique is
stratified by itself. As the density is nowhere below 1/(2 d), the estimator is bounded.

References
----------
C. Kulla and M. Fajardo 2012, Importance sampling techniques for path tracing in participating
media. E. Veach 1997, Robust Monte Carlo methods for light transport simulation, chapter 9.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import drjit as dr
import mitsuba as mi


@dataclass(frozen=True)
class Approach:
    """How rays pass a light."""

    foot: "mi.Float64"  #: distance along the ray of the foot of the perpendicular [m]
    height: "mi.Float64"  #: distance of the light from the ray [m]
    normal: "mi.Vector3d"  #: unit vector from the light to the foot


@dataclass(frozen=True)
class Span:
    """A part of a ray as a light sees it; in double precision, since the length of a short part far
    from the foot is a small difference.
    """

    height: "mi.Float64"  #: distance of the light from the ray, above 0 [m]
    start: "mi.Float64"  #: s0, from the foot [m]
    length: "mi.Float64"  #: s1 - s0, may be infinite [m]


def closest_approach(
    origin: "mi.Point3d", direction: "mi.Vector3d", position: "mi.Point3d"
) -> Approach:
    """Return how rays pass a light.

    `origin`, `direction`: where rays start [m], and their unit directions; `position`: of the light
    [m].

    Valid for any ray; one that meets the light gets a height of 1e-30 and a normal near zero.
    """
    offset = origin - position
    foot = -dr.dot(offset, direction)
    perpendicular = offset + direction * foot
    height = dr.maximum(dr.norm(perpendicular), 1e-30)
    return Approach(foot, height, perpendicular / height)


def cone_ends(
    approach: Approach, direction: "mi.Vector3d", *, axis: "mi.Vector3d", cutoff: float
) -> "tuple[mi.Float64, mi.Float64]":
    """Return the ends of the part of a line inside a spot's cone, as distances from the foot [m];
    the part is empty if the first end is above the second.

    The direction from the light to the point s is w(theta) = sin(theta) direction + cos(theta)
    normal, with tan(theta) = s/h, so that axis . w = m cos(theta - middle), with (m, middle) the
    polar form of (axis . normal, axis . direction). It is above cos(cutoff) for |theta - middle| <
    acos(cos(cutoff)/m).

    `approach`: how the rays pass the light; `direction`: the rays' unit directions; `axis`: the
    cone's axis, a unit vector; `cutoff`: the cone's half angle [rad].

    Valid for cones up to a half space; the part inside a wider cone is the whole line. The ends lie
    outside the cone by a hair: samples are drawn between them, and Mitsuba's emitter says what it
    sends to a sample.
    """
    infinity = dr.inf
    if cutoff > 0.5 * math.pi:
        return mi.Float64(-infinity), mi.Float64(infinity)
    # By how much samples may fall beside the cone [rad]: above the rounding of double precision,
    # and so little that hardly any sample does. (A wider strip with a sample in 1 of 100 batches
    # would be a bias in the other 99.)
    margin = 1e-8
    height = approach.height
    along, across = dr.dot(axis, direction), dr.dot(axis, approach.normal)
    ratio = math.cos(cutoff) / dr.maximum(dr.sqrt(along * along + across * across), 1e-20)
    half = dr.acos(dr.minimum(ratio, 1)) + margin
    middle = dr.atan2(along, across)
    low, high = middle - half, middle + half
    right = 0.5 * math.pi - 1e-12  # beyond, the tangent belongs to the line's other end
    low_end = dr.select(low > -right, height * dr.tan(dr.clip(low, -right, right)), -infinity)
    high_end = dr.select(high < right, height * dr.tan(dr.clip(high, -right, right)), infinity)
    outside = (ratio > 1 + margin) | (low > right) | (high < -right)
    return low_end, dr.select(outside, -infinity, high_end)


def equi_angular_range(span: Span) -> "mi.Float64":
    """Return the angle that the light sees the span under [rad]."""
    finite = span.length < dr.inf
    return dr.select(
        finite, _angle(dr.select(finite, span.length, 1), span), dr.atan2(span.height, span.start)
    )


def equi_angular(u: "mi.Float64", span: Span) -> "mi.Float64":
    """Return distances y from the start of the span [m], uniform in the angle at the light, for u
    in [0, 1).
    """
    return _distance(u * equi_angular_range(span), span)


def equi_angular_pdf(y: "mi.Float64", span: Span) -> "mi.Float64":
    """Return the density of `equi_angular` at y [1/m]."""
    h, s = span.height, span.start + y
    return h / (equi_angular_range(span) * (h * h + s * s))


def _distance(angle: "mi.Float64", span: Span) -> "mi.Float64":
    """Return y, the distance from the start of the span to the point that the light sees at an
    angle [rad] from the start [m].
    """
    s0, h = span.start, span.height
    sine, cosine = dr.sincos(angle)
    # r0 cos(theta): above 0, and 0 at the far end of an unbounded ray. A sample there goes to 1e30
    # m, from where nothing is transmitted.
    beyond = h * cosine - s0 * sine
    y = (h * h + s0 * s0) * sine / dr.maximum(beyond, 1e-30)
    return dr.minimum(dr.select(beyond > 0, y, 1e30), span.length)


def _angle(y: "mi.Float64", span: Span) -> "mi.Float64":
    """Return the angle at the light between the start of the span and the point at y,
    the inverse of `_distance`.
    """
    s0, h = span.start, span.height
    return dr.atan2(h * y, h * h + s0 * (s0 + y))


@dataclass(frozen=True)
class FreeFlight:
    """The truncated exponential distribution of one channel's free flights."""

    cut: "mi.Float64"  #: length of the span, or a length that hardly any flight exceeds [m]
    rate: "mi.Float64"  #: extinction [1/m]
    tanh: "mi.Float64"  #: tanh(rate cut / 2)


def free_flights(length: "mi.Float64", sigma_t: "mi.Float64") -> FreeFlight:
    """Return the free flights in a span of some length [m] and extinction [1/m].

    Valid for sigma_t > 0, and for sigma_t = 0 where the length is finite.
    """
    # Free flights are cut at 60 mean free paths: 1e-26 of them are longer, and the other technique
    # covers what is beyond. The exponential of a span thinner than 1e-12 is uniform to the last
    # bit.
    cut = dr.minimum(length, 60.0 / sigma_t)
    depth = dr.maximum(sigma_t * cut, 1e-12)
    return FreeFlight(cut, depth / cut, dr.tanh(0.5 * depth))


def free_flight(u: "mi.Float64", flight: FreeFlight) -> "mi.Float64":
    """Return free-flight distances y from the start of the span [m], for u in [0, 1)."""
    t = flight.tanh
    return dr.minimum(2 * dr.atanh(u * t / (1 + t * (1 - u))) / flight.rate, flight.cut)


def free_flight_pdf(y: "mi.Float64", flight: FreeFlight) -> "mi.Float64":
    """Return the density of `free_flight` at y [1/m]."""
    return _flight_cdf_and_pdf(y, flight)[1]


def _flight_cdf_and_pdf(y: "mi.Float64", flight: FreeFlight) -> "tuple[mi.Float64, mi.Float64]":
    """Return the distribution function (whose absolute error is a rounding over rate cut) and the
    density [1/m].
    """
    inside = y <= flight.cut
    survival = dr.exp(-flight.rate * y)
    # 1 - exp(-depth) = 2 t/(1 + t): one over it, without cancellation.
    scale = (1 + flight.tanh) / (2 * flight.tanh)
    return dr.select(inside, scale * (1 - survival), 1), dr.select(
        inside, flight.rate * scale * survival, 0
    )


@dataclass(frozen=True)
class Mixture:
    """Both techniques on one span."""

    span: Span
    range: "mi.Float64"  #: the angle that the light sees the span under [rad]
    flights: tuple[FreeFlight, ...]  #: one for each channel


def mixture_of(span: Span, sigma_t: "Sequence[mi.Float]") -> Mixture:
    """Return the mixture of both techniques for one common extinction, or one of each channel
    [1/m].
    """
    rates = [mi.Float64(rate) for rate in sigma_t]
    # Free flights without extinction have no density on an unbounded span: such a channel takes
    # those of the densest one.
    densest = reduce(dr.maximum, rates)
    flown = (dr.select((rate > 0) | (span.length < dr.inf), rate, densest) for rate in rates)
    flights = tuple(free_flights(span.length, rate) for rate in flown)
    return Mixture(span, equi_angular_range(span), flights)


def mixture_pdfs(y: "mi.Float64", mixture: Mixture) -> "tuple[mi.Float64, mi.Float64]":
    """Return the terms of equi-angular sampling and of free flights in the mixture density at y
    [1/m]; their fractions of the sum are the MIS weights.
    """
    (_, equi), (_, free) = _terms(y, mixture)
    return equi, free


def _terms(y: "mi.Float64", mixture: Mixture) -> "list[tuple[mi.Float64, mi.Float64]]":
    """Return the terms of equi-angular sampling and of free flights in the distribution function
    and the density [1/m].
    """
    h, s = mixture.span.height, mixture.span.start + y
    flights = [_flight_cdf_and_pdf(y, flight) for flight in mixture.flights]
    fraction = 0.5 / len(flights)
    equi = (
        0.5 * _angle(y, mixture.span) / mixture.range,
        0.5 * h / (mixture.range * (h * h + s * s)),
    )
    return [
        equi,
        (fraction * sum(cdf for cdf, _ in flights), fraction * sum(pdf for _, pdf in flights)),
    ]


def sample_distance(
    u: "mi.Float | mi.Float64", mixture: Mixture
) -> "tuple[mi.Float64, mi.Float64]":
    """Sample a distance from the mixture of both techniques by inverting its cumulative
    distribution.

    `u`: uniform in [0, 1); `mixture`: see `mixture_of`. Returns the distances from the start of the
    span [m] and the density [1/m].

    The distance grows with u, so that a regular grid of u, jittered, stratifies the distance. (If u
    chose the technique, a point light's peak would fall into few cells of the free flights: 50
    times the variance at 64 samples.)

    The mean of several distribution functions has the value u between the places where each of them
    has it. These places are the bracket of Newton's method in the angle delta, with
    d(y)/d(delta) = r^2/h; a step that leaves the bracket is replaced by a bisection. All this is in
    double precision: in single, the angle cannot resolve distances far beyond a close light.
    """
    span, u = mixture.span, mi.Float64(u)
    # The bracket: the angles at which the distribution functions of the techniques are u.
    low = high = u * mixture.range
    for flight in mixture.flights:
        angle = _angle(free_flight(u, flight), span)
        low, high = dr.minimum(low, angle), dr.maximum(high, angle)

    def improve(number, searching, low, high, angle):
        y = _distance(angle, span)
        (equi, density), (free, free_density) = _terms(y, mixture)
        excess = equi + free - u
        low, high = dr.select(excess < 0, angle, low), dr.select(excess < 0, high, angle)
        s = span.start + y
        newton = angle - excess / ((density + free_density) * (span.height + s * s / span.height))
        # Every fourth step halves the bracket, whatever Newton's method would do.
        use_newton = (newton > low) & (newton < high) & (number % 4 != 3)
        better = dr.select(use_newton, newton, 0.5 * (low + high))
        # The mixture is inverted to 3e-8, a rounding of what samplers draw. Most lanes take five
        # steps, none more than 60.
        searching &= (dr.abs(excess) > 3e-8) & (number < 60)
        return number + 1, searching, low, high, dr.select(searching, better, angle)

    state = (mi.UInt32(0), dr.full(mi.Bool, True, dr.width(low)), low, high, 0.5 * (low + high))
    angle = dr.while_loop(
        state, lambda number, searching, *_: searching, improve, label="inverse of the mixture"
    )[-1]
    y = _distance(angle, span)
    return y, sum(mixture_pdfs(y, mixture))


def sample_stretch(
    u: "mi.Float | mi.Float64", length: "mi.Float64", sigma_t: "Sequence[mi.Float]"
) -> "tuple[mi.Float64, mi.Float64]":
    """Sample a distance for a light from infinity, by the mean of the uniform density and of free
    flights.

    `u`: uniform in [0, 1); `length`: of the stretch, finite and above 0 [m]; `sigma_t`: one
    extinction for all channels, or one for each [1/m]. Returns distances from its start [m] and
    their density [1/m].
    """
    u, length = mi.Float64(u), mi.Float64(length)
    flights = [free_flights(length, mi.Float64(rate)) for rate in sigma_t]
    fraction = 0.5 / len(flights)
    # u below a half draws evenly, above it the free flights, an equal part of the rest for each
    # channel.
    y = 2 * u * length
    for number, flight in enumerate(flights):
        low = 0.5 + number * fraction
        y = dr.select(u >= low, free_flight(dr.clip((u - low) / fraction, 0, 1), flight), y)
    y = dr.minimum(y, length)
    return y, 0.5 / length + fraction * sum(free_flight_pdf(y, flight) for flight in flights)
