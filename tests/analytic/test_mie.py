# SPDX-License-Identifier: BSD-3-Clause
"""Mie's theory meets published efficiencies, another program, and energy balance."""

import numpy as np
import pytest

from analytic.errors import InputError
from analytic.mie import angular_functions, coefficients, efficiencies, intensities


@pytest.mark.claim("mie-published", tolerance="1e-6, the digits that are printed")
@pytest.mark.parametrize(
    ("size", "index", "extinction", "scattering"),
    [
        (100, 1.33 + 1e-5j, 2.101321, 2.096594),  # Wiscombe 1979
        (1e4, 1.33 + 1e-5j, 2.004089, 1.723857),
        (10, 0.75, 2.232265, 2.232265),
    ],
)
def test_published_efficiencies(size, index, extinction, scattering):
    found = efficiencies(size, index)
    assert found.extinction[0] == pytest.approx(extinction, abs=1e-6)
    assert found.scattering[0] == pytest.approx(scattering, abs=1e-6)


@pytest.mark.claim("mie-miepython", tolerance="1e-7 relative: both leave out terms of 1e-8")
def test_another_program_says_the_same():
    miepython = pytest.importorskip("miepython", reason="the extra `test` has it")
    sizes = np.array([0.1, 1.7, 7.9, 8.1, 68.5, 431.0, 4199.0, 4201.0])
    cos_scatter = np.cos(np.linspace(0.0, np.pi, 41))
    for index in (1.333 + 0j, 1.5 + 0.01j, 0.75 + 0j):
        found = efficiencies(sizes, index)
        ours = np.stack([found.extinction, found.scattering, found.back, found.g])
        theirs = np.array([miepython.efficiencies_mx(index.conjugate(), size) for size in sizes]).T
        # Back scattering of a tiny sphere is what two sums leave of one another.
        assert ours == pytest.approx(theirs, rel=1e-7, abs=3e-8)
    a, b = coefficients(68.5, 1.333)
    ours = intensities(a, b, *angular_functions(cos_scatter, len(a)))[0]
    scattered = 68.5**2 * efficiencies(68.5, 1.333).scattering[0]
    theirs = 4 * np.pi * miepython.i_unpolarized(1.333 - 0j, 68.5, cos_scatter, norm="one")
    assert 2 * ours / scattered == pytest.approx(theirs, rel=1e-6)


def test_a_sphere_without_absorption_scatters_all_that_it_takes():
    sizes = np.geomspace(0.05, 1000, 40)
    found = efficiencies(sizes, 1.333)
    assert found.scattering == pytest.approx(found.extinction, rel=1e-10)


@pytest.mark.parametrize(
    ("size", "index", "words"),
    [(0, 1.3, "size"), (3e4, 1.3, "size"), (5, 1.3 - 0.1j, "absorption"), (5, 1, "not 1"), (5, -1.3, "n > 0")],
)
def test_wrong_input_is_refused(size, index, words):
    with pytest.raises(InputError, match=words):
        efficiencies(size, index)
