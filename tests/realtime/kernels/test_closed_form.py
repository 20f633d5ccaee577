# SPDX-License-Identifier: BSD-3-Clause
import csv

import numpy as np
import pytest

from realtime.errors import InputError
from tests.realtime.kernels.test_registry import evaluate

PHASES = ("isotropic", "rayleigh", "hazy", "murky")
ROUNDING = {"single": 2.0**-24, "double": 2.0**-53}
ONE = {"phase": "isotropic", "g": 0, "t": 1.3, "h": 0.7, "x0": 0.2, "x1": 3.1, "sigma_t": 0.43}


@pytest.fixture(scope="module")
def rows(data_folder):
    with open(data_folder / "airlight_integral.csv", newline="") as file:
        return list(csv.DictReader(file))


def column(rows, name):
    return np.array([float(row[name]) for row in rows])


def error_model(rows, precision):
    """Predict the relative error: rounding of the two tails and of their exponents, and the growth over powers of u."""
    from realtime.kernels.closed_form import closed_form

    near = evaluate(closed_form, [row | {"x1": "inf"} for row in rows], "double")
    finite = [row | {"x0": row["x1"] if row["x1"] != "inf" else "1e9", "x1": "inf"} for row in rows]
    beyond = evaluate(closed_form, finite, "double")
    x0, sigma_t, h = column(rows, "x0"), column(rows, "sigma_t"), column(rows, "h")
    depth = sigma_t * (x0 + np.hypot(h, x0 - column(rows, "t")))
    terms = (near + beyond) / column(rows, "value")
    return ROUNDING[precision] * terms * (1 + depth) * np.exp(0.5 * sigma_t * h)


@pytest.mark.parametrize(("precision", "bound"), [("single", 1e-5), ("double", 1e-13)])
def test_scaled_exponential_integral(variant, precision, bound):
    """Both regions and their border, against mpmath at the values that the kernel sees."""
    import mpmath

    from realtime.kernels.closed_form import scaled_e1
    from realtime.numerics.array_types import array_types

    types = array_types(precision)
    magnitude = np.concatenate([np.logspace(-6, 3, 40), np.linspace(0.7, 2.4, 60)])
    e = np.resize([0.0, 0.03, 0.4, 1.0, 2.7, 31.0, 1e3, 1e6], magnitude.size)
    e, a = types.scalar(e), types.scalar(magnitude / np.hypot(e, 1))
    real, imaginary = (np.array(part, dtype=np.float64) for part in scaled_e1(e, a))
    with mpmath.workdps(30):
        z = [mpmath.mpc(mpmath.mpf(p) * mpmath.mpf(q), -q) for p, q in zip(np.array(e).tolist(), np.array(a).tolist())]
        expected = [mpmath.exp(value) * mpmath.e1(value) for value in z]
        assert max(abs(x - s.real) / abs(s) for x, s in zip(real.tolist(), expected)) < bound / 5
        assert max(abs(y / s.imag - 1) for y, s in zip(imaginary.tolist(), expected)) < bound


def test_exponential_integral_in_vacuum(variant):
    from realtime.kernels.closed_form import scaled_e1
    from realtime.numerics.array_types import array_types

    types = array_types("double")
    e = np.array([0.0, 0.3, 1.0, 7.0, 1e12])
    _, imaginary = scaled_e1(types.scalar(e), types.scalar(0))
    assert np.array(imaginary) == pytest.approx(np.arctan2(1, e), rel=1e-15)


# A few dozen roundings at most: of the path lengths, of 12 to 90 terms of E1, and of up to 32 steps of the recurrence.
@pytest.mark.claim("closed-form-cancels")
@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("precision", ["single", "double"])
def test_error_is_the_rounding_of_the_tails(variant, rows, phase, precision):
    from realtime.kernels.closed_form import closed_form

    chosen = [row for row in rows if row["phase"] == phase]
    values, expected = evaluate(closed_form, chosen, precision), column(chosen, "value")
    error = np.abs(values - expected) / np.maximum(expected, 1e-37)
    ratio = error / error_model(chosen, precision)
    assert np.isfinite(values).all()
    assert ratio.max() < (500 if phase in ("hazy", "murky") else 100), chosen[int(np.argmax(ratio))]
    # The model is no empty bound: half of the errors come within a factor of ten of it.
    assert 0.1 < np.median(ratio) < 10


