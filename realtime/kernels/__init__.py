# SPDX-License-Identifier: BSD-3-Clause
"""Airlight kernels: J between two distances along a ray, for a whole array of rays.

A kernel is a function ``kernel(geometry, x0, x1, medium, light, **parameters) -> J [1/m]``. `geometry` is a
`realtime.geometry.RayGeometry`, ``x0 <= x1`` [m] bound the lit part of the ray (`x1` may be infinite), and the result
has one value per ray for a grey medium, a colour for a coloured one. The in-scattered radiance is
``albedo sigma_t intensity J / (4 pi)``. `airlight_integral` clips the segment to the cone of a spot before it calls the
kernel; where the intensity falls off inside the cone (``light.soft``), the kernel weighs its integrand by
`realtime.geometry.falloff`.

`KERNELS` is the registry: add a `Kernel` to it and every method, command and report knows it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from realtime.geometry import RayGeometry, clip_to_cone
from realtime.kernels.quadrature import quadrature
from realtime.kernels.taylor import taylor
from realtime.lights import Light
from realtime.medium import Medium


@dataclass(frozen=True)
class Kernel:
    """A kernel under its name, with what a user must know of it."""

    name: str
    function: Callable[..., Any]
    summary: str
    source: str
    parameters: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))  #: name -> default


KERNELS: dict[str, Kernel] = {
    "quadrature": Kernel(
        "quadrature",
        quadrature,
        "Gauss-Legendre nodes in w = asinh(q/h)",
        "DESIGN section 2; end points after notes on the path form",
        MappingProxyType({"nodes": 16}),
    ),
    "taylor": Kernel(
        "taylor",
        taylor,
        "polynomial in the angle theta about the foot, coefficients re-derived",
        "Biri, Arques, Michelin 2006, section 4.1 and annex",
        MappingProxyType({"degree": 4}),
    ),
}


def airlight_integral(kernel, geometry: RayGeometry, x0, x1, *, medium: Medium, light: Light):
    """Return J over the part of [x0, x1] that the light's cone reaches [1/m].

    Parameters
    ----------
    kernel
        A kernel function, see the module.
    geometry, x0, x1
        The rays and their lit segments [m].
    medium, light
        What fills the scene and what lights it.
    """
    if light.kind == "spot":
        x0, x1 = clip_to_cone(geometry, light.cos_cutoff, x0, x1)
    return kernel(geometry, x0, x1, medium, light)
