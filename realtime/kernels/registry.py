# SPDX-License-Identifier: BSD-3-Clause
"""Airlight kernels: J between two distances along a ray, for a whole array of rays.

A kernel is a function ``kernel(geometry, x0, x1, medium, light, **parameters) -> J [1/m]``. `geometry` is a
`realtime.rays.RayGeometry`, ``x0 <= x1`` [m] bound the lit part of the ray (`x1` may be infinite), and the
result has one value per ray for a grey medium, a colour for a coloured one. The in-scattered radiance is ``albedo
sigma_t intensity J / (4 pi)``. `realtime.scene.media.medium` clips the segment to the cone of a spot before it
calls the kernel; where the intensity falls off inside the cone (``light.varies``), the kernel weighs its integrand by
`RayGeometry.falloff`.

`KERNELS` is the registry: add a `Kernel` to it and every method, command and report knows it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from types import MappingProxyType
from typing import Any

from realtime.kernels.closed_form import closed_form
from realtime.kernels.exact import exact
from realtime.kernels.stepping import equiangular, quadrature, quadrature_theta, uniform
from realtime.kernels.table import table
from realtime.kernels.taylor import taylor


@dataclass(frozen=True)
class Kernel:
    """A kernel under its name, with what a user must know of it."""

    name: str
    function: Callable[..., Any]
    summary: str
    source: str
    parameters: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))  #: name -> default


KERNELS: dict[str, Kernel] = {
    "exact": Kernel(
        "exact",
        exact,
        "the default: nodes placed by the phase function's lobe, accurate to float32",
        "realtime/kernels/exact.py",
    ),
    "quadrature": Kernel(
        "quadrature",
        quadrature,
        "Gauss-Legendre nodes in w = asinh(q/h)",
        "the path form of the airlight equation, realtime/kernels/stepping.py",
        MappingProxyType({"nodes": 16}),
    ),
    "taylor": Kernel(
        "taylor",
        taylor,
        "polynomial in the angle theta about the foot, coefficients re-derived",
        "Biri, Arques, Michelin 2006, section 4.1 and annex",
        MappingProxyType({"degree": 4}),
    ),
    "taylor-printed": Kernel(
        "taylor-printed",
        partial(taylor, printed=True),
        "the same with the paper's coefficients as printed, misprints included",
        "Biri, Arques, Michelin 2006, annex as transcribed",
        MappingProxyType({"degree": 4}),
    ),
    "quadrature-theta": Kernel(
        "quadrature-theta",
        quadrature_theta,
        "Gauss-Legendre nodes in theta, the angle at the light",
        "Biri, Arques, Michelin 2006, section 4.1 (the angle form)",
        MappingProxyType({"nodes": 16}),
    ),
    "equiangular": Kernel(
        "equiangular",
        equiangular,
        "midpoint steps in theta",
        "Kulla, Fajardo 2012, section 4",
        MappingProxyType({"steps": 16}),
    ),
    "uniform": Kernel(
        "uniform",
        uniform,
        "midpoint steps in the distance, as in most shaders",
        "Billeter, Sintorn, Assarsson 2010, section 2",
        MappingProxyType({"steps": 100}),
    ),
    "table": Kernel(
        "table",
        table,
        "two reads of F(u, v), bilinear; the edge is read beyond sigma_t h = 10",
        "Sun, Ramamoorthi, Narasimhan, Nayar 2005",
        MappingProxyType({"size": 64}),
    ),
    "closed-form": Kernel(
        "closed-form",
        closed_form,
        "difference of complex exponential integrals",
        "Pegoraro and Parker 2009; Pegoraro, Schott, Parker 2009",
    ),
}