@pytest.mark.claim("closed-form-cancels")
@pytest.mark.parametrize("phase", PHASES)
def test_accuracy_by_tag(variant, rows, phase):
    """Good for ordinary rays; nothing left in float32 of segments far before the light and of slivers."""
    from realtime.kernels.closed_form import closed_form

    chosen = [row for row in rows if row["phase"] == phase]
    tags, expected = np.array([row["tag"] for row in chosen]), column(chosen, "value")
    hard = np.isin(tags, ["beyond", "far", "sliver"])
    for precision, good, thick in (("single", 2e-4, 2e-3), ("double", 1e-11, 1e-11)):
        error = np.abs(evaluate(closed_form, chosen, precision) - expected) / np.maximum(expected, 1e-37)
        assert error[~hard & (tags != "thick")].max() < good
        assert error[tags == "thick"].max() < thick
        if precision == "single":
            assert all(error[tags == tag].max() > 0.03 for tag in ("beyond", "far", "sliver"))
        else:
            assert error[hard].max() < 1e-7


def test_powers_of_u_lose_the_predicted_digits_in_thick_media(variant):
    """Degree 32 at a = sigma_t h: fine up to about 20, then worse like exp(a/2), against 128 quadrature nodes."""
    from realtime.kernels.closed_form import closed_form
    from realtime.kernels.quadrature import quadrature

    depth = np.array([1.0, 10.0, 20.0, 60.0])
    rows = [ONE | {"phase": "murky", "t": 0.3 * a, "h": a, "x0": 0, "x1": "inf", "sigma_t": 1.0} for a in depth]
    truth = evaluate(quadrature, rows, "double", nodes=128)
    single, double = (np.abs(evaluate(closed_form, rows, p) / truth - 1) for p in ("single", "double"))
    assert single[:2].max() < 1e-5
    assert double[:3].max() < 1e-12  # the truth's own error is 1e-13
    assert single[3] > 1
    assert 1e-6 < double[3] < 0.1


@pytest.mark.parametrize("precision", ["single", "double"])
def test_limits(variant, precision):
    from scipy.integrate import quad

    from realtime.kernels.closed_form import closed_form

    beyond = ONE | {"h": 0.0, "t": -0.5}
    expected, _ = quad(lambda x: np.exp(-0.43 * (x + x + 0.5)) / (x + 0.5) ** 2, 0.2, 3.1)
    assert evaluate(closed_form, [beyond], precision)[0] == pytest.approx(expected, rel=1e-5)
    angle = (np.arctan2(3.1 - 1.3, 0.7) - np.arctan2(0.2 - 1.3, 0.7)) / 0.7
    assert evaluate(closed_form, [ONE | {"sigma_t": 0.0}], precision)[0] == pytest.approx(angle, rel=1e-6)
    assert evaluate(closed_form, [ONE | {"x1": ONE["x0"]}], precision)[0] == 0


@pytest.mark.claim("refused-phase-functions")
def test_refuses_what_has_no_closed_form(variant):
    from realtime.kernels.closed_form import closed_form
    from realtime.scene.lights import Light

    with pytest.raises(InputError, match="kernel closed-form: phase function 'hg' is no polynomial"):
        evaluate(closed_form, [ONE | {"phase": "hg", "g": 0.3}], "single")

    def with_soft_spot(geometry, x0, x1, medium, light):
        return closed_form(geometry, x0, x1, medium, Light(None, None, cone=1, beam=1))

    with pytest.raises(InputError, match="kernel closed-form: a spot that falls off"):
        evaluate(with_soft_spot, [ONE], "single")


def test_renders_in_colour_like_the_quadrature(variant):
    import mitsuba as mi

    from realtime.frame.renderer import frame_renderer, render_frame
    from realtime.kernels.closed_form import closed_form
    from realtime.kernels.quadrature import quadrature
    from realtime.methods.registry import METHODS
    from realtime.scene.read_scene import read_scene
    from tests.helpers.scenes import tiny_scene

    fog = {
        "type": "homogeneous",
        "id": "fog",
        "sigma_t": {"type": "rgb", "value": [0.1, 0.4, 0.9]},
        "albedo": 0.8,
        "phase": {"type": "rayleigh"},
    }
    scene = read_scene(mi.load_dict(tiny_scene(fog=fog)), "double")
    closed, summed = (
        render_frame(frame_renderer(scene, METHODS["unshadowed"], kernel=kernel)).airlight
        for kernel in (closed_form, quadrature)
    )
    assert closed == pytest.approx(summed, rel=2e-5)  # sixteen nodes
