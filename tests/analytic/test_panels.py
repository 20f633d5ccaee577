# SPDX-License-Identifier: BSD-3-Clause
"""The airlight integral: every certified value, three forms, the laws, weights, shortened
shadow rays, hard corners.
"""

import itertools
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from airlight.analytic.geometry import foot_and_height
from airlight.analytic.panels import airlight_segments, log_distance
from airlight.analytic.phase import Hazy, HenyeyGreenstein, Isotropic, Murky, Rayleigh, Tabulated
from airlight.errors import InputError
from airlight.validation.kernels.case_files import integrate_cases, read_cases

ISOTROPIC = Isotropic()
PHASES = [
    ISOTROPIC,
    Rayleigh(),
    Murky(),
    HenyeyGreenstein(0.91),
    HenyeyGreenstein(-0.64),
    Tabulated([1.0, 0.0, 3.0, 0.2, 9.0]),
]


def worst_by_tag(cases, relative):
    tags = np.array(cases.tag if cases.tag is not None else ["ray"] * len(relative))
    return {str(tag): float(relative[tags == tag].max()) for tag in np.unique(tags)}


# Tolerances: the panels are right to rounding, of which the exponent, up to 70 in these files, has
# the largest fraction (1e-14); the rays add the rounding of the foot point, eps |light - origin|,
# times the steepness of the integrand.
@pytest.mark.claim(
    "integral-certified",
    tolerance="2e-14 relative, 1e-12 where rays are given as vectors; 1e-10 is asked for",
)
@pytest.mark.claim(
    "integral-tolerance",
    tolerance="2e-14 relative, 1e-12 where rays are given as vectors; 1e-10 is asked for",
)
@pytest.mark.parametrize(
    ("name", "tolerance"), [("airlight_integral.csv", 2e-14), ("airlight_integral_rays.csv", 1e-12)]
)
def test_every_certified_value(data_folder, name, tolerance):
    cases = read_cases(data_folder / name)
    assert (
        len(cases.phase)
        == {"airlight_integral.csv": 2004, "airlight_integral_rays.csv": 1002}[name]
    )
    value, error = integrate_cases(cases)
    relative = np.abs(value - cases.value) / cases.value
    assert relative.max() < tolerance, worst_by_tag(cases, relative)
    # the error estimate meets the tolerance asked for and covers the error (except for the
    # rounding of the geometry)
    assert (error <= 1.01e-10 * value).all()
    assert (
        np.abs(value - cases.value) <= error + (0 if "rays" not in name else tolerance * value)
    ).all()


@pytest.mark.claim("integral-tolerance", tolerance="the estimate itself")
def test_the_error_estimate_covers_the_error_at_loose_tolerances(data_folder):
    cases = read_cases(data_folder / "airlight_integral.csv")
    for rtol in (1e-2, 1e-5):
        value, error = integrate_cases(cases, rtol=rtol)
        assert (np.abs(value - cases.value) <= error).all()


lengths = st.floats(min_value=0.0, max_value=50.0)
positive = st.floats(min_value=1e-3, max_value=20.0)
segments = st.tuples(
    st.floats(min_value=-20.0, max_value=50.0),  # foot
    positive,  # height
    lengths,  # x0
    st.floats(min_value=1e-3, max_value=50.0),  # x1 - x0
    st.floats(min_value=0.0, max_value=5.0),  # sigma_t
    st.sampled_from(PHASES),
)


def close(a, b, *, relative=2e-10):
    """Equal to the sum of two tolerances of 1e-10."""
    return np.abs(a - b) <= relative * np.maximum(np.abs(a), np.abs(b))


@pytest.mark.claim("laws-of-the-integral", tolerance="the sum of the estimates")
@settings(deadline=None)
@given(segments, st.floats(min_value=0.01, max_value=0.99))
def test_segments_add_up(segment, fraction):
    foot, height, x0, length, sigma_t, phase = segment
    middle = x0 + fraction * length
    value, error = airlight_segments(
        foot,
        height,
        np.array([x0, x0, middle]),
        np.array([x0 + length, middle, x0 + length]),
        sigma_t,
        phase,
    )
    assert abs(value[0] - value[1] - value[2]) <= error.sum() + 1e-15 * value[0]


@pytest.mark.claim("laws-of-the-integral", tolerance="1e-9 relative")
@settings(deadline=None)
@given(segments, st.floats(min_value=-0.95, max_value=0.95))
def test_in_a_vacuum_a_ray_run_backwards_swaps_forward_and_backward(segment, g):
    foot, height, x0, length, _, _ = segment
    forward, _ = airlight_segments(foot, height, x0, x0 + length, 0.0, HenyeyGreenstein(g))
    mirrored = 2 * foot - x0
    backward, _ = airlight_segments(
        foot, height, mirrored - length, mirrored, 0.0, HenyeyGreenstein(-g)
    )
    # 2 foot - x0 - length is rounded, which moves the ends by an ulp of 150 in a
    # segment of 1e-3 at the least
    assert close(forward, backward, relative=1e-9)


