# SPDX-License-Identifier: BSD-3-Clause
"""Legendre moments of phase functions, and those of the fit to droplets in closed form."""

from itertools import pairwise

import numpy as np

from airlight.analytic.phase import HgDraine


def hg_draine_moments(diameter: float, count: int):
    """Return the first Legendre moments of 'hg-draine' [1], (count,), for a
    diameter of droplets [um].

    hg has g^l. Twice c P_l = ((l + 1) P_{l+1} + l P_{l-1})/(2 l + 1) gives the moments of c^2 hg.
    """
    fit = HgDraine(diameter)
    order = np.arange(count)
    plain = fit.g_d ** np.arange(count + 2.0)
    once = ((order + 1) * plain[1 : count + 1] + order * np.append(0.0, plain)[:count]) / (
        2 * order + 1
    )
    wide = np.append(
        once, ((count + 1) * plain[count + 1] + count * plain[count - 1]) / (2 * count + 1)
    )
    twice = ((order + 1) * wide[1:] + order * np.append(0.0, once)[:count]) / (2 * order + 1)
    draine = (plain[:count] + fit.alpha * twice) / fit.norm
    return (1 - fit.weight) * fit.g_hg**order + fit.weight * draine


def legendre_moments(phase, count: int, *, breaks: tuple[float, ...] = (), degree: int = 400):
    """Return the first Legendre moments (1/2) int p P_l dcos of a phase function
    of the cosine, (count,).

    `breaks`: angles at which it jumps or has a kink [degrees]; `degree`: of a polynomial of the
    cosine that is as good as the function between the breaks.
    """
    edges = np.cos(np.deg2rad([180.0, *sorted(breaks, reverse=True), 0.0]))
    nodes, weights = np.polynomial.legendre.leggauss((degree + count) // 2 + 1)
    total = np.zeros(count)
    for low, high in pairwise(edges):
        cosines = low + 0.5 * (high - low) * (nodes + 1)
        values = 0.25 * (high - low) * weights * phase(cosines)
        total += values @ np.polynomial.legendre.legvander(cosines, count - 1)
    return total
