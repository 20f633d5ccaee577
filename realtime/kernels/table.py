# SPDX-License-Identifier: BSD-3-Clause
"""The published table of the airlight integral.

J as the difference of two reads. With E = q/h (path form of DESIGN section 2), a = sigma_t h and an
isotropic phase function

    J = (2/h) exp(-sigma_t foot) int_{E0}^{E1} exp(-a E) / (1 + E^2) dE,

and E = tan xi turns the integral into the difference of two values of

    F(u, v) = int_0^v exp(-u tan xi) dxi,      u = a,  v = atan(q/h) = theta/2 + pi/4,

which Sun et al. tabulate over u in [0, 10] and v in [0, pi/2]. The entries follow from the tail of
the integral: with E = tan v and E' = E + y/cos v,

    int_E^inf exp(-a E') / (1 + E'^2) dE' = exp(-a E) cos v K(a/cos v, sin v),
    K(alpha, s) = int_0^inf exp(-alpha y) / (1 + 2 s y + y^2) dy.

Reads are bilinear, in software: the texture units of graphics hardware have 8-bit weights. The
table holds the four corners of each cell side by side, one fetch a read.
"""

from functools import lru_cache

import drjit as dr
import numpy as np

from airlight.errors import InputError
from airlight.realtime.numerics.array_types import four_numbers
from airlight.realtime.numerics.functions import cell_of
from airlight.realtime.rays import RayGeometry
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.medium import Homogeneous

_LARGEST_U = 10.0  # of Sun's table


def upload_table(Float, *, size: int = 64):
    """Return a table on the device, an array of `Float`.

    `size`: entries along each side. Raises InputError for a size outside [2, 2048], for the scalar
    backend, and while a frozen function records.
    """
    # The scalar backend computes with Python's numbers.
    _check(size)
    if Float is float:
        raise InputError(
            "kernel table: the scalar backend has no arrays to hold a table; use an LLVM or CUDA "
            "variant, or another kernel"
        )
    if dr.flag(dr.JitFlag.FreezingScope):
        raise InputError(
            "kernel table: got a frozen function that records while the table is not on the "
            "device; call Kernel.prepared before, and pass on what it returns"
        )
    records = Float(table_records(size).ravel())
    # Evaluated: an input of a frozen function, and no literal of the kernels that read it.
    dr.make_opaque(records)
    return records


def _check(size: int) -> None:
    largest = 2048  # 128 MiB in float32 on the device; the quadratures below are good to this size
    if not isinstance(size, int) or not 2 <= size <= largest:
        raise InputError(f"size: got {size!r}, expected a whole number from 2 to {largest}")


def table(
    geometry: RayGeometry, x0, x1, medium: Homogeneous, light: Light, *, size: int = 64, tables=None
):
    """Return the airlight integral J as the difference of two reads of a table [1/m].

    Valid for x1 infinite, vacuum and segments of zero length (J = 0). Where J is small against the
    reads (slivers, rays that leave the light behind, thick media) errors grow as much, and small
    values can become negative.

    Within 1 % for 64 entries where the ray passes near the light. sigma_t h > 10 is outside the
    table and reads its edge, u = 10, as published: the result is then wrong, mostly by orders of
    magnitude. A ray through the light's line, h = 0, gives NaN: the method divides by h. Where the
    light lies more than 88 optical depths behind the camera (709 in float64) exp(-sigma_t foot)
    overflows.

    Sun, Ramamoorthi, Narasimhan, Nayar 2005, *A practical analytic single scattering model for real
    time rendering*, ACM Transactions on Graphics 24(3).

    Parameters
    ----------
    geometry, x0, x1, medium, light
        As for `realtime.kernels.registry.Kernel`.
    size
        Entries along each side, 2 to 2048; 64 in the paper.
    tables
        The result of `upload_table`; None uploads the table for this call alone.

    Raises
    ------
    InputError
        For a phase function that is not isotropic, a spot that falls off inside its cone, a light
        sample, another size, a derivative that is asked for, and while a frozen function records
        without `tables`.
    """
    # F(u, v) is the integral for the phase function 1, and for a light that shines alike on all of
    # the segment.
    _check(size)
    if not medium.phase.constant:
        raise InputError(
            f"kernel table: phase function {medium.phase.name!r} is not tabulated; use the kernel "
            "'quadrature' or an isotropic medium"
        )
    if light.varies:
        raise InputError(
            "kernel table: a spot that falls off between beam and cut-off, or an area light, is "
            "not tabulated; use the kernel 'quadrature', or a spot with beam_width = cutoff_angle"
        )
    # Reads are linear between entries: the error of a slope falls only as the size of a cell.
    if dr.grad_enabled((geometry.foot, geometry.height, x0, x1), medium.sigma_t):
        raise InputError(
            "kernel table: what is read between entries of a table has no derivative worth the "
            "name; use the kernel 'exact'"
        )
    # Without a table of the caller this call uploads one.
    records = upload_table(type(geometry.height), size=size) if tables is None else tables
    return medium.per_extinction(
        lambda sigma_t: _difference(geometry, (x0, x1), sigma_t, records, size)
    )


