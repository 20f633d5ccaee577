# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the functions that Bouthors 2008 fits find themselves again in
light that has their form.
"""

import drjit as dr
import numpy as np
import pytest

from airlight.realtime.clouds.canonical import coordinates
from airlight.realtime.clouds.canonical.coordinates import SETS
from airlight.realtime.numerics.array_types import array_types
from airlight.validation.papers import fitted_transport
from airlight.validation.papers.fitted_transport import fit_radiance

THICKNESSES, DIRECTIONS = 4, 5


def printed(number, t, d, mu, cos_phi, sin_phi, mu_l, *, of=dr):
    """Return a T of the form of Bouthors 2008, section 5.2, with our own numbers and
    depths in fractions of t.

    A bell at a depth that does not shrink with t is beyond thin slabs, where
    nothing of it is left to fit.
    """
    b, shift = (0.4 + 0.1 * mu - 0.05 * mu_l) * t, 2.3 + 0.2 * mu
    bell = of.exp(-0.5 * ((d - b) / (0.6 * t)) ** 2)
    return ((0.7 + 0.2 * mu) * mu_l * of.log(d + shift) / of.log(b + shift) * bell,)


@pytest.mark.slow
def test_light_of_the_printed_form_is_fitted_by_itself(variant, monkeypatch):
    """The functions, fitted and looked up, at entries of their tables: between
    these they are interpolated.

    In 12 evaluations a fit ends within some thousandths: a tenth of the 10 to 30 % by which
    the form misses real light.
    """
    for name, value in (
        ("SETS", SETS[:2]),
        ("_THICKNESSES", THICKNESSES),
        ("_DIRECTIONS", DIRECTIONS),
    ):
        monkeypatch.setattr(fitted_transport, name, value)
    fitted, random = fit_radiance(printed, array_types()), np.random.default_rng(3)
    mu = fitted_transport._directions(DIRECTIONS)
    for functions in fitted:
        found, expected = [], []
        for t in coordinates.thicknesses(THICKNESSES):
            for mu_l in coordinates.suns(5):
                for d in t * random.uniform(0, 1, 20):
                    found.append(functions(t, d, mu, mu_l))
                    expected += printed(0, t, d, mu, 1.0, 0.0, mu_l, of=np)
        found, expected = np.array(found), np.array(expected)
        lit = expected > 0.02 * expected.max()
        assert np.percentile(np.abs(found[lit] / expected[lit] - 1), 95) < 0.02
