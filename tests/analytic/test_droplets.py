# SPDX-License-Identifier: BSD-3-Clause
"""Mie's theory and the droplets of clouds and fog: published values, another program,
moments, full and modified.
"""

import numpy as np
import pytest
from mpmath import workdps
from scipy.special import roots_legendre

from airlight.analytic.droplets import Droplets, Modified, optics
from airlight.analytic.mie import angular_functions, coefficients, efficiencies, intensities
from airlight.analytic.phase import HgDraine, phase_from_words
from airlight.errors import InputError
from airlight.validation.certified.files import certified_data
from airlight.validation.kernels.case_files import integrate_cases, read_cases
from tests.helpers.hg_draine import hg_draine_moments, legendre_moments


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
    [
        (0, 1.3, "size"),
        (3e4, 1.3, "size"),
        (5, 1.3 - 0.1j, "absorption"),
        (5, 1, "not 1"),
        (5, -1.3, "n > 0"),
    ],
)
def test_spheres_without_a_series_are_refused(size, index, words):
    with pytest.raises(InputError, match=words):
        efficiencies(size, index)


# Droplets -----------------------------------------------------------------------------------------


_SMALL = Droplets(2.0, 8.0)  # as quick as allowed


@pytest.mark.claim("droplets-figures", tolerance="0.001 each")
def test_the_droplets_of_clouds_at_055_um():
    green = optics()
    assert green.q_extinction == pytest.approx(2.1416, abs=0.001)
    assert green.g == pytest.approx(0.8495, abs=0.001)
    assert green.fraction(0, 5) == pytest.approx(0.444, abs=0.001)
    assert green.fraction(0, 90) == pytest.approx(0.9576, abs=0.001)
    assert green.extinction == pytest.approx(0.0363, abs=1e-4)
    assert green.mean_free_path == pytest.approx(27.5, abs=0.05)
    assert green.printed_extinction == pytest.approx(0.0452, abs=1e-4)


def test_an_average_is_over_single_spheres():
    found = optics(_SMALL, sizes=50)
    radius, weight = _SMALL.nodes(50)
    single = efficiencies(2 * np.pi * radius / 0.55, 1.333)
    assert found.q_extinction == pytest.approx(weight @ single.extinction, rel=1e-12)
    assert found.q_scattering == pytest.approx(found.q_extinction, rel=1e-10)
    # g, which comes from angles, is that of the efficiencies, which comes from
    # products of coefficients.
    assert found.g == pytest.approx(
        weight @ (single.scattering * single.g) / found.q_scattering, rel=1e-10
    )


def test_the_phase_function_has_mean_one_and_its_moments():
    found = optics(_SMALL)
    nodes, weights = roots_legendre(1000)  # NumPy's takes ten seconds
    assert 0.5 * weights @ found(nodes) == pytest.approx(1, abs=1e-9)
    assert legendre_moments(found, 12) == pytest.approx(found.moments(12), abs=1e-9)
    assert found(nodes) == pytest.approx(found.series(nodes), rel=1e-8)
    assert found.moments(2000).shape == (2000,)
    assert found.moments(2000)[-1] == 0


@pytest.mark.claim("droplets-modified", tolerance="1e-9: what is cut is what the density loses")
def test_what_is_cut_is_what_the_density_loses():
    full = optics()
    cut = Modified(full)
    nodes, weights = roots_legendre(2000)  # NumPy's takes ten seconds
    edge = np.cos(np.deg2rad(5))
    half = 0.5 * (edge + 1)
    assert 0.5 * half * weights @ cut(-1 + half * (nodes + 1)) == pytest.approx(1, abs=1e-9)
    assert cut(1.0) == 0
    assert cut.removed == pytest.approx(0.444, abs=0.001)
    # As much light as before is scattered outside of the peak, by a density that
    # is lowered by what is cut.
    assert (1 - cut.removed) * cut(np.array([0.3])) == pytest.approx(
        full(np.array([0.3])), rel=1e-9
    )


@pytest.mark.claim("droplets-refused")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"effective_radius": 1.9}, "effective radius is 1.9"),
        ({"gamma": 0}, "gamma"),
        ({"number": 0}, "number"),
    ],
)
def test_impossible_droplets_are_refused(arguments, words):
    with pytest.raises(InputError, match=words):
        Droplets(**arguments)


# Phase functions of droplets by their names -------------------------------------------------------


FILE = certified_data("airlight_integral_droplets.csv")


@pytest.mark.claim("hg-draine", tolerance="1e-8: quadrature across a peak of g = 0.99")
@pytest.mark.parametrize(
    "diameter", [12, *(pytest.param(d, marks=pytest.mark.slow) for d in (5, 23.5))]
)
def test_hg_draine_has_mean_one_and_its_moments(diameter):
    phase = HgDraine(diameter)
    expected = legendre_moments(phase, 8, breaks=(1.0, 10.0), degree=2000)
    assert expected[0] == pytest.approx(1, abs=1e-8)
    assert hg_draine_moments(diameter, 8) == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("words", ["hg-draine:5", "hg-draine:50", "mie:2:8", "mie-modified:2:8"])
def test_mpmath_twin_agrees(words):
    phase = phase_from_words(words)
    cosines = np.array([-1.0, -0.77, 0.0, 0.6, 0.99, 0.998, 1.0])
    with workdps(30):
        expected = [float(phase.mp(c)) for c in cosines]
    assert phase(cosines) == pytest.approx(expected, rel=2e-8, abs=1e-14)


@pytest.mark.claim(
    "droplets-certified", tolerance="3e-8 relative: of the spline through Mie's series"
)
def test_certified_values():
    cases = read_cases(FILE)
    found, _ = integrate_cases(cases)
    assert found == pytest.approx(cases.value, rel=3e-8)
    lobes = np.array([name.startswith("hg-draine") for name in cases.phase])
    assert found[lobes] == pytest.approx(cases.value[lobes], rel=1e-10)


@pytest.mark.claim("droplets-refused")
@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("mie:51", "effective radius"),
        ("mie:6:2:0.55:3", "at most 3 numbers"),
        ("hg-draine:4.9", "5 to 50 um"),
        ("me", "no phase function is called 'me'"),
    ],
)
def test_wrong_words_are_refused(words, message):
    with pytest.raises(InputError, match=message):
        phase_from_words(words)
