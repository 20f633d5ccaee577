# SPDX-License-Identifier: BSD-3-Clause
import csv

import numpy as np
import pytest

from analytic.panels import airlight_segments
from analytic.phase import PhaseFunction
from realtime.errors import InputError
from realtime.kernels.polynomial import _nodes, polynomial
from realtime.numerics.aligned import aligned_array
from tests.helpers.ray_polynomial import _antiderivative, evaluate, evaluate_segment, polynomial_coefficients

PHASES = ("isotropic", "rayleigh", "hazy", "murky", "hg")
RAY = {"foot": 1.3, "height": 0.7, "x0": 0.0, "x1": 2.9, "sigma_t": 0.43}


@pytest.fixture(scope="module")
def rows(data_folder):
    with open(data_folder / "airlight_integral.csv", newline="") as file:
        return list(csv.DictReader(file))


def arguments(columns, phase="isotropic", precision="double", *, g=None, values=None, light=None):
    """Return the arguments of a kernel; `columns` holds foot, height, x0, x1, sigma_t (numbers or arrays)."""
    from realtime.numerics.array_types import array_types
    from realtime.rays.ray_light import RayGeometry
    from realtime.scene.lights import Light
    from realtime.scene.medium import Medium
    from realtime.scene.phase import named_phase

    types = array_types(precision)
    c = {key: aligned_array(types.scalar, np.atleast_1d(columns[key])) for key in RAY}
    phase = named_phase(
        phase, g=None if g is None else types.scalar(g), values=None if values is None else values(types)
    )
    medium = Medium((c["sigma_t"],), types.color(1), phase)
    geometry = RayGeometry(c["foot"], c["height"], None, None)
    return geometry, c["x0"], c["x1"], medium, light or Light(None, None)


def numbers(value):
    return np.array(value, dtype=np.float64)


def truth(*segment):
    return airlight_segments(*segment)[0].item()


def certified(rows, phase, precision):
    chosen = [row for row in rows if row["phase"] == phase]
    names = {"foot": "t", "height": "h", "x0": "x0", "x1": "x1", "sigma_t": "sigma_t"}
    columns = {key: [float(row[name]) for row in chosen] for key, name in names.items()}
    g = [float(row["g"]) for row in chosen] if phase == "hg" else None
    return arguments(columns, phase, precision, g=g), np.array([float(row["value"]) for row in chosen])


# Float32 at degree 63 is rounding alone: of the exponent, 6e-8 times an optical depth of up to 100, for every phase
# function and g up to 0.98. Degree 15 and float64 show the polynomial's own error; measured 4e-5 to 1.2e-2 and 2e-15 to
# 5e-8.
@pytest.mark.parametrize(
    ("precision", "degree", "bounds"),
    [
        ("single", 15, (6e-5, 5e-4, 5e-3, 2e-2, 6e-3)),
        ("single", 63, (4e-6, 4e-6, 4e-6, 4e-6, 4e-6)),
        ("double", 63, (1e-14, 2e-11, 5e-9, 1e-7, 1e-9)),
    ],
)
def test_certified_cases(variant, rows, precision, degree, bounds):
    for phase, bound in zip(PHASES, bounds):
        given, expected = certified(rows, phase, precision)
        value = numbers(polynomial(*given, degree=degree))
        # what float32 cannot hold is compared in absolute terms
        error = np.abs(value - expected) / np.maximum(expected, 1e-37)
        assert np.all(np.isfinite(value)), phase
        assert np.all(value >= 0), phase
        assert np.max(error) < bound, (phase, int(np.argmax(error)))


def test_keeps_up_with_gauss_at_moderate_accuracy(variant, rows):
    from realtime.kernels.quadrature import quadrature

    given, expected = certified(rows, "isotropic", "double")
    ours, gauss = (
        np.quantile(np.abs(numbers(value) / expected - 1), 0.99)
        for value in (polynomial(*given, degree=15), quadrature(*given, nodes=16))
    )
    assert gauss < ours < 40 * gauss  # measured: 3e-5 and 2e-6, the same 16 nodes each


