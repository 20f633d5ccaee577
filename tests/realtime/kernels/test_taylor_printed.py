# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest

from analytic.phase import PhaseFunction
from analytic.series import taylor_coefficients
from realtime.errors import InputError
from realtime.kernels.taylor import taylor
from realtime.kernels.taylor_printed import PRINTED_PHASES, printed_coefficients, taylor_printed

N = 2147483673

#: What the print has too much, before e^-a and before the division by the mean: DESIGN section 3, printed - derived.
EXCESS = {
    ("isotropic", 2): lambda a: (a**2 - a) / 2,
    ("isotropic", 3): lambda a: -2 * a / 3,
    ("rayleigh", 2): lambda a: 3 * a / 8,
    ("hazy", 1): lambda a: np.full_like(a, 9 / 36 + 9 / 32),
    ("hazy", 2): lambda a: 265 * a**2 / 512,
    ("murky", 1): lambda a: 2 * N * a / 2**31 - 25 / 367108864 + 25 / 67108864,
}
MEANS = {"isotropic": 1.0, "rayleigh": 1.0, "hazy": 2.0, "murky": 83 / 33}
A = np.array([0.0, 1e-3, 0.13, 0.7, 2.9])


def rays(precision):
    """Return 200 rays near the foot and their medium, phase function left out, and NumPy's copy of the columns."""
    from realtime.numerics.array_types import array_types
    from realtime.rays.ray_light import RayGeometry

    types = array_types(precision)
    rng = np.random.default_rng(2)
    foot, height, sigma_t = rng.uniform(0.3, 3, 200), rng.uniform(0.2, 2, 200), rng.uniform(0, 1, 200)
    x0 = foot + height * rng.uniform(-1.2, 0.2, 200)
    x1 = x0 + height * rng.uniform(0.01, 1, 200)
    arrays = [types.scalar(column) for column in (foot, height, x0, x1, sigma_t)]
    return types, RayGeometry(arrays[0], arrays[1], None, None), arrays[2:], (foot, height, x0, x1, sigma_t)


def run(kernel, name, precision, **parameters):
    from realtime.scene.lights import Light
    from realtime.scene.medium import Medium
    from realtime.scene.phase import named_phase

    types, geometry, (x0, x1, sigma_t), _ = rays(precision)
    medium = Medium((sigma_t,), types.color(1), named_phase(name, g=0.3 if name == "hg" else None))
    light = Light(None, None)
    return np.array(kernel(geometry, x0, x1, medium, light, **parameters), dtype=np.float64)


@pytest.mark.claim("errata-of-biri", tolerance="1e-12 relative")
@pytest.mark.parametrize("name", PRINTED_PHASES)
def test_printed_coefficients_differ_from_derived_ones_as_listed_and_nowhere_else(name):
    printed = printed_coefficients(A, name)
    derived = taylor_coefficients(A, PhaseFunction(name), 4)
    assert len(printed) == (5 if name == "isotropic" else 3)
    for n, column in enumerate(printed):
        excess = EXCESS.get((name, n), np.zeros_like)(A) / MEANS[name]
        # rounding of sums of terms up to a^4
        np.testing.assert_allclose(column - derived[:, n], excess, rtol=1e-12, atol=1e-15 * 100)


@pytest.mark.parametrize(("name", "degree"), [("isotropic", 1), ("rayleigh", 1), ("hazy", 0), ("murky", 0)])
def test_equals_taylor_up_to_the_first_misprint(variant, name, degree):
    for precision, tolerance in (("single", 1e-6), ("double", 1e-14)):  # a dozen roundings
        printed, derived = (run(k, name, precision, degree=degree) for k in (taylor_printed, taylor))
        np.testing.assert_allclose(printed, derived, rtol=tolerance)


@pytest.mark.parametrize("name", PRINTED_PHASES)
def test_differs_from_taylor_by_the_integral_of_the_misprints(variant, name):
    foot, height, x0, x1, sigma_t = rays("double")[3]
    a, low, high = sigma_t * height, np.arctan2(x0 - foot, height), np.arctan2(x1 - foot, height)
    terms = [f(a) * (high ** (n + 1) - low ** (n + 1)) / (n + 1) for (p, n), f in EXCESS.items() if p == name]
    expected = sum(terms) * np.exp(-sigma_t * foot - a) / height / MEANS[name]
    difference = run(taylor_printed, name, "double") - run(taylor, name, "double")
    # differences of numbers of order 1, whose rounding is 1e-16
    np.testing.assert_allclose(difference, expected, rtol=1e-11, atol=1e-14)
    assert np.max(np.abs(difference)) > 1e-2


def test_a_colour_is_three_grey_media(variant):
    from realtime.scene.lights import Light
    from realtime.scene.medium import Medium
    from realtime.scene.phase import named_phase

    types, geometry, (x0, x1, _), _ = rays("single")
    extinctions = [types.scalar(v) for v in (0.1, 0.5, 0.9)]
    light, phase = Light(None, None), named_phase("hazy")
    colour = taylor_printed(geometry, x0, x1, Medium(tuple(extinctions), types.color(1), phase), light)
    for channel, sigma_t in zip(np.array(colour), extinctions):
        grey = taylor_printed(geometry, x0, x1, Medium((sigma_t,), types.color(1), phase), light)
        np.testing.assert_array_equal(channel, np.array(grey))


@pytest.mark.parametrize("name", ["hg", "tabulated"])
def test_refuses_what_the_annex_does_not_have(variant, name):
    with pytest.raises(InputError, match=f"prints no coefficients for the phase function '{name}'.*'taylor'"):
        run(taylor_printed, name, "single")


@pytest.mark.parametrize("degree", [-1, 5])
def test_refuses_other_degrees(variant, degree):
    with pytest.raises(InputError, match="degree: got"):
        run(taylor_printed, "isotropic", "single", degree=degree)
