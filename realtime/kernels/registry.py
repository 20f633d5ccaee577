# SPDX-License-Identifier: BSD-3-Clause
"""Airlight kernels: J between two distances along a ray, for a whole array of rays.

A kernel is a function ``function(geometry, x0, x1, medium, light, **parameters) -> J [1/m]`` in a
record, `Kernel`, which answers what else media ask of it. `geometry` is a
`realtime.rays.RayGeometry`, ``x0 <= x1`` [m] bound the lit part of the ray (`x1` may be infinite),
and the result has one value per ray for a grey medium, a colour for a coloured one. The
in-scattered radiance is ``albedo sigma_t intensity J / (4 pi)``. `realtime.scene.media.medium`
clips the segment to the cone of a spot before it calls the kernel; where the intensity falls off
inside the cone (``light.varies``), the kernel weighs its integrand by `RayGeometry.falloff`.

**Tables.** A frozen function cannot take an array from the host, and reads one on the device only
if it is among its inputs. A kernel that reads tables has a `prepare`; code that freezes a function
passes it the kernel that `Kernel.prepared` returns as an input.

`KERNELS` is the registry: add a `Kernel` to it and every method, command and report knows it.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from airlight.realtime.kernels.closed_form import closed_form
from airlight.realtime.kernels.exact import exact
from airlight.realtime.kernels.stepping import equiangular, quadrature, quadrature_theta, uniform
from airlight.realtime.kernels.table import table, upload_table
from airlight.realtime.kernels.taylor import taylor, taylor_printed


@dataclass(frozen=True)
class Kernel:
    """A kernel under its name: what a user must know of it, and what media ask of it."""

    name: str
    function: Callable[..., Any]
    summary: str = ""
    source: str = ""
    #: name -> value; 'name-N' sets the first
    parameters: dict[str, int] = field(default_factory=dict)
    #: right to the precision of the arrays: media may take their best integral in its place
    exact: bool = False
    #: whether its nodes lie in w = asinh(q/h), by which media of any density can integrate
    in_asinh: bool = False
    #: ``prepare(Float, **parameters) -> tables``, which the function then
    #: takes as its keyword `tables`
    prepare: Callable[..., Any] | None = None
    tables: Any = None  #: on the device

    def __call__(self, *arguments):
        """Return the airlight integral J [1/m], a number per ray, or a colour in a coloured medium.

        Parameters
        ----------
        geometry
            The rays and the light: a `realtime.rays.RayGeometry`.
        x0, x1
            Ends of the lit part of each ray, x0 <= x1 [m]; `x1` may be infinite.
        medium
            The medium: `realtime.scene.media.medium.Homogeneous`.
        light
            The light, for the intensity that varies within its cone.
        """
        # A kernel without tables has no such argument.
        tables = {} if self.tables is None else {"tables": self.tables}
        return self.function(*arguments, **self.parameters, **tables)

    def prepared(self, Float: type) -> "Kernel":
        """Return the kernel with its tables, evaluated, in the precision of `Float`, the
        type of a number per ray.

        Raises
        ------
        InputError
            For what the kernel's `prepare` refuses.
        """
        return (
            self
            if self.prepare is None
            else replace(self, tables=self.prepare(Float, **self.parameters))
        )

    @property
    def asinh_nodes(self) -> int | None:
        """How many nodes in w = asinh(q/h) it has; None for a kernel of another rule."""
        return self.parameters["nodes"] if self.in_asinh else None

    def of_size(self, size: int) -> "Kernel":
        """Return the kernel 'name-N', whose first parameter is the size N."""
        # Parameters are in the order of the record: the first one is the size.
        first = next(iter(self.parameters))
        return replace(self, name=f"{self.name}-{size}", parameters=self.parameters | {first: size})


#: The kernels by name, each with its function and how large it is by default.
KERNELS: dict[str, Kernel] = {
    "exact": Kernel(
        "exact",
        exact,
        "the default: nodes placed by the phase function's lobe, accurate to float32",
        "realtime/kernels/exact.py",
        exact=True,
    ),
    "quadrature": Kernel(
        "quadrature",
        quadrature,
        "Gauss-Legendre nodes in w = asinh(q/h)",
        "the path form of the airlight equation, realtime/kernels/stepping.py",
        {"nodes": 16},
        in_asinh=True,
    ),
    "taylor": Kernel(
        "taylor",
        taylor,
        "polynomial in the angle theta about the foot, coefficients re-derived",
        "Biri, Arques, Michelin 2006, section 4.1 and annex",
        {"degree": 4},
    ),
    "taylor-printed": Kernel(
        "taylor-printed",
        taylor_printed,
        "the same with the paper's coefficients as printed, misprints included",
        "Biri, Arques, Michelin 2006, annex as transcribed",
        {"degree": 4},
    ),
    "quadrature-theta": Kernel(
        "quadrature-theta",
        quadrature_theta,
        "Gauss-Legendre nodes in theta, the angle at the light",
        "Biri, Arques, Michelin 2006, section 4.1 (the angle form)",
        {"nodes": 16},
    ),
    "equiangular": Kernel(
        "equiangular",
        equiangular,
        "midpoint steps in theta",
        "Kulla, Fajardo 2012, section 4",
        {"steps": 16},
    ),
    "uniform": Kernel(
        "uniform",
        uniform,
        "midpoint steps in the distance, as in most shaders",
        "Billeter, Sintorn, Assarsson 2010, section 2",
        {"steps": 100},
    ),
    "table": Kernel(
        "table",
        table,
        "two reads of F(u, v), bilinear; the edge is read beyond sigma_t h = 10",
        "Sun, Ramamoorthi, Narasimhan, Nayar 2005",
        {"size": 64},
        prepare=upload_table,
    ),
    "closed-form": Kernel(
        "closed-form",
        closed_form,
        "difference of complex exponential integrals",
        "Pegoraro and Parker 2009; Pegoraro, Schott, Parker 2009",
    ),
}
