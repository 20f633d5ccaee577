# SPDX-License-Identifier: BSD-3-Clause
"""A stretch of a ray in the variable of the polynomial kernel, and the integrand there.

With E = q/h (DESIGN section 2) and E = m sinh w (`realtime.kernels.polynomial` says why), the offset u from the near
end w0, F = E0/m and C = sqrt(1 + F^2), and r0 the distance of the near end from the light,

    J = (2 m/h) exp(-sigma_t (x0 + r0)) int_0^U f(u) du,    f = exp(-sigma_t h (E - E0)) p cosh w / (1 + E^2),
    E - E0 = m (F (cosh u - 1) + C sinh u),     cosh w = C cosh u + F sinh u,     cosh u - 1 = sinh^2 u/(1 + cosh u),

sums of positive terms. The far end is brought to where extinction or 1/(1 + E^2) have left nothing.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from realtime.numerics.array_types import is_single, smallest
from realtime.numerics.fast_exp import exp_bounded
from realtime.rays.ray_light import RayGeometry, falloff_beside
from realtime.scene.lights import Light
from realtime.scene.medium import Medium
from realtime.scene.phase import Phase


@dataclass(frozen=True)
class Place:
    """A point of a ray."""

    x: Any  #: distance along the ray [m]
    r: Any  #: distance from the light [m]
    sinh: Any  #: sinh w = E/m
    cosh: Any  #: cosh w


@dataclass(frozen=True)
class Piece:
    """A stretch of a ray in the variable u, and the polynomial fitted there; all fields have one entry per ray."""

    x0: Any  #: near end [m]
    x1: Any  #: far end [m], may be infinite
    foot: Any  #: as in RayGeometry [m]
    height: Any  #: as in RayGeometry, but not below rounding of the distances [m]
    through_light: Any  #: whether the ray passes through the light
    scale: Any  #: m of E = m sinh w
    thickness: Any  #: sigma_t h m
    near: Place  #: the near end: r0, F and C
    reach: Any  #: (E - E0)/m beyond which nothing is left
    width: Any  #: U
    factor: Any  #: (2 m/h) exp(-sigma_t (x0 + r0)) [1/m]


def piece_of(geometry: RayGeometry, x0, x1, sigma_t, phase: Phase) -> Piece:
    """Return the range of [x0, x1] [m] in u, without a polynomial, for an extinction `sigma_t` [1/m].

    Valid for any segment.
    """
    foot = geometry.foot
    Float = type(geometry.height)
    single = is_single(Float)
    s0, s1 = x0 - foot, x1 - foot
    # J is even in h: with the light beside the segment, a height below rounding of its distance is as good as zero.
    beside = dr.maximum(dr.maximum(s0, -s1), 0)
    h = dr.maximum(geometry.height, (1e-7 if single else 1e-15) * beside)
    scale, spread = phase.fit_scales(Float)
    r0 = dr.sqrt(dr.fma(s0, s0, h * h))
    start = _path_over_height(s0, r0, h) / scale
    thickness = sigma_t * h * scale
    # Beyond the first term extinction has left e^-20 (e^-40) of the integrand, beyond the second 1/(1 + E^2) has.
    negligible = (1e7 if single else 1e16) * (spread / scale + start)
    piece = Piece(
        x0,
        x1,
        foot,
        h,
        geometry.height == 0,
        scale,
        thickness,
        Place(x0, r0, start, dr.sqrt(dr.fma(start, start, 1))),
        reach=dr.minimum((20.0 if single else 40.0) / dr.maximum(thickness, smallest(Float)), negligible),
        width=Float(0),
        factor=(2 / h) * scale * dr.exp(-sigma_t * (x0 + r0)),
    )
    return replace(piece, width=offset(piece, piece.near, x1))


def _path_over_height(s, r, h):
    return dr.select(s >= 0, (s + r) / h, h / (r - s))


def place(piece: Piece, x) -> Place:
    """Return where a point lies that is `x` from the camera [m], one beyond the reach of the piece at its reach."""
    s, h = dr.select(dr.isinf(x), 0, x - piece.foot), piece.height
    r = dr.sqrt(dr.fma(s, s, h * h))
    limit = piece.near.sinh + piece.reach
    sinh = dr.select(dr.isinf(x), limit, dr.minimum(_path_over_height(s, r, h) / piece.scale, limit))
    return Place(x, r, sinh, dr.sqrt(dr.fma(sinh, sinh, 1)))


def offset(piece: Piece, begin: Place, x):
    """Return w(x) - w(begin) [1], without cancellation of the two; `x` is a distance along the ray [m].

    Since dq = (1 + ds/dr) dx, E - E0 = (x - x0)(E0 + E)/(r0 + r), and by the addition theorem of sinh w - w0 =
    asinh(F C0 - F0 C) = asinh((F - F0)(F0 + F)/(F C0 + F0 C)).
    """
    end = place(piece, x)
    beyond = end.sinh >= piece.near.sinh + piece.reach
    total = begin.sinh + end.sinh
    difference = dr.select(beyond, end.sinh - begin.sinh, (x - begin.x) * (total / (begin.r + end.r)))
    return dr.asinh(difference * (total / dr.fma(end.sinh, begin.cosh, begin.sinh * end.cosh)))


def integrand(piece: Piece, u, geometry: RayGeometry, medium: Medium, light: Light):
    """Return f(u)."""
    start, cosh_start = piece.near.sinh, piece.near.cosh
    if light.varies:
        sinh, cosh = dr.sincosh(u)  # accurate for small u too: the place in the cone depends on it
    else:
        grown = exp_bounded(u)
        shrunk = dr.rcp(grown)
        sinh, cosh = 0.5 * (grown - shrunk), 0.5 * (grown + shrunk)
    growth = dr.fma(start, sinh * sinh / (1 + cosh), cosh_start * sinh)
    cosh_w = dr.fma(cosh_start, cosh, start * sinh)
    value = exp_bounded(-piece.thickness * growth)
    if medium.phase.constant and not light.varies:
        return value / cosh_w
    e = piece.scale * (start + growth)
    squared = e * e
    up = dr.rcp(1 + squared)
    value *= cosh_w * up * medium.phase.evaluate_half(squared * up, up)
    if light.varies:
        value *= falloff_beside(geometry, light, 0.5 * piece.height * (e - dr.rcp(e)))
    return value


def with_limits(piece: Piece, x0, x1, value):
    """Return a `value` of J [1/m], corrected where the formulas are 0/0.

    J is 0 on a segment [x0, x1] [m] of no length, and infinite with the light on the segment.
    """
    on_light = piece.through_light & (x0 <= piece.foot) & (piece.foot <= x1)
    return dr.select(x1 == x0, 0, dr.select(on_light, dr.inf, value))
