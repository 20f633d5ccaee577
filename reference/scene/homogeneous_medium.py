# SPDX-License-Identifier: BSD-3-Clause
"""Media of one extinction, with bounds and without, and what scatters in any medium."""

from dataclasses import dataclass

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.analytic.phase import (
    HenyeyGreenstein,
    Isotropic,
    PhaseFunction,
    Rayleigh,
    Tabulated,
)
from airlight.errors import InputError
from airlight.reference.scene.colours import colour
from airlight.reference.scene.convex_bounds import Bounds, read_bounds
from airlight.reference.scene.varying import is_height_fog

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ReferenceMedium:
    """A homogeneous medium."""

    sigma_t: Array  #: extinction [1/m], RGB
    albedo: Array  #: RGB
    phase: PhaseFunction
    plugin: "mi.Medium | None"  #: None for a vacuum

    @property
    def largest(self) -> Array:
        """Its largest extinction, the same at all places, RGB [1/m]."""
        return self.sigma_t


VACUUM = ReferenceMedium(np.zeros(3), np.zeros(3), Isotropic(), None)


@dataclass(frozen=True)
class BoundedMedium(ReferenceMedium):
    """A homogeneous medium within convex bounds."""

    bounds: Bounds  #: what it fills
    name: str  #: the id of the shape that bounds it


def read_bounded(shape: "mi.Shape") -> BoundedMedium:
    """Read the medium within a shape."""
    inside = read_medium(shape.interior_medium(), f"the medium of shape '{shape.id()}'")
    return BoundedMedium(
        inside.sigma_t,
        inside.albedo,
        inside.phase,
        inside.plugin,
        bounds=read_bounds(shape),
        name=shape.id(),
    )


def read_medium(medium: "mi.Medium", name: str) -> ReferenceMedium:
    """Read a homogeneous medium; messages call it by `name`."""
    if is_height_fog(medium):
        raise InputError(
            f"{name} is height fog, which has no sides; expected it in the sensor, and no shape "
            "around it"
        )
    if not medium.is_homogeneous():
        raise InputError(
            f"{name} is heterogeneous; expected a medium of type 'homogeneous', or a density grid "
            "in the sensor, or one in vacuum in a convex shape that holds its whole box"
        )
    parameters = mi.traverse(medium)
    _require_constant(parameters, "sigma_t", name)
    sigma_t = np.array(parameters["sigma_t.value.value"], dtype=np.float64) * float(
        parameters["scale"]
    )
    return ReferenceMedium(
        colour(sigma_t, f"{name}: its sigma_t"), *read_scattering(medium), medium
    )


def read_scattering(medium: "mi.Medium") -> tuple[Array, PhaseFunction]:
    """Return the albedo of a medium, RGB, the same everywhere, and its phase function."""
    parameters = mi.traverse(medium)
    _require_constant(parameters, "albedo", f"medium '{medium.id()}'")
    albedo = colour(
        parameters["albedo.value.value"],
        f"medium '{medium.id()}': its albedo",
        largest=1 + 1e-6,  # rounding
    )
    return albedo, _read_phase(medium.phase_function())


def _require_constant(parameters: "mi.SceneParameters", coefficient: str, name: str) -> None:
    if f"{coefficient}.value.value" not in parameters:
        raise InputError(
            f"{name}: its {coefficient} differs from place to place; expected one number or one "
            "'rgb'"
        )


def _read_phase(phase: "mi.PhaseFunction") -> PhaseFunction:
    parameters = mi.traverse(phase)
    name = phase.class_name()
    if name == "IsotropicPhaseFunction":
        return Isotropic()
    if name == "RayleighPhaseFunction":
        return Rayleigh()
    if name == "HGPhaseFunction":
        return HenyeyGreenstein(float(parameters["g"][0]))
    if name == "TabulatedPhaseFunction":
        return Tabulated(tuple(np.array(parameters["values"]).tolist()))
    raise InputError(
        f"the phase function is a {name}; expected one of isotropic, hg, rayleigh, tabphase"
    )