def rho(width, start, singularity):
    """Return the parameter of the Bernstein ellipse through a singularity of the range [start, start + width]."""
    z = (singularity - start) / (width / 2) - 1
    return max(abs(z + np.sqrt(z * z - 1 + 0j)), abs(z - np.sqrt(z * z - 1 + 0j)))


@pytest.mark.claim("declared-orders")
@pytest.mark.parametrize("g", [0.0, 0.6, 0.9, -0.8])
def test_rate_of_convergence_is_the_declared_one(variant, g):
    """Errors of Gamma inside the range, in a vacuum, fall as rho^-N/(N + 1): a simple pole, integrated (g = 0).

    Henyey-Greenstein has two singularities of different strengths; the rate lies between theirs, for any g.
    """
    ray = {"foot": 1.7, "height": 0.9, "x0": 0.2, "x1": 30.0, "sigma_t": 0.0}
    inside = np.linspace(0.5, 29.0, 23)
    phase = PhaseFunction("hg", g=g)
    exact = airlight_segments(ray["foot"], ray["height"], ray["x0"], inside, 0.0, phase, rtol=1e-13)[0]
    given = arguments(ray, "hg", g=g)
    degrees = np.arange(6, 23, 2)
    errors = []
    for degree in degrees:
        fit = polynomial_coefficients(*given, degree=int(degree))
        value = numbers(evaluate(fit, type(given[1])(inside)))
        errors.append(np.max(np.abs(value - exact)) / exact[-1])
    measured = -np.polyfit(degrees, np.log(errors * (degrees + 1)), 1)[0]

    m, d = min(1.0, (1 - g) / (1 + g)), (1 - g) / (1 + g)
    ends = [(s + np.hypot(s, 0.9)) / 0.9 / m for s in (0.2 - 1.7, 30 - 1.7)]
    start, width = np.arcsinh(ends[0]), np.diff(np.arcsinh(ends))[0]
    singularities = [np.arccosh(v / m) + 0.5j * np.pi for v in (1.0, d)]
    declared = sorted(np.log(rho(width, start, w)) for w in singularities)
    if g == 0:
        assert measured == pytest.approx(declared[0], rel=0.03)  # nine degrees, whose signs vary
    else:
        # double poles and powers -3/2 leave a factor of N^(1/2) to N: 8 % of the slope over these degrees
        assert 0.92 * declared[0] < measured < 1.08 * declared[1]


def test_a_kernel_call_is_the_integral_of_its_polynomial(variant):
    for phase in ("isotropic", "hg"):
        given = arguments(RAY, phase, g=0.4 if phase == "hg" else None)
        for degree in (0, 1, 6, 9):
            fit = polynomial_coefficients(*given, degree=degree)
            whole = numbers(polynomial(*given, degree=degree))
            # the same sums in another order
            np.testing.assert_allclose(numbers(evaluate(fit, given[2])), whole, rtol=1e-13)
            parts = evaluate_segment(fit, given[1], 1.1) + evaluate_segment(fit, 1.1, given[2])
            np.testing.assert_allclose(numbers(parts), whole, rtol=1e-13)


def test_weights_and_antiderivatives_are_exact_for_polynomials():
    for degree in (0, 3, 8):
        points, weights = map(np.array, zip(*_nodes(degree)))
        for k in range(degree + 1):
            exact = 2 / (1 - k * k) if k % 2 == 0 else 0.0
            chebyshev = np.cos(k * np.arccos(points))
            assert weights @ chebyshev == pytest.approx(exact, abs=1e-14)  # int_{-1}^1 T_k
            antiderivative = np.polynomial.chebyshev.Chebyshev([0, *_antiderivative(list(chebyshev))])
            expected = np.polynomial.chebyshev.Chebyshev.basis(k).integ()
            y = np.linspace(-1, 1, 7)
            np.testing.assert_allclose(antiderivative(y) - antiderivative(-1), expected(y) - expected(-1), atol=1e-14)
        assert np.all(weights > 0)


