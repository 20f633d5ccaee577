# SPDX-License-Identifier: BSD-3-Clause
"""Sampling distances: the densities against histograms, integrals and a single technique at a time.

The spans cover what a camera can see: a light behind it, beside it, beyond the surface, very close
to the ray, spans that are short, unbounded, thin or many mean free paths thick, and the spans that
a spot's cone cuts out.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import chi2

from airlight.realtime.numerics.array_types import aligned_array
from airlight.reference.monte_carlo.single_scatter import distance_sampling as ds
from airlight.reference.monte_carlo.single_scatter.distance_sampling import (
    Span,
    _terms,
    closest_approach,
    cone_ends,
    equi_angular_pdf,
    mixture_of,
    sample_distance,
    sample_stretch,
)

SPANS = {  # height, start, length, extinctions
    "light ahead": (0.7, -3.1, 7.3, [0.31]),
    "light behind": (0.9, 2.3, 4.7, [0.5]),
    "beyond the surface": (1.3, -6.1, 2.9, [0.21]),
    "unbounded": (0.4, -2.2, np.inf, [0.17]),
    "unbounded, light behind": (0.4, 1.7, np.inf, [0.6]),
    "near": (2e-3, -1.9, 5.3, [0.4]),
    "near and unbounded": (1e-4, -41.0, np.inf, [1.3e-3]),
    "short": (0.8, -0.3, 1e-3, [2.0]),
    "distant": (0.6, -900.0, 0.5, [0.05]),
    "thin": (0.5, -1.1, 3.0, [1e-9]),
    "thick": (0.9, -8.0, 19.0, [7.0]),
    "coloured": (0.7, -2.5, 6.0, [0.02, 0.4, 3.1]),
    "coloured and unbounded": (0.3, -1.5, np.inf, [0.1, 0.3, 0.7]),
    "clear in a channel and unbounded": (0.3, -1.5, np.inf, [0.3, 0.0, 0.7]),
}
SAMPLES = 1 << 16
CELLS = 101


def _span(case):
    height, start, length, _ = SPANS[case]
    return Span(*(dr.opaque(mi.Float64, value) for value in (height, start, length)))


def _mixture(case):
    return mixture_of(_span(case), [dr.opaque(mi.Float64, rate) for rate in SPANS[case][3]])


def mixture_cdf(y, mixture):
    """Return the probability that `sample_distance` stays below y."""
    return sum(cdf for cdf, _ in _terms(y, mixture))


def _technique(case, name):
    """Return a sampler of u and a density of y of one technique."""
    if name == "equi-angular":
        return lambda u: ds.equi_angular(u, _span(case)), lambda y: equi_angular_pdf(y, _span(case))
    if name == "free-flight":
        flight = ds.free_flights(_span(case).length, dr.opaque(mi.Float64, SPANS[case][3][-1]))
        return lambda u: ds.free_flight(u, flight), lambda y: ds.free_flight_pdf(y, flight)
    mixture = _mixture(case)
    return lambda u: mi.Float64(ds.sample_distance(u, mixture)[0]), lambda y: sum(
        ds.mixture_pdfs(y, mixture)
    )


def _edges(case, sample):
    """Return cells that hold about equal fractions of the samples and of the
    length, to the end of the span.
    """
    length = SPANS[case][2]
    fractions = np.array(
        sample(aligned_array(mi.Float64, np.arange(1, CELLS) / CELLS)), dtype=np.float64
    )
    return np.concatenate([[0.0], np.unique(fractions), [length]])


def _probabilities(edges, density):
    """Integrate a density over cells by the tanh-sinh rule, whose nodes crowd at the
    ends, where the peaks are.
    """
    step = 0.05
    k = step * np.arange(-80, 81)
    v = 1 / (1 + np.exp(-np.pi * np.sinh(k)))
    rest = 1 / (1 + np.exp(np.pi * np.sinh(k)))  # 1 - v without cancellation
    weight = step * np.pi * np.cosh(k) * v * rest
    low, high = edges[:-1, None], edges[1:, None]
    width = np.where(np.isinf(high), edges[-2] - edges[0], high - low)
    # An unbounded cell goes by y = low + width v/(1 - v).
    y = np.where(np.isinf(high), low + width * v / rest, low + width * v)
    jacobian = np.where(np.isinf(high), width / rest**2, width)
    values = np.array(density(aligned_array(mi.Float64, y.ravel())), dtype=np.float64).reshape(
        y.shape
    )
    return (values * jacobian * weight).sum(axis=1)


def _p_value(case, name, *, sample=None, density=None, seed=0):
    own_sample, own_density = _technique(case, name)
    sample, density = sample or own_sample, density or own_density
    edges = _edges(case, own_sample)
    expected = SAMPLES * _probabilities(edges, density)
    u = np.random.default_rng(seed).random(SAMPLES)
    y = np.array(sample(aligned_array(mi.Float64, u)), dtype=np.float64)
    assert y.min() >= 0
    observed = np.histogram(np.minimum(y, np.finfo(float).max), edges)[0]
    assert observed.sum() == SAMPLES
    assert expected.min() > 5  # Pearson's statistic needs that
    return chi2.sf(np.sum((observed - expected) ** 2 / expected), len(expected) - 1)


@pytest.mark.claim("sampled-distances", tolerance="chi-square, family level 1e-4")
@pytest.mark.parametrize("name", ["equi-angular", "free-flight", "mixture"])
def test_samples_follow_the_density(variant, name):
    """Rationale: chi-square tests of 14 spans, Sidak's level for all of them together
    is 1e-4 with fixed seeds.
    """
    level = 1 - (1 - 1e-4) ** (1 / len(SPANS))
    p_values = {case: _p_value(case, name, seed=number) for number, case in enumerate(SPANS)}
    assert min(p_values.values()) > level, p_values


@pytest.mark.claim("sampled-distances", tolerance="1e-8")
@pytest.mark.parametrize("case", SPANS)
@pytest.mark.parametrize("name", ["equi-angular", "free-flight", "mixture"])
def test_densities_integrate_to_one(variant, case, name):
    sample, density = _technique(case, name)
    total = _probabilities(_edges(case, sample), density).sum()
    # The integrals of the cells are good to 1e-9; a free flight is cut after 60 mean
    # free paths, worth 1e-26.
    assert total == pytest.approx(1, abs=1e-8)


def test_mixture_is_inverted(variant):
    """Rationale: the estimator divides by the mixture's density, so its distribution must
    be inverted to rounding.

    Setup: random spans over many orders of magnitude, unbounded ones among them.
    """

    rng = np.random.default_rng(5)
    n = 20000
    height = 10 ** rng.uniform(-2, 1.5, n)
    start = rng.choice([-1, 1], n) * 10 ** rng.uniform(-2, 2, n)
    length = np.where(rng.random(n) < 0.3, np.inf, 10 ** rng.uniform(-3, 2, n))
    mixture = mixture_of(
        Span(mi.Float64(height), mi.Float64(start), mi.Float64(length)),
        [mi.Float64(10 ** rng.uniform(-3, 1.3, n)) for _ in range(3)],
    )
    u = rng.random(n)
    y, _ = sample_distance(mi.Float64(u), mixture)
    # y has all its digits near the start of the span, s has them near the light; either
    # may be rounded elsewhere.
    errors = [
        np.abs(np.array(mixture_cdf(at, mixture)) - u)
        for at in (mi.Float64(y), mi.Float64(start + y) - mi.Float64(start))
    ]
    # Tolerance: single precision's rounding 6e-8 of y, times up to y pdf(y), at most about
    # 40 by the cut of flights.
    assert np.minimum(*errors).max() < 3e-6


def test_spots_cone_is_covered(variant):
    """Rationale: samples may fall beside a cone, never may the cone reach beyond the samples.

    Setup: random rays and cones; points on the ray inside the cone, by the angle to
    the axis in plain NumPy.
    """

    rng = np.random.default_rng(11)
    n = 400
    for cutoff_degrees in (0.5, 12.0, 40.0, 89.0, 90.0, 130.0):
        origin, direction, axis = rng.normal(size=(3, n, 3))
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        axis /= np.linalg.norm(axis, axis=1, keepdims=True)
        approach = closest_approach(
            mi.Point3d(origin.T), mi.Vector3d(direction.T), mi.Point3d(0, 0, 0)
        )
        cutoff = np.deg2rad(cutoff_degrees)
        ends = cone_ends(
            approach, mi.Vector3d(direction.T), axis=mi.Vector3d(axis.T), cutoff=cutoff
        )
        low, high = (np.broadcast_to(np.array(end, dtype=np.float64), n) for end in ends)
        foot = -np.sum(origin * direction, axis=1)
        x = np.linspace(-30, 30, 2001)
        point = origin[:, None] + x[:, None] * direction[:, None]
        cosine = np.sum(point * axis[:, None], axis=2) / np.linalg.norm(point, axis=2)
        inside = cosine > np.cos(cutoff)
        s = x - foot[:, None]
        assert np.all((s >= low[:, None]) & (s <= high[:, None]) | ~inside)
        if cutoff_degrees < 90:  # and the ends are not much too generous
            sampled = (s >= low[:, None]) & (s <= high[:, None])
            assert np.sum(sampled & ~inside) < 0.02 * inside.sum() + 5


@pytest.mark.claim("sampled-distances")
def test_sampled_distances_have_their_density(variant):
    """The mean of 1/density over the samples is the length; the density is
    below 1/(2 length) nowhere.
    """
    count = 4096
    u = mi.Float((np.arange(count) + 0.5) / count)
    for sigma_t in ([0.0], [1.3], [0.2, 3.0, 40.0]):
        y, density = (
            np.array(part, dtype=np.float64) for part in sample_stretch(u, mi.Float(1.7), sigma_t)
        )
        assert np.all((y >= 0) & (y <= 1.7000001))
        assert density.min() >= 0.5 / 1.7 * (1 - 1e-6)
        # The midpoint rule in u, whose integrand has a jump between the techniques: 1/count.
        assert np.mean(1 / density) == pytest.approx(1.7, rel=2e-3)
        assert np.mean(y**2 / density) == pytest.approx(1.7**3 / 3, rel=2e-3)
