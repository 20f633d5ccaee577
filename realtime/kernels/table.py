# SPDX-License-Identifier: BSD-3-Clause
"""Tables of the airlight integral, and how the tables of a kernel come onto the device.

Kernels that read tables: what must be on the device before a frame is recorded.

A frozen function cannot take an array from the host, and reads one on the device only if it is among its inputs. So a
kernel may have a `prepare`, ``prepare(Float, **parameters) -> tables``, which `prepared_by` gives it. Who freezes a
function calls `prepare_kernel` before, passes what it returns as an input, and calls the kernel as `with_tables` makes
it. A kernel without `prepare` knows nothing of this.

Tables of the airlight integral: J as the difference of two reads.

With E = q/h (path form of DESIGN section 2), a = sigma_t h and an isotropic phase function

    J = (2/h) exp(-sigma_t foot) int_{E0}^{E1} exp(-a E) / (1 + E^2) dE.

**The published table** (`form="sun"`). E = tan xi turns the integral into the difference of two values of

    F(u, v) = int_0^v exp(-u tan xi) dxi,      u = a,  v = atan(q/h) = theta/2 + pi/4,

which Sun et al. tabulate over u in [0, 10] and v in [0, pi/2].

**The scaled table** (`form="tail"`). F is flat where it matters: beyond the light, and far before it, both reads are
nearly equal. Each side of the foot point has an integral of its own that vanishes there instead. With the angle v of an
end point, E = tan v, and E' = E + y/cos v, the tail loses its exponential and becomes a bounded function,

    int_E^inf exp(-a E') / (1 + E'^2) dE' = exp(-a E) cos v K(a/cos v, sin v),
    K(alpha, s) = int_0^inf exp(-alpha y) / (1 + 2 s y + y^2) dy,

and h/cos v = sqrt(h^2 + q^2) = sqrt(2 r q) and sin v = sqrt(q/(2 r)) know no division by h. A segment that ends before
the foot (E1 <= 1) takes two heads instead,

    int_0^E exp(-a E') / (1 + E'^2) dE' = E M(a E, E),      M(alpha, e) = int_0^1 exp(-alpha y) / (1 + e^2 y^2) dy,

where E/h = 1/(r - s), s = x - foot. So h = 0 beside the light is nothing special: there K = 1 - alpha exp(alpha)
E1(alpha) or M = (1 - exp(-alpha))/alpha. Tabulated are (1 + alpha) K and (1 + alpha) M, which lie between 2/pi and 2
for any extinction, over e or s in [0, 1] and b = alpha/(1 + alpha); over sqrt(b) for K, which has a term alpha log
alpha. Interpolated bilinearly the relative error falls like log(size)/size^2.

Both forms interpolate bilinearly, in software: the texture units of graphics hardware have 8-bit weights. A table holds
the four corners of each cell side by side, one fetch a read.
"""

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import drjit as dr
import numpy as np

from realtime.errors import InputError
from realtime.numerics.array_types import four_numbers
from realtime.numerics.functions import cell_of
from realtime.rays import RayGeometry
from realtime.scene.lights import Light
from realtime.scene.media.medium import Homogeneous


def prepared_by(prepare: Callable[..., Any]) -> Callable[[Any], Any]:
    """Return a decorator that gives a kernel its `prepare`; the kernel takes the tables as its keyword `tables`."""

    def mark(kernel: Any) -> Any:
        kernel.prepare = prepare
        return kernel

    return mark


def prepare_kernel(kernel: Any, Float: type) -> Any:
    """Return the tables of a kernel, evaluated, in the precision of `Float`; None for one that reads none.

    `kernel`: a kernel function, or a `functools.partial` of one that sets parameters; `Float`: the type of a number per
    ray. Raises InputError for what the kernel's `prepare` refuses.
    """
    function, parameters = (kernel.func, kernel.keywords) if isinstance(kernel, partial) else (kernel, {})
    prepare = getattr(function, "prepare", None)
    return None if prepare is None else prepare(Float, **parameters)


def with_tables(kernel: Any, tables: Any) -> Any:
    """Return the kernel that reads these tables, from `prepare_kernel`."""
    return kernel if tables is None else partial(kernel, tables=tables)


FORMS = ("sun", "tail")
_LARGEST_U = 10.0  # of Sun's table
_LARGEST_SIZE = 2048  # 128 MiB in float32 on the device; the quadratures below are good to this size


