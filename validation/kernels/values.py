# SPDX-License-Identifier: BSD-3-Clause
"""Values of a kernel on tables of cases."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from analytic.cases import Cases
from analytic.errors import InputError
from realtime.errors import InputError as RealtimeInputError
from realtime.numerics.array_types import aligned_array, array_types
from realtime.rays.ray_light import RayGeometry, ray_geometry
from realtime.scene.lights import Light
from realtime.scene.media.homogeneous import Homogeneous
from realtime.scene.phase import named_phase

Array = NDArray[np.float64]
Kernel = Callable[..., Any]

#: The phase function of cases called 'tabulated': float32 numbers whose mean over the sphere is exactly 1.
TABLE = (0.5, 0.25, 0.25, 0.5, 0.5, 0.75, 1.0, 2.0, 5.0)


@dataclass(frozen=True)
class Values:
    """What a kernel gave for cases: NaN in the rows of phase functions that it refuses."""

    J: Array  #: (n,) [1/m]
    refused: dict[str, str]  #: phase function -> the kernel's words
    accepted: NDArray[np.bool_]  #: (n,) rows that the kernel did not refuse


def evaluate_cases(cases: Cases, function: Kernel, precision: str, **options: Any) -> Values:
    """Return J of every case whose phase function the kernel accepts, as `evaluate_rows` does."""
    names = np.asarray(cases.phase)
    results, accepted, refused = np.full(len(names), np.nan), np.ones(len(names), dtype=bool), {}
    for name in dict.fromkeys(cases.phase):
        rows = np.flatnonzero(names == name)
        try:
            results[rows] = evaluate_rows(cases, rows, function, precision, **options)
        except (InputError, RealtimeInputError) as reason:
            refused[name] = str(reason)
            accepted[rows] = False
    return Values(results, refused, accepted)


def evaluate_rows(
    cases: Cases,
    rows: NDArray[np.int64],
    function: Kernel,
    precision: str,
    *,
    table: ArrayLike = TABLE,
    intensity: float = 1.0,
) -> Array:
    """Return J of cases that share a phase function, (rows,) [1/m].

    Where cases have rays, foot and height are computed from them in the precision, 'single' or 'double'. The `table`
    has the values of the phase function 'tabulated', of mean 1; the light has an `intensity` [W/sr].
    """
    types = array_types(precision)
    name = cases.phase[rows[0]]
    column = partial(aligned_array, types.scalar)
    phase = named_phase(
        name,
        g=column(cases.g[rows]) if name == "hg" else None,
        values=column(np.asarray(table)) if name == "tabulated" else None,
        Float=types.scalar,
    )
    medium = Homogeneous((column(cases.sigma_t[rows]),), types.color(1), phase)
    if cases.light is None or cases.origin is None or cases.direction is None:
        light = Light(types.vector(0), types.color(intensity))
        geometry = RayGeometry(column(cases.foot[rows]), column(cases.height[rows]), None, None)
    else:
        light = Light(types.vector(cases.light[rows].T), types.color(intensity))
        direction = mi.Vector3d(cases.direction[rows].T)
        geometry = ray_geometry(types.vector(cases.origin[rows].T), direction, light)
    x0, x1 = column(cases.x0[rows]), column(cases.x1[rows])
    return np.array(function(geometry, x0, x1, medium, light), dtype=np.float64)
