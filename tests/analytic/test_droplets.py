# SPDX-License-Identifier: BSD-3-Clause
"""The droplets of clouds and fog: their extinction, phase functions and moments, full and modified."""

import numpy as np
import pytest
from scipy.special import roots_legendre

from analytic.droplets import Droplets, Modified, optics
from analytic.errors import InputError
from analytic.mie import efficiencies
from tests.helpers.hg_draine import legendre_moments

_SMALL = Droplets(2.0, 8.0)  # as quick as allowed


@pytest.mark.claim("droplets-figures", tolerance="0.001 each")
def test_the_droplets_of_clouds_at_055_um():
    green = optics()
    assert green.q_extinction == pytest.approx(2.1416, abs=0.001)
    assert green.g == pytest.approx(0.8495, abs=0.001)
    assert green.share(0, 5) == pytest.approx(0.444, abs=0.001)
    assert green.share(0, 90) == pytest.approx(0.9576, abs=0.001)
    assert green.extinction == pytest.approx(0.0363, abs=1e-4)
    assert green.mean_free_path == pytest.approx(27.5, abs=0.05)
    assert green.printed_extinction == pytest.approx(0.0452, abs=1e-4)


def test_an_average_is_over_single_spheres():
    found = optics(_SMALL, sizes=50)
    radius, weight = _SMALL.nodes(50)
    single = efficiencies(2 * np.pi * radius / 0.55, 1.333)
    assert found.q_extinction == pytest.approx(weight @ single.extinction, rel=1e-12)
    assert found.q_scattering == pytest.approx(found.q_extinction, rel=1e-10)
    # g, which comes from angles, is that of the efficiencies, which comes from products of coefficients.
    assert found.g == pytest.approx(weight @ (single.scattering * single.g) / found.q_scattering, rel=1e-10)


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
    # As much light as before is scattered outside of the peak, by a density that is lowered by what is cut.
    assert (1 - cut.removed) * cut(np.array([0.3])) == pytest.approx(full(np.array([0.3])), rel=1e-9)


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
