# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the closed form is right to the rounding of its tails, whose difference cancels in segments far away."""

import mpmath
import numpy as np
import pytest
from scipy.integrate import quad

from analytic.cases import read_cases
from realtime.errors import InputError
from realtime.kernels.closed_form import closed_form, scaled_e1
from realtime.kernels.exact import exact
from realtime.numerics.aligned import aligned_array
from realtime.numerics.array_types import array_types
from realtime.scene.lights import Light
from tests.helpers.kernel_values import RAY, kernel_values, relative_error
from validation.kernels.values import take

pytestmark = pytest.mark.usefixtures("variant")

DEGREES = {"isotropic": 0, "rayleigh": 2, "hazy": 8, "murky": 32}
ROUNDING = {"single": 2.0**-24, "double": 2.0**-53}
E1 = {"single": 1e-5, "double": 1e-13}  #: relative error of the exponential integral, as `scaled_e1` states it


@pytest.fixture(scope="module", params=DEGREES)
def cases(request, data_folder):
    read = read_cases(data_folder / "airlight_integral.csv")
    return take(read, np.array(read.phase) == request.param)


def columns(cases):
    return cases.foot, cases.height, cases.x0, cases.x1, cases.sigma_t


@pytest.mark.parametrize("precision", ["single", "double"])
def test_scaled_exponential_integral(precision):
    """Both regions and their border, against mpmath at the values that the kernel sees; in a vacuum atan(1/e)."""
    Float = array_types(precision).scalar
    magnitude = np.concatenate([np.logspace(-6, 3, 40), np.linspace(0.7, 2.4, 60)])
    e = np.resize([0.0, 0.03, 0.4, 1.0, 2.7, 31.0, 1e3, 1e6], magnitude.size)
    e, a = aligned_array(Float, e), aligned_array(Float, magnitude / np.hypot(e, 1))
    real, imaginary = (np.array(part, dtype=np.float64) for part in scaled_e1(e, a))
    with mpmath.workdps(30):
        z = [mpmath.mpc(mpmath.mpf(p) * mpmath.mpf(q), -q) for p, q in zip(np.array(e).tolist(), np.array(a).tolist())]
        expected = [mpmath.exp(value) * mpmath.e1(value) for value in z]
        assert max(abs(x - s.real) / abs(s) for x, s in zip(real.tolist(), expected)) < E1[precision] / 5
        assert max(abs(y / s.imag - 1) for y, s in zip(imaginary.tolist(), expected)) < E1[precision]
    _, vacuum = scaled_e1(e, aligned_array(Float, np.zeros(100)))
    assert np.array(vacuum) == pytest.approx(np.arctan2(1, np.array(e)), rel=E1[precision])


@pytest.mark.claim("closed-form-cancels")
@pytest.mark.parametrize("precision", ["single", "double"])
def test_error_is_the_rounding_of_the_tails(cases, precision):
    """Each tail errs by its E1, by three roundings a step of the recurrence, and by those of its exponent.

    What u = 1/(1 + E^2) hands on grows like exp(a/2) with its powers, as the kernel derives.
    """
    foot, height, x0, x1, sigma_t = columns(cases)
    name, endless = cases.phase[0], np.full(len(foot), np.inf)
    starts = x0, np.where(np.isinf(x1), 1e9, x1)
    tails = [kernel_values(closed_form, (foot, height, x, endless, sigma_t), name, precision="double") for x in starts]
    depth = sigma_t * (x0 + np.hypot(height, x0 - foot))
    model = sum(tails) / cases.value * (1 + depth) * np.exp(0.5 * sigma_t * height)
    values = kernel_values(closed_form, columns(cases), name, precision=precision)
    assert np.isfinite(values).all()
    ratio = relative_error(values, cases.value) / model
    assert ratio.max() < E1[precision] + 3 * DEGREES[name] * ROUNDING[precision]
    # The model is no empty bound: half of the errors come within a factor of ten of one rounding of the tails.
    assert 0.1 < np.median(ratio) / ROUNDING[precision] < 10


@pytest.mark.claim("closed-form-cancels")
def test_accuracy_by_tag(cases):
    """Good for ordinary rays; nothing left in float32 of segments far before the light and of slivers."""
    tags, name = np.array(cases.tag), cases.phase[0]
    hard = np.isin(tags, ["beyond", "far", "sliver"])
    for precision, good, thick in (("single", 2e-4, 2e-3), ("double", 1e-11, 1e-11)):
        error = relative_error(kernel_values(closed_form, columns(cases), name, precision=precision), cases.value)
        assert error[~hard & (tags != "thick")].max() < good
        assert error[tags == "thick"].max() < thick
        if precision == "single":
            assert all(error[tags == tag].max() > 0.03 for tag in ("beyond", "far", "sliver"))
        else:
            assert error[hard].max() < 1e-7


def test_powers_of_u_lose_the_predicted_digits_in_thick_media():
    """Degree 32 at a = sigma_t h: fine up to about 20, then worse like exp(a/2)."""
    depth = np.array([1.0, 10.0, 20.0, 60.0])
    rays = (0.3 * depth, depth, 0.0, np.inf, 1.0)
    truth = kernel_values(exact, rays, "murky", precision="double")
    single, double = (
        np.abs(kernel_values(closed_form, rays, "murky", precision=p) / truth - 1) for p in ("single", "double")
    )
    assert single[:2].max() < 1e-5
    assert double[:3].max() < 1e-10  # the bar of the other kernel
    assert single[3] > 1
    assert 1e-6 < double[3] < 0.1


@pytest.mark.parametrize("precision", ["single", "double"])
def test_limits(precision):
    """Height 0 beyond the light, a vacuum, and no length."""
    foot, height, x0, x1, sigma_t = RAY
    expected, _ = quad(lambda x: np.exp(-sigma_t * (x + x + 0.5)) / (x + 0.5) ** 2, x0, x1)
    angle = (np.arctan2(x1 - foot, height) - np.arctan2(x0 - foot, height)) / height
    rays = ([-0.5, foot, foot], [0.0, height, height], x0, [x1, x1, x0], [sigma_t, 0.0, sigma_t])
    beyond, vacuum, nothing = kernel_values(closed_form, rays, precision=precision)
    assert beyond == pytest.approx(expected, rel=1e-5)
    assert vacuum == pytest.approx(angle, rel=1e-6)
    assert nothing == 0


@pytest.mark.claim("refused-phase-functions")
def test_what_has_no_closed_form_is_refused():
    with pytest.raises(InputError, match="kernel closed-form: phase function 'hg' is no polynomial"):
        kernel_values(closed_form, RAY, "hg", 0.3)

    def in_soft_spot(geometry, x0, x1, medium, light):
        return closed_form(geometry, x0, x1, medium, Light(None, None, cone=1, beam=1))

    with pytest.raises(InputError, match="kernel closed-form: a spot that falls off"):
        kernel_values(in_soft_spot, RAY)
