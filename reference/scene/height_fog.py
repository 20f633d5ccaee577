# SPDX-License-Identifier: BSD-3-Clause
"""Height fog, a medium without sides: a `heterogeneous` medium whose extinction is a volume of type `heightfog`.

The plugin (`validation.scenes.height_fog`) gives its numbers. Each estimator derives for itself what follows from them.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from analytic.phase import PhaseFunction
from reference.scene.varying import VaryingMedium

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class HeightMedium(VaryingMedium):
    """A medium whose density depends on height alone."""

    layers: tuple[tuple[float, float, float], ...]  #: extinction at the base [1/m], base [m], scale height [m]
    constant: float  #: extinction everywhere between floor and cap [1/m]
    clamped: bool  #: whether layers are constant below their bases
    floor: float  #: [m]
    cap: float  #: [m]
    up: Array  #: unit vector, (3,): heights are along it


def is_height_fog(medium) -> bool:
    """Return whether a medium of Mitsuba is height fog."""
    return medium is not None and "sigma_t.H_1" in mi.traverse(medium)


def read_height_fog(medium, albedo: Array, phase: PhaseFunction) -> HeightMedium:
    """Read height fog; its albedo, RGB, and its phase function were read."""
    parameters = mi.traverse(medium)
    scale = float(parameters["scale"])
    number = {key.rpartition(".")[2]: np.array(parameters[key], dtype=np.float64).ravel() for key in _keys(parameters)}
    layers = tuple(
        (scale * sigma_t, float(number[f"z_{i}"][0]), float(number[f"H_{i}"][0]))
        for i in "12"
        if (sigma_t := float(number[f"sigma_{i}"][0])) > 0
    )
    ends = float(number["floor"][0]), float(number["cap"][0])
    largest = np.array(medium.get_majorant(dr.zeros(mi.MediumInteraction3f)), dtype=np.float64).reshape(-1)
    clamped, constant = bool(number["clamped"][0]), scale * float(number["sigma_0"][0])
    return HeightMedium(
        layers=layers,
        constant=constant,
        clamped=clamped,
        floor=ends[0],
        cap=ends[1],
        up=number["up"],
        albedo=albedo,
        phase=phase,
        largest=np.array(np.broadcast_to(largest, 3)),
        plugin=medium,
    )


def _keys(parameters: Any) -> list[str]:
    return [key for key in parameters.keys() if key.startswith("sigma_t.")]  # noqa: SIM118 - of pairs