def test_slivers_do_not_cancel_in_float32(variant):
    """Segments of 1e-6 of the range: the difference of two Gamma has few digits, the segment's own form all."""
    rng = np.random.default_rng(3)
    begin = rng.uniform(0.2, 2.6, 300).astype(np.float32).astype(np.float64)
    end = (begin + 3e-6).astype(np.float32).astype(np.float64)
    columns = {key: np.full(300, np.float32(value), dtype=np.float64) for key, value in RAY.items()}
    given = arguments(columns, "hazy", "single")
    fit = polynomial_coefficients(*given, degree=23)
    Float = type(given[1])
    expected = airlight_segments(
        columns["foot"], columns["height"], begin, end, columns["sigma_t"], PhaseFunction("hazy")
    )
    error = np.abs(numbers(evaluate_segment(fit, Float(begin), Float(end))) / expected[0] - 1)
    assert np.max(error) < 5e-6  # some thirty roundings of 6e-8
    difference = numbers(evaluate(fit, Float(end))) - numbers(evaluate(fit, Float(begin)))
    assert np.median(np.abs(difference / expected[0] - 1)) > 1e-3  # what the form avoids: the test's own test


def test_gamma_outside_its_range_stays(variant):
    fit = polynomial_coefficients(*arguments(RAY))
    assert numbers(evaluate(fit, -1.0)) == 0
    np.testing.assert_array_equal(numbers(evaluate(fit, 1e9)), numbers(evaluate(fit, RAY["x1"])))


def test_limits(variant):
    def value(precision="single", phase="isotropic", **changes):
        return float(numbers(polynomial(*arguments(RAY | changes, phase, precision), degree=31))[0])

    assert value(x0=1.0, x1=1.0) == 0
    assert value(foot=1.0, height=0.0, x0=1.0, x1=1.0) == 0
    assert value(foot=1.0, height=0.0) == np.inf
    assert value(foot=0.0, height=0.0) == np.inf  # the camera at the light
    # endless in a vacuum: (pi/2 - theta0)/h; 1e-7 of it lies beyond the reach
    assert value(sigma_t=0.0, x1=np.inf) == pytest.approx((np.pi / 2 + np.arctan2(1.3, 0.7)) / 0.7, rel=1e-6)
    for foot in (-0.5, 1.002, 1.7):  # the light behind the segment and before it, height 0
        expected = truth(foot, 0.0, 0.0, 1.0, 0.7, PhaseFunction("murky"))
        got = value(foot=foot, height=0.0, x1=1.0, sigma_t=0.7, phase="murky")
        assert got == pytest.approx(expected, rel=1e-4 if foot == 1.002 else 3e-6)  # 1.002 - 1: rounded input
    # an endless backward lobe in a vacuum: its tail begins beyond E = (1 - g)/(1 + g)
    given = arguments(RAY | {"sigma_t": 0.0, "x1": np.inf}, "hg", "single", g=-0.95)
    expected = truth(1.3, 0.7, 0.0, np.inf, 0.0, PhaseFunction("hg", g=-0.95))
    assert numbers(polynomial(*given, degree=47))[0] == pytest.approx(expected, rel=5e-6)


def soft_spot(precision):
    """Return rays across a spot whose intensity falls off from 20 to 50 degrees, and the spot."""
    from realtime.numerics.array_types import array_types
    from realtime.rays.ray_light import ray_geometry
    from realtime.scene.lights import Light, spot_fields

    types = array_types(precision)
    cutoff, beam = np.deg2rad(50.0), np.deg2rad(20.0)
    light = Light(
        types.vector(0.1, 0.2, 2.0),
        types.color(1),
        **spot_fields((0, 0, -1), cutoff, beam, types),
    )
    direction = np.array([[0.96, 0.8], [0.0, 0.48], [-0.28, -0.36]])
    return types, ray_geometry(types.vector(-2, 0, 1), types.vector(direction), light), light


