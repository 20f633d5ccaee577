# SPDX-License-Identifier: BSD-3-Clause
"""Derivatives of kernels in forward mode, against certified ones.

The errors are relative to the derivative, or to 0.1 J over the size of what it is by, where the derivative is smaller:
a derivative that passes 0 says nothing of the digits of what goes into it.
"""

import csv
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from analytic.certified import SLOPES
from analytic.errors import InputError
from realtime.errors import InputError as RealtimeInputError
from realtime.numerics.aligned import aligned_array
from realtime.numerics.array_types import array_types
from realtime.rays.ray_light import RayGeometry
from realtime.scene.lights import Light
from realtime.scene.medium import Medium
from realtime.scene.phase import named_phase
from validation.certified.files import certified_data
from validation.kernels.values import Kernel

Array = NDArray[np.float64]

_SMALL = 0.1
_LEAST = 1e-3  # size of what a derivative is by, at least [m, 1/m, 1]


@dataclass(frozen=True)
class SlopeCases:
    """Segments with certified derivatives, of one phase function."""

    phase: str
    inputs: Array  #: foot, height, x0, x1, sigma_t, g, (6, n)
    value: Array  #: J [1/m], (n,)
    slopes: Array  #: its derivatives, in this order, (6, n); NaN by g where there is none


@dataclass(frozen=True)
class SlopeErrors:
    """Errors of a kernel's derivatives by one of its inputs."""

    phase: str
    by: str  #: of `analytic.certified.SLOPES`
    single: float | None  #: largest in float32; None where the kernel refuses
    double: float | None  #: largest in float64


def certified_slope_cases() -> tuple[SlopeCases, ...]:
    """Return the certified derivatives."""
    with certified_data("airlight_slopes.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    cases = []
    for phase in dict.fromkeys(row["phase"] for row in rows):
        own = [row for row in rows if row["phase"] == phase]
        inputs = np.array([[float(row[name]) for row in own] for name in ("t", "h", "x0", "x1", "sigma_t", "g")])
        slopes = np.array([[float(row[f"d{name}"]) for row in own] for name in SLOPES])
        cases.append(SlopeCases(phase, inputs, np.array([float(row["value"]) for row in own]), slopes))
    return tuple(cases)


def slope_errors(function: Kernel, cases: SlopeCases) -> list[SlopeErrors]:
    """Return the errors of the derivatives of a kernel by all its inputs."""
    errors: list[SlopeErrors] = []
    for number, name in enumerate(SLOPES):
        if np.isnan(cases.slopes[number]).all():
            continue
        largest = [_largest(function, cases, number, precision) for precision in ("single", "double")]
        errors.append(SlopeErrors(cases.phase, name, *largest))
    return errors


def _largest(function: Kernel, cases: SlopeCases, number: int, precision: str) -> float | None:
    try:
        slope = forward_slope(function, cases, number, precision)
    except (InputError, RealtimeInputError):
        return None
    size = np.maximum(np.abs(cases.inputs[number]), _LEAST)
    error = np.abs(slope - cases.slopes[number]) / np.maximum(np.abs(cases.slopes[number]), _SMALL * cases.value / size)
    return float(error.max()) if np.isfinite(error).all() else float("inf")


def forward_slope(function: Kernel, cases: SlopeCases, number: int, precision: str) -> Array:
    """Return the derivatives of a kernel by one of its inputs, (n,), by Dr.Jit in forward mode."""
    types = array_types(precision)
    columns: list[Any] = [aligned_array(types.scalar, column) for column in cases.inputs]
    dr.enable_grad(columns[number])
    foot, height, x0, x1, sigma_t, g = columns
    phase = named_phase(cases.phase, g=g if cases.phase == "hg" else None, Float=types.scalar)
    medium = Medium((sigma_t,), types.color(1), phase)
    light = Light(types.vector(0), types.color(1))
    J = function(RayGeometry(foot, height, None, None), x0, x1, medium, light)
    if not dr.grad_enabled(J):
        return np.zeros(len(cases.value))
    dr.forward(columns[number])
    return np.resize(np.array(dr.grad(J), dtype=np.float64), len(cases.value))