def upload_table(Float, *, form: str = "sun", size: int = 64):
    """Return a table on the device, an array of `Float`; parameters as those of `table`."""
    _check(form, size)
    if Float is float:
        raise InputError(
            "kernel table: the scalar backend has no arrays to hold a table; use an LLVM or CUDA variant, or another "
            "kernel"
        )
    if dr.flag(dr.JitFlag.FreezingScope):
        raise InputError(
            "kernel table: got a frozen function that records while the table is not on the device; call "
            "realtime.kernels.table.prepare_kernel before, and pass on what it returns"
        )
    records = Float(table_records(form, size).ravel())
    dr.make_opaque(records)
    return records


def _check(form: str, size: int) -> None:
    if form not in FORMS:
        raise InputError(f"form: got {form!r}, wanted one of {', '.join(FORMS)}")
    if not isinstance(size, int) or not 2 <= size <= _LARGEST_SIZE:
        raise InputError(f"size: got {size!r}, wanted a whole number from 2 to {_LARGEST_SIZE}")


@prepared_by(upload_table)
def table(
    geometry: RayGeometry, x0, x1, medium: Homogeneous, light: Light, *, form: str = "sun", size: int = 64, tables=None
):
    """Return the airlight integral J as the difference of two reads of a table [1/m].

    `form`: 'sun', the published table, or 'tail', scaled tails and heads; `size`: entries along each side, 64 in the
    paper; `tables`: what `upload_table` returned; None uploads the table for this call alone. Raises InputError for a
    phase function that is not isotropic, a spot that falls off inside its cone, an unknown form, a size outside [2,
    2048], and where a frozen function records that was given no table.

    Valid for x1 infinite, vacuum and segments of zero length (J = 0). Both forms are differences of reads, so where J
    is small against them (slivers, and with 'sun' all that is flat: rays that leave the light behind, thick media)
    errors grow as much, and small values can become negative.

    'sun': within 1 % for 64 entries where the ray passes near the light. sigma_t h > 10 is outside the table and reads
    its edge, u = 10, as published: the result is then wrong, mostly by orders of magnitude. A ray through the light's
    line, h = 0, gives NaN: the method divides by h. Where the light lies more than 88 optical depths behind the camera
    (709 in float64) exp(-sigma_t foot) overflows.

    'tail': any extinction, h = 0 beside the light; a segment that holds the light gives +inf. With 64 entries the
    largest relative error is about 3e-4, 1e-5 with 512; of slivers 1e-3, and 0.1 in float32.

    Sun, Ramamoorthi, Narasimhan, Nayar 2005, *A practical analytic single scattering model for real time rendering*,
    ACM Transactions on Graphics 24(3).
    """
    _check(form, size)
    if not medium.phase.constant:
        raise InputError(
            f"kernel table: phase function {medium.phase.name!r} is not tabulated; use the kernel 'quadrature' or an "
            "isotropic medium"
        )
    if light.varies:
        raise InputError(
            "kernel table: a spot that falls off between beam and cut-off, or a light with extent, is not tabulated; "
            "use the kernel 'quadrature', or a spot with beam_width = cutoff_angle"
        )
    if dr.grad_enabled((geometry.foot, geometry.height, x0, x1), medium.sigma_t):
        raise InputError(
            "kernel table: what is read between entries of a table has no derivative worth the name; use the kernel "
            "'exact'"
        )
    records = upload_table(type(geometry.height), form=form, size=size) if tables is None else tables
    difference = _sun if form == "sun" else _tail
    return medium.per_extinction(lambda sigma_t: difference(geometry, (x0, x1), sigma_t, records, size))


def _sun(geometry: RayGeometry, ends, sigma_t, records, size: int):
    foot, h = geometry.foot, geometry.height
    Float = type(h)
    u = dr.minimum(sigma_t * h / _LARGEST_U, 1)
    reads = []
    for x in ends:
        s = x - foot
        r = dr.sqrt(dr.fma(s, s, h * h))
        v = dr.select(s >= 0, dr.atan2(s + r, h), dr.atan2(h, r - s))
        v = dr.select(dr.isinf(r), Float(dr.pi / 2), v)
        reads.append(_read(records, (u, v * (2 / dr.pi)), size, 0))
    return 2 * dr.exp(-sigma_t * foot) / h * (reads[1] - reads[0])