@pytest.mark.parametrize("phase", PHASES, ids=str)
@pytest.mark.parametrize("shadow_scale", [0.0, 0.999, 1.0])
def test_shadow_scale_and_weight_against_plain_quadrature(phase, shadow_scale):
    foot, height, x0, x1, sigma_t = 2.3, 0.4, 0.5, 6.1, 0.7

    def profile(x):
        return 1 / (1 + 0.1 * x * x)

    def integrand(x):
        s = x - foot
        r = np.hypot(height, s)
        return np.exp(-sigma_t * (x + shadow_scale * r)) * float(phase(-s / r)) / r**2 * profile(x)

    kinks = [foot - height * c / np.sqrt(1 - c * c) for c in phase.kinks]
    ends = [x0, *sorted(k for k in [*kinks, foot] if x0 < k < x1), x1]
    expected = sum(
        quad(integrand, a, b, epsabs=0, epsrel=1e-11, limit=200)[0]
        for a, b in itertools.pairwise(ends)
    )
    value, error = airlight_segments(
        foot,
        height,
        x0,
        x1,
        sigma_t,
        phase,
        shadow_scale=shadow_scale,
        weight=lambda x, index: profile(x),
    )
    assert value[0] == pytest.approx(expected, rel=1e-10)  # both to 1e-11
    assert error[0] < 1.01e-10 * value[0]


def test_corners():
    through_light = {"foot": 5.0, "height": 0.0}
    empty, _ = airlight_segments(5.0, 0.0, 5.0, 5.0, 0.3, ISOTROPIC)
    assert empty.tolist() == [0.0]
    on_segment, error = airlight_segments(
        **through_light, x0=0.0, x1=9.0, sigma_t=0.3, phase=ISOTROPIC
    )
    assert np.isposinf(on_segment[0])
    assert np.isposinf(error[0])
    # before the light the path is `foot` all along: J = exp(-sigma_t foot) p(1) (1/1 - 1/5)
    before, _ = airlight_segments(**through_light, x0=0.0, x1=4.0, sigma_t=0.3, phase=Hazy())
    assert before[0] == pytest.approx(np.exp(-1.5) * 5.0 * 0.8, rel=1e-13)
    behind, _ = airlight_segments(**through_light, x0=6.0, x1=np.inf, sigma_t=0.3, phase=Hazy())
    # behind it the path is 2 x - foot, and light is scattered back
    expected, _ = quad(
        lambda x: np.exp(-0.3 * (2 * x - 5)) / (x - 5) ** 2, 6, np.inf, epsabs=0, epsrel=1e-11
    )
    assert behind[0] == pytest.approx(float(Hazy()(-1.0)) * expected, rel=1e-10)
    # a ray without end in a vacuum sees half the sphere of angles behind the foot, all of
    # it from far enough before
    unbounded, _ = airlight_segments(np.array([0.0, 1e9]), 1.0, 0.0, np.inf, 0.0, ISOTROPIC)
    np.testing.assert_allclose(unbounded, [np.pi / 2, np.pi - 1e-9], rtol=1e-12)
    # so thick that nothing is left: no NaN, no warning
    dark, error = airlight_segments(1e4, 1.0, 0.0, np.inf, 50.0, HenyeyGreenstein(-0.99))
    assert dark.tolist() == [0.0]
    assert np.isfinite(error).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"foot": np.nan}, "foot of row 0 is nan; expected a finite number"),
        ({"height": [1.0, -1.0]}, "height of row 1 is -1.0; expected a number >= 0"),
        ({"foot": [1.0, 2.0], "height": [1.0, 2.0, 3.0]}, "do not fit together"),
        ({"shadow_scale": 1.5}, "shadow_scale is 1.5; expected a number from 0 to 1"),
        ({"rtol": 1e-16}, "rtol is 1e-16"),
    ],
)
def test_refusals(change, message):
    arguments = {
        "foot": 1.0,
        "height": 1.0,
        "x0": 0.0,
        "x1": 2.0,
        "sigma_t": 0.1,
        "phase": ISOTROPIC,
    }
    with pytest.raises(InputError, match=message):
        airlight_segments(**(arguments | change))


# In the distance, the angle and the path ----------------------------------------------------------


FORM_PHASES = [
    Rayleigh(),
    Murky(),
    HenyeyGreenstein(-0.9),
    Tabulated([1.0, 0.0, 3.0, 0.2, 9.0]),
]


