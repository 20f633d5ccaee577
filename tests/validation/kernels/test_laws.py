# SPDX-License-Identifier: BSD-3-Clause
"""The laws hold for the truth and are found broken where a kernel breaks them."""

import numpy as np
import pytest

from validation.kernels.laws import laws
from validation.kernels.rays import hard_rays
from validation.kernels.values import take


def by_name(function, *names, phases=("isotropic", "hg")):
    """Laws on rays of two phase functions: a kernel is traced anew for each."""
    rays = hard_rays(768)
    chosen = take(rays, np.isin(rays.phase, phases))
    return {law.name: law for law in laws(function, chosen, names or None)}


def accurate(geometry, x0, x1, medium, light):
    from realtime.kernels.quadrature import quadrature

    return quadrature(geometry, x0, x1, medium, light, nodes=16)


@pytest.mark.claim("laws-of-the-integral", tolerance="2e-5 in float32, 1e-13 in float64")
def test_laws_hold_for_an_accurate_kernel(variant):
    law = by_name(accurate)
    assert law["unit scaling"].single == law["unit scaling"].double == 0
    assert law["intensity"].single == law["intensity"].double == 0
    # Rounding of exponents up to 60 and of sums: some hundred units.
    for name in ("camera shift", "phase"):
        assert law[name].single < 2e-5, name
        assert law[name].double < 1e-13, name
    # Seen from 5 directions of the camera and of the light, where nothing is alike but the sum.
    assert law["swap"].rows == 30
    assert law["swap"].single < 2e-6
    assert law["swap"].double < 1e-13
    # What is left are the kinks of the table and lobes sharper than the nodes, not rounding.
    assert law["additivity"].double < 0.02
    assert min(outcome.rows for outcome in law.values()) >= 30


def test_absolute_epsilon_breaks_unit_scaling(variant):
    def guarded(geometry, x0, x1, medium, light):
        from dataclasses import replace

        return accurate(replace(geometry, height=geometry.height + 1e-4), x0, x1, medium, light)

    law = by_name(guarded, "unit scaling", "intensity")
    assert law["unit scaling"].single > 0.1
    assert law["intensity"].single == 0


def test_intensity_in_the_kernel_is_found(variant):
    def bright(geometry, x0, x1, medium, light):
        return accurate(geometry, x0, x1, medium, light) * light.intensity.x

    # 37 against 1: they differ by 36/37 of the larger.
    assert by_name(bright, "intensity")["intensity"].double == pytest.approx(36 / 37)


def test_lost_extinction_of_one_leg_breaks_the_swap_and_the_shift(variant):
    def one_leg(geometry, x0, x1, medium, light):
        import drjit as dr

        return accurate(geometry, x0, x1, medium, light) * dr.exp(medium.sigma_t[0] * x0)

    law = by_name(one_leg, "camera shift", "swap", "intensity")
    assert law["camera shift"].double > 0.1
    assert law["swap"].double > 0.01
    assert law["intensity"].double == 0


def test_overlapping_segments_break_additivity(variant):
    def longer(geometry, x0, x1, medium, light):
        return accurate(geometry, 0.9 * x0, x1, medium, light)

    assert by_name(longer, "additivity")["additivity"].double > 0.05


def test_lobe_of_the_wrong_g_is_found(variant):
    def always_forward(geometry, x0, x1, medium, light):
        from dataclasses import replace

        import drjit as dr

        if medium.phase.name == "hg":
            phase = replace(medium.phase, g=dr.abs(medium.phase.g) + 0.1)
            medium = replace(medium, phase=phase)
        return accurate(geometry, x0, x1, medium, light)

    law = by_name(always_forward, "reversal", "same phase")
    assert law["reversal"].double > 0.01
    assert law["same phase"].double > 0.01


def test_not_a_number_on_one_side_is_an_infinite_deviation(variant):
    def picky(geometry, x0, x1, medium, light):
        import drjit as dr

        return dr.select(x0 > 0, dr.nan, accurate(geometry, x0, x1, medium, light))

    assert by_name(picky, "additivity")["additivity"].double == float("inf")


def test_refused_phase_functions_leave_their_laws_open(variant):
    from realtime.kernels.taylor import taylor

    law = by_name(taylor, "phase", "same phase")
    assert (law["phase"].rows, law["phase"].single, law["phase"].double) == (0, None, None)
    assert law["same phase"].rows > 0


@pytest.mark.claim("laws-of-the-integral", tolerance="3e-5 in float32")
def test_laws_hold_in_fog_of_droplets(variant):
    from realtime.kernels.exact import exact
    from validation.kernels.rays import wide_rays

    for words in ("mie:2:8", "hg-draine:12"):
        names = ("unit scaling", "additivity", "camera shift", "intensity")
        law = {law.name: law for law in laws(exact, wide_rays(256, words, truth=False), names)}
        assert law["unit scaling"].single == law["intensity"].single == 0
        for name in ("additivity", "camera shift"):
            assert law[name].rows > 100
            assert law[name].single < 3e-5, (words, name)