@pytest.mark.parametrize("phase", ["isotropic", "hazy"])
def test_soft_spot(variant, phase):
    from scipy.integrate import quad

    from realtime.scene.medium import Medium
    from realtime.scene.phase import named_phase

    types, geometry, light = soft_spot("double")
    medium = Medium((types.scalar(0.4),), types.color(1), named_phase(phase))
    x0, x1 = geometry.lit_segment(types.scalar(0, 0), types.scalar(9, 9))
    value = numbers(polynomial(geometry, x0, x1, medium, light, degree=23))
    fit = polynomial_coefficients(geometry, x0, x1, medium, light, degree=23)
    np.testing.assert_allclose(numbers(evaluate(fit, x1)), value, rtol=1e-13)
    p, foot, height = PhaseFunction(phase), numbers(geometry.foot), numbers(geometry.height)
    axial, offset = numbers(geometry.axial), numbers(geometry.offset)
    for ray in range(2):

        def integrand(x, ray=ray):
            s = x - foot[ray]
            r = np.hypot(s, height[ray])
            angle = np.arccos((axial[ray] * s + offset[ray]) / r)
            weight = np.clip((np.deg2rad(50) - angle) / np.deg2rad(30), 0, 1)
            return weight * np.exp(-0.4 * (x + r)) * p(-s / r) / r**2

        low, high = numbers(x0)[ray], numbers(x1)[ray]
        assert high > low
        expected = quad(integrand, low, high, epsrel=1e-8)[0]
        assert value[ray] == pytest.approx(expected, rel=1e-6)  # smooth pieces
        middle = 0.6 * low + 0.4 * high
        part = numbers(evaluate_segment(fit, types.scalar(middle, middle), x1))[ray]
        assert part == pytest.approx(quad(integrand, middle, high, epsrel=1e-8)[0], rel=1e-6)


def test_tabulated_phase_function(variant):
    """A straight line has no kinks and converges as the others do; five values have three."""
    ray = RAY | {"x0": 0.4}
    for table, degree, bound in (([0.25, 1.75], 31, 1e-9), ([1.9, 0.7, 0.4, 0.8, 2.3], 63, 2e-3)):
        mean = np.trapezoid(table, dx=1 / (len(table) - 1))
        given = arguments(ray, "tabulated", values=lambda types, t=table, m=mean: types.scalar(np.array(t) / m))
        expected = truth(1.3, 0.7, 0.4, 2.9, 0.43, PhaseFunction("tabulated", table=table))
        assert numbers(polynomial(*given, degree=degree))[0] == pytest.approx(expected, rel=bound)


def test_a_colour_is_three_grey_media(variant):
    from realtime.scene.medium import Medium
    from realtime.scene.phase import named_phase

    geometry, x0, x1, grey, light = arguments(RAY)
    extinctions = [type(x0)(v) for v in (0.0, 0.5, 3.0)]
    medium = Medium(tuple(extinctions), grey.albedo, named_phase("rayleigh"))
    colour = numbers(polynomial(geometry, x0, x1, medium, light))
    gamma = numbers(evaluate(polynomial_coefficients(geometry, x0, x1, medium, light), x1))
    for channel, sigma_t in enumerate(extinctions):
        single = Medium((sigma_t,), grey.albedo, named_phase("rayleigh"))
        expected = numbers(polynomial(geometry, x0, x1, single, light))
        np.testing.assert_array_equal(colour[channel], expected)
        np.testing.assert_allclose(gamma[channel], expected, rtol=1e-13)


def test_replays_in_a_frozen_function(variant):
    import drjit as dr

    given = arguments({key: np.full(64, value) for key, value in RAY.items()}, "hg", "single", g=0.8)

    @dr.freeze
    def frozen(geometry, x0, x1, medium, light):
        fit = polynomial_coefficients(geometry, x0, x1, medium, light)
        return polynomial(geometry, x0, x1, medium, light), evaluate(fit, x1)

    for x1 in (given[2], 0.5 * given[2]):
        whole, gamma = frozen(*given[:2], x1, *given[3:])
        np.testing.assert_array_equal(numbers(whole), numbers(polynomial(*given[:2], x1, *given[3:])))
        np.testing.assert_allclose(numbers(gamma), numbers(whole), rtol=1e-6)  # rounding


def test_refuses_a_negative_degree(variant):
    with pytest.raises(InputError, match="degree: got -1"):
        polynomial(*arguments(RAY), degree=-1)
    with pytest.raises(InputError, match="degree: got -2"):
        polynomial_coefficients(*arguments(RAY), degree=-2)
