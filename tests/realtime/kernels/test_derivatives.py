# SPDX-License-Identifier: BSD-3-Clause
"""Claim: derivatives of the default kernel are right by all its inputs,
and what has none says so.
"""

import csv

import drjit as dr
import numpy as np
import pytest

from airlight.analytic.phase import HenyeyGreenstein
from airlight.errors import InputError
from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.numerics.array_types import aligned_array, array_types
from airlight.realtime.rays import RayGeometry
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.medium import Homogeneous
from airlight.realtime.scene.phase import named_phase
from tests.evidence.certified.integral import SLOPES, certified_slopes, integrate_certified

PHASES = ("isotropic", "hg")


@pytest.fixture(scope="module")
def rows(data_folder):
    with (data_folder / "airlight_slopes.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def forward(kernel, phase, inputs, number, precision):
    """Return the derivative by one of foot, height, x0, x1, sigma_t and g,
    by Dr.Jit in forward mode.
    """
    types = array_types(precision)
    columns = [aligned_array(types.scalar, column) for column in inputs]
    dr.enable_grad(columns[number])
    foot, height, x0, x1, sigma_t, g = columns
    medium = Homogeneous(
        (sigma_t,),
        types.color(1),
        named_phase(phase, g=g if phase == "hg" else None, Float=types.scalar),
    )
    J = kernel(RayGeometry(foot, height, None, None), x0, x1, medium, Light(None, None))
    dr.forward(columns[number])
    return np.array(dr.grad(J), dtype=np.float64)


def test_certified_derivatives_are_those_of_the_integrand(rows):
    """By the ends they are the integrand; lengths times a factor and the extinction
    over it leave J times it.
    """
    place = foot, height, x0, x1, sigma_t = 1.25, 0.75, 0.0, 4.5, 0.5
    phase = HenyeyGreenstein(0.25)
    slopes = dict(zip(SLOPES, certified_slopes(*place, phase), strict=True))
    for name, x, sign in (("x0", x0, -1), ("x1", x1, 1)):
        r = np.hypot(x - foot, height)
        integrand = np.exp(-sigma_t * (x + r)) * phase(np.array((foot - x) / r)) / r**2
        assert float(slopes[name]) == pytest.approx(sign * float(integrand), rel=1e-12)
    value = float(integrate_certified(*place, phase, digits=17))
    scaled = sum(
        float(slopes[name]) * size for name, size in zip(SLOPES[:4], place[:4], strict=True)
    )
    assert scaled - sigma_t * float(slopes["sigma_t"]) == pytest.approx(-value, rel=1e-12)
    assert [sum(row["phase"] == name for row in rows) for name in PHASES] == [10, 30]


@pytest.mark.claim("kernel-slopes", tolerance="1e-4, 1e-8")
@pytest.mark.parametrize("phase", PHASES)
def test_derivatives_of_the_default_are_exact(variant, rows, phase):
    """Relative to the derivative, or to 0.1 J over the size of what it is by, where that is more.

    A derivative that passes 0 says nothing of the digits of what goes into it.
    """
    own = [row for row in rows if row["phase"] == phase]
    inputs = np.array(
        [[float(row[name]) for row in own] for name in ("t", "h", "x0", "x1", "sigma_t", "g")]
    )
    value = np.array([float(row["value"]) for row in own])
    for number, name in enumerate(SLOPES if phase == "hg" else SLOPES[:-1]):
        slopes = np.array([float(row[f"d{name}"]) for row in own])
        size = np.maximum(np.abs(inputs[number]), 1e-3)
        scale = np.maximum(np.abs(slopes), 0.1 * value / size)
        # Limits of float32 and float64 derivatives; found: 4e-6 and 4e-15.
        for precision, limit in (("single", 1e-4), ("double", 1e-8)):
            found = forward(KERNELS["exact"].function, phase, inputs, number, precision)
            assert np.max(np.abs(found - slopes) / scale) < limit, (name, precision)


def test_a_table_has_no_derivative_and_says_so(variant):
    """Its values are piecewise bilinear: the derivatives that Dr.Jit would return
    are those of the pieces.
    """
    inputs = np.array([[1.25], [0.75], [0.0], [4.5], [0.5], [0.0]])
    with pytest.raises(InputError, match=r"no derivative.*use the kernel 'exact'"):
        forward(KERNELS["table"].function, "isotropic", inputs, 4, "single")