@pytest.mark.claim("integral-three-forms", tolerance="1e-10 relative")
@pytest.mark.parametrize("phase", FORM_PHASES, ids=lambda phase: phase.name)
def test_three_forms_are_one_integral(phase):
    rng = np.random.default_rng(17)
    for _ in range(6):
        foot, height, x0, length, sigma_t = rng.uniform((-2, 0.2, 0, 0.1, 0), (6, 2, 2, 8, 1))

        def distance(s, foot=foot, height=height, sigma_t=sigma_t):
            r = np.hypot(height, s)
            return np.exp(-sigma_t * (foot + s + r)) * phase(-s / r) / r**2

        def angle(theta, foot=foot, height=height, sigma_t=sigma_t):
            way = foot + height * np.tan(theta / 2 + np.pi / 4)
            return np.exp(-sigma_t * way) * phase(-np.sin(theta)) / height

        def path(q, foot=foot, height=height, sigma_t=sigma_t):
            cosine = (height**2 - q**2) / (height**2 + q**2)
            return np.exp(-sigma_t * (foot + q)) * phase(cosine) * 2 / (q**2 + height**2)

        # From x0 to the end, in pieces between which a table has its kinks.
        kinks = -height * phase.kinks / np.sqrt(1 - phase.kinks**2)
        s = np.clip(np.sort([x0 - foot, *kinks, x0 + length - foot]), x0 - foot, x0 + length - foot)
        forms = (distance, s), (angle, np.arctan(s / height)), (path, s + np.hypot(s, height))
        expected, _ = airlight_segments(foot, height, x0, x0 + length, sigma_t, phase)
        for form, ends in forms:
            pieces = [
                quad(form, a, b, epsabs=0, epsrel=1e-12)[0] for a, b in pairwise(ends) if b > a
            ]
            # The tolerance of the panels; the pieces are right to 1e-12.
            assert sum(pieces) == pytest.approx(expected[0], rel=1e-10)


# Geometry: no digits are lost close to the light --------------------------------------------------


EPSILON = np.finfo(float).eps


def float32_rays(count, miss):
    """Rays with float32 coordinates that pass a light at about the distance `miss`."""
    rng = np.random.default_rng(20061)
    origin = rng.uniform(-20, 20, (count, 3)).astype(np.float32)
    direction = rng.normal(size=(count, 3))
    direction = (direction / np.linalg.norm(direction, axis=1)[:, None]).astype(np.float32)
    light = origin + rng.uniform(1, 30, (count, 1)) * direction + miss * rng.normal(size=(count, 3))
    return origin.astype(float), direction.astype(float), light.astype(np.float32).astype(float)


@pytest.mark.parametrize("miss", [3.0, 1e-3, 0.0])
def test_foot_and_height_against_mpmath(miss):
    from mpmath import matrix, mp, mpf, workdps

    origin, direction, light = float32_rays(50, miss)
    foot, height = foot_and_height(origin, direction, light)
    for row in range(50):
        with workdps(60):
            o, d, p = (
                matrix([mpf(float(v)) for v in column[row]])
                for column in (origin, direction, light)
            )
            length = mp.norm(d)
            v = p - o
            along = (v.T * d)[0] / length
            across = mp.norm(v - d * (along / length))
            # The height is right to a few ulp however close the ray passes (light - origin is exact
            # for most float32 numbers, else it costs one rounding of the larger coordinate).
            slack = 8 * EPSILON * across + EPSILON * mp.norm(v)
            assert abs(mpf(float(height[row])) - across) <= slack
            assert abs(mpf(float(foot[row])) - along) <= 4 * EPSILON * mp.norm(v)


finite = st.floats(min_value=-1e3, max_value=1e3)
positive_heights = st.floats(min_value=1e-6, max_value=1e3)


@pytest.mark.claim("path-keeps-digits")
@given(x=finite, foot=finite, height=positive_heights)
def test_the_path_satisfies_its_equation(x, foot, height):
    s, q = x - foot, height * float(log_distance(*np.array([foot, height, x, x + 1]))[1])
    assert q > 0
    # (q - s)^2 = r^2 is where q came from; written as q^2 - 2 q s = h^2 and
    # scaled by its largest term
    assert abs(q * q - 2 * q * s - height**2) <= 12 * EPSILON * (q * q + 2 * abs(q * s) + height**2)


@pytest.mark.claim("path-keeps-digits", tolerance="6 roundings")
def test_the_path_does_not_cancel_before_the_light():
    from mpmath import mpf, sqrt, workdps

    with workdps(50):
        expected = float(mpf(-1000) + sqrt(mpf(1000) ** 2 + mpf(1e-4) ** 2))
    q = 1e-4 * float(log_distance(*np.array([1000.0, 1e-4, 0.0, 1.0]))[1])
    assert q == pytest.approx(expected, rel=6 * EPSILON)