def _difference(geometry: RayGeometry, ends, sigma_t, records, size: int):
    foot, h = geometry.foot, geometry.height
    Float = type(h)
    # The place of u = sigma_t h in the table, from 0 to 1: beyond the table its edge, as published.
    u = dr.minimum(sigma_t * h / _LARGEST_U, 1)
    reads = []
    for x in ends:
        s = x - foot
        r = dr.sqrt(dr.fma(s, s, h * h))
        # v = atan(q/h); before the foot q = h^2/(r - s), without cancellation. The infinite end has
        # v = pi/2.
        v = dr.select(s >= 0, dr.atan2(s + r, h), dr.atan2(h, r - s))
        v = dr.select(dr.isinf(r), Float(dr.pi / 2), v)
        reads.append(_read(records, (u, v * (2 / dr.pi)), size))
    # J = (2/h) exp(-sigma_t foot) (F(u, v1) - F(u, v0)).
    return 2 * dr.exp(-sigma_t * foot) / h * (reads[1] - reads[0])


def _read(records, position, size: int):
    """Interpolate bilinearly at `position` in [0, 1]^2."""
    Float = type(records)
    (row, down), (column, along) = (cell_of(value * (size - 1), size) for value in position)
    # One fetch: x and y are the corners of the cell along v in its row of u, z and w of the next.
    corners = dr.gather(four_numbers(Float), records, row * (size - 1) + column)
    return dr.lerp(dr.lerp(corners.x, corners.y, along), dr.lerp(corners.z, corners.w, along), down)


@lru_cache
def table_records(size: int):
    """Return the corners of the cells of the table in float64, shape (cells, 4)."""
    grid = np.linspace(0, 1, size)
    values = _values(_LARGEST_U * grid, 0.5 * np.pi * grid)
    # The four corners of each cell side by side, in the order in which `_read` mixes them.
    corners = (values[:-1, :-1], values[:-1, 1:], values[1:, :-1], values[1:, 1:])
    return np.stack(corners, axis=-1).reshape(-1, 4)


def _values(u, v):
    """Return F(u, v) = K(u, 0) - exp(-u tan v) cos v K(u / cos v, sin
    v), shape (len(u), len(v)).
    """
    # K(u, 0) is the integral over all v: the last column. The first column, v = 0, is 0.
    whole = _tail_integral(u, 0.0)
    columns = [np.zeros_like(u)]
    for angle in v[1:-1]:
        cosine = np.cos(angle)
        # F is the whole less the tail from E = tan v on.
        rest = _tail_integral(u / cosine, np.sin(angle))
        columns.append(whole - np.exp(-u * np.tan(angle)) * cosine * rest)
    return np.stack([*columns, whole], axis=-1)


def _tail_integral(alpha, s: float):
    """K(alpha, s) by the trapezoidal rule in log y, whose integrand decays like exp(-|log y|) and
    has no pole within pi/2 of the real axis: with steps of 1/4 the error is exp(-4 pi^2), below
    rounding.
    """
    # y = exp(t) for t from -40 to 40, and dy = y dt.
    y = np.exp(0.25 * np.arange(-160, 161))
    return np.exp(-np.multiply.outer(alpha, y)) @ (0.25 * y / (1 + 2 * s * y + y * y))
