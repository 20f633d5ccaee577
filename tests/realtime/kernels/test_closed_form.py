# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the closed form is right to the rounding of its tails, whose difference cancels in segments far away."""

import mpmath
import numpy as np
import pytest

from realtime.kernels.closed_form import closed_form, scaled_e1
from realtime.numerics.array_types import aligned_array, array_types
from tests.helpers.kernel_values import kernel_values, relative_error, take
from validation.kernels.case_files import read_cases

pytestmark = pytest.mark.usefixtures("variant")

DEGREES = {"isotropic": 0, "rayleigh": 2, "hazy": 8, "murky": 32}
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
