# SPDX-License-Identifier: BSD-3-Clause
"""Values of kernels on rays, all of whose numbers are arrays: what is
compiled serves every value.
"""

from dataclasses import replace
from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from airlight.analytic.panels import airlight_segments
from airlight.analytic.phase import phase_from_words
from airlight.realtime.numerics.array_types import ArrayTypes, aligned_array, array_types
from airlight.realtime.rays import RayGeometry
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.medium import Homogeneous
from airlight.realtime.scene.phase import Phase, named_phase
from airlight.validation.kernels.case_files import Cases

Array = NDArray[np.float64]

#: A ray for what any ray shows: foot, height, x0, x1, extinction.
RAY = (1.3, 0.7, 0.2, 3.1, 0.43)


def opaque(tree: Any) -> Any:
    """Return a light, a medium or a phase function whose numbers are arrays and no literals."""
    dr.make_opaque(tree)
    return tree


def vectors(types: ArrayTypes, rows: Any) -> Any:
    """Return three-vectors from the rows of an array, (n, 3), in aligned memory: one
    kernel serves all of them.
    """
    columns = np.asarray(rows, dtype=np.float64).reshape(-1, 3).T
    return types.vector(*(aligned_array(types.scalar, column) for column in columns))


def phase_of(name: str | Phase, g: Any, Float: Any) -> Phase:
    """Return a phase function by its name; `g`, of 'hg' alone, is one
    number or one for each ray.
    """
    if isinstance(name, Phase):
        return name
    g = (
        None
        if name != "hg"
        else dr.opaque(Float, g)
        if np.ndim(g) == 0
        else aligned_array(Float, np.asarray(g))
    )
    return named_phase(name, g=g, Float=Float)


def kernel_values(
    kernel, rays, name="isotropic", g: Any = 0.0, *, precision="single", **parameters: Any
) -> Array:
    """Return J of a kernel; `rays` are foot, height, x0, x1 and extinction, numbers or columns."""
    types = array_types(precision)
    columns = np.broadcast_arrays(
        *(np.atleast_1d(np.asarray(column, dtype=np.float64)) for column in rays)
    )
    foot, height, x0, x1, sigma_t = (
        aligned_array(types.scalar, np.array(column)) for column in columns
    )
    medium = Homogeneous((sigma_t,), types.color(1), phase_of(name, g, types.scalar))
    geometry = RayGeometry(foot, height, None, None)
    return np.array(
        kernel(geometry, x0, x1, medium, Light(None, None), **parameters), dtype=np.float64
    )


def true_values(rays, name="isotropic", g: Any = 0.0) -> Array:
    """Return J by adaptive quadrature in float64, which shares no code with kernels."""
    columns = np.broadcast_arrays(
        *(np.atleast_1d(np.asarray(column, dtype=np.float64)) for column in (*rays, g))
    )
    values = np.empty(columns[0].shape)
    for one in np.unique(columns[5]):
        own = columns[5] == one
        phase = phase_from_words(name, g=float(one))
        values[own], _ = airlight_segments(*(column[own] for column in columns[:5]), phase)
    return values


def relative_error(values: Array, expected: Array) -> Array:
    """Return relative errors; what float32 has no normal numbers for counts in absolute terms."""
    return np.abs(values - expected) / np.maximum(expected, 1e-37)


def single_precision(*columns: Any) -> list[Array]:
    """Return columns as float32 has them, in float64."""
    return [np.asarray(column).astype(np.float32).astype(np.float64) for column in columns]


def take(cases: Cases, rows: NDArray[Any]) -> Cases:
    """Return the cases of some rows, (n,): numbers, or truth values of all cases."""
    numbers = np.arange(len(cases.phase))[rows]
    columns = (
        "g",
        "foot",
        "height",
        "x0",
        "x1",
        "sigma_t",
        "value",
        "origin",
        "direction",
        "light",
    )
    arrays = {name: getattr(cases, name) for name in columns}
    chosen: dict[str, Any] = {
        name: None if column is None else column[numbers] for name, column in arrays.items()
    }
    for name in ("phase", "tag", "rows", "lines"):
        words = getattr(cases, name)
        chosen[name] = tuple(words[k] for k in numbers) if words else words
    return replace(cases, **chosen)