def _tail(geometry: RayGeometry, ends, sigma_t, records, size: int):
    foot, h = geometry.foot, geometry.height
    Float, UInt32 = type(h), dr.uint32_array_t(type(h))
    tiny = dr.smallest(Float)
    head = ends[1] <= foot
    offset = dr.select(head, UInt32((size - 1) ** 2), UInt32(0))
    terms = []
    for x in ends:
        s = x - foot
        r = dr.sqrt(dr.fma(s, s, h * h))
        q = dr.select(s >= 0, s + r, h * (h / dr.maximum(r - s, tiny)))
        chord = dr.sqrt(2 * r) * dr.sqrt(q)  # of 2 r q, which float32 cannot hold where h is tiny
        alpha = sigma_t * dr.select(head, q, chord)
        b = alpha / (1 + alpha)
        side = dr.select(head, h / dr.maximum(r - s, tiny), dr.sqrt(q / dr.maximum(2 * r, tiny)))
        value = _read(records, (side, dr.select(head, b, dr.sqrt(b))), size, offset) / (1 + alpha)
        path = dr.select(head, foot, x + r)
        term = dr.exp(-sigma_t * path) * value / dr.select(head, r - s, chord)
        terms.append(dr.select(dr.isinf(r), 0, term))
    return 2 * dr.select(head, terms[1] - terms[0], terms[0] - terms[1])


def _read(records, position, size: int, offset):
    """Interpolate bilinearly at `position` in [0, 1]^2 in the table that begins at cell `offset`."""
    Float = type(records)
    (row, down), (column, along) = (cell_of(value * (size - 1), size) for value in position)
    corners = dr.gather(four_numbers(Float), records, offset + row * (size - 1) + column)
    return dr.lerp(dr.lerp(corners.x, corners.y, along), dr.lerp(corners.z, corners.w, along), down)


@lru_cache
def table_records(form: str, size: int):
    """Return the corners of the cells of a table in float64, shape (cells, 4); for 'tail' the tails, then the heads."""
    grid = np.linspace(0, 1, size)
    if form == "sun":
        return _corners(_sun_values(_LARGEST_U * grid, 0.5 * np.pi * grid))
    with np.errstate(divide="ignore"):
        of_tail, of_head = grid**2 / (1 - grid**2), grid / (1 - grid)
    return np.concatenate([_corners(_tail_values(of_tail, grid)), _corners(_head_values(of_head, grid))])


def _corners(values):
    corners = (values[:-1, :-1], values[:-1, 1:], values[1:, :-1], values[1:, 1:])
    return np.stack(corners, axis=-1).reshape(-1, 4)


def _sun_values(u, v):
    """F(u, v) = K(u, 0) - exp(-u tan v) cos v K(u / cos v, sin v), shape (len(u), len(v))."""
    whole = _tail_integral(u, 0.0)
    columns = [np.zeros_like(u)]
    for angle in v[1:-1]:
        cosine = np.cos(angle)
        rest = _tail_integral(u / cosine, np.sin(angle))
        columns.append(whole - np.exp(-u * np.tan(angle)) * cosine * rest)
    return np.stack([*columns, whole], axis=-1)


def _tail_values(alpha, s):
    """(1 + alpha) K(alpha, s), shape (len(s), len(alpha)); the last alpha is infinite, where the value is 1."""
    values = np.ones((len(s), len(alpha)))
    for row, sine in zip(values, s):
        row[:-1] = (1 + alpha[:-1]) * _tail_integral(alpha[:-1], sine)
    return values


def _tail_integral(alpha, s: float):
    """K(alpha, s) by the trapezoidal rule in log y, whose integrand decays like exp(-|log y|) and has no pole within
    pi/2 of the real axis: with steps of 1/4 the error is exp(-4 pi^2), below rounding.
    """
    y = np.exp(0.25 * np.arange(-160, 161))
    return np.exp(-np.multiply.outer(alpha, y)) @ (0.25 * y / (1 + 2 * s * y + y * y))


def _head_values(alpha, e):
    """(1 + alpha) M(alpha, e), shape (len(e), len(alpha)), by 256 Gauss-Legendre nodes; 1 at the infinite last alpha.

    As many nodes resolve exp(-alpha y) up to alpha of about 2000 to rounding.
    """
    xi, weight = np.polynomial.legendre.leggauss(256)
    y = 0.5 * (1 + xi)
    rational = 0.5 * weight / (1 + np.multiply.outer(e, y) ** 2)
    values = np.ones((len(e), len(alpha)))
    values[:, :-1] = rational @ np.exp(-np.multiply.outer(y, alpha[:-1])) * (1 + alpha[:-1])
    return values
