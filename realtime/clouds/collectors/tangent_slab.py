# SPDX-License-Identifier: BSD-3-Clause
r"""The slab that touches a cloud where light enters it, and a point and a direction in it.

A collector is a place c and a width sigma. The lit surface filtered by sigma (`realtime.clouds.light_maps`) gives a
point q of the filtered surface, its outward normal n and the thickness Z of the cloud along the light w_L there. The
slab is the one that touches it: its lit face goes through q across n. With mu_L = -n . w_L,

    t = sigma_t mu_L Z                      its thickness; Z lies along the light,
    d = sigma_t (q - p) . n                 the depth of the point p below the face,
    f = p + n d / sigma_t                   the foot of p on the face,
    mu = v . n                              of the direction v in which light leaves p,
    x = (w_L + mu_L n)/|..|,  y = n x x     the horizontal direction of the light, and the one beside it,
    cos phi = v . x / sin, sin phi = v . y / sin,   sin = sqrt(1 - mu^2).

The canonical transport of (t, d, mu, phi, mu_L) gives the radiance of a set of orders at p in the direction v, and
where its light enters the slab: c = f + (c_x x + c_y y)/sigma_t.

Where a cloud is no slab:

* p above the filtered face: d = 0. A cloud has bumps that the filter has not.
* p deeper than the slab is thick: t = d. There is cloud down to p at least.
* The sun below the tangent plane, or in it: mu_L is `LEAST_COSINE` at least, and n is turned towards the sun until it
  is. Normals of a map face the light, so means of them are never below the plane; at silhouettes they come close to it.
* Opposed normals whose mean is 0 (both sides of a ridge): n is the direction towards the sun.
* The sun in the zenith: x is any horizontal direction; the transport depends on none.

`thickness=light` has both lengths along the light, as printed: t = sigma_t Z and d/mu_L, what a depth map holds.
A slab in which the sun stands at 75 degrees is then 3.9 times too thick.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from realtime.clouds.light_maps.pyramid import FilteredSurface

LEAST_COSINE = 0.02  #: of the sun over a tangent plane
_LEAST_LENGTH = 1e-4  #: of a mean of unit normals that has a direction


@dataclass(frozen=True)
class TangentSlab:
    """A slab, a point and a direction in it; lengths in mean free paths unless they say otherwise."""

    thickness: Any  #: t
    depth: Any  #: d of the point, from 0 to t
    mu: Any  #: cosine of the direction with the normal
    cos_phi: Any
    sin_phi: Any
    mu_l: Any  #: cosine of the sun's zenith angle
    foot: Any  #: of the point on the lit face [m]
    normal: Any
    along: Any  #: the horizontal direction of the light
    beside: Any  #: across it and the normal


def tangent_slab(
    surface: FilteredSurface, *, axis: Any, point: Any, toward: Any, extinction: Any, along_light: bool = False
) -> TangentSlab:
    """Return the slab that touches a filtered surface, with a point and a direction in it.

    `surface`: what `realtime.clouds.light_maps.pyramid.filtered_surface` found; `axis`: unit direction in which the
    light travels; `point`: points in the cloud or on it [m]; `toward`: unit directions in which light leaves the
    points; `extinction`: of the cloud [1/m]; `along_light`: whether thickness and depth are those along the light, as
    printed.
    """
    Float = type(surface.cover)
    normal, mu_l = _facing(surface.normal, axis)
    below = dr.maximum(dr.dot(surface.middle - point, normal), 0)
    depth, thickness = extinction * below, extinction * surface.thickness
    if along_light:
        depth /= mu_l
    else:
        thickness *= mu_l
    along = axis + normal * mu_l
    length = dr.norm(along)
    helper = dr.select(dr.abs(normal.x) < 0.5, type(normal)(1, 0, 0), type(normal)(0, 1, 0))
    along = dr.select(length > _LEAST_LENGTH, along / length, dr.normalize(dr.cross(helper, normal)))
    beside = dr.cross(normal, along)
    mu = dr.clip(dr.dot(toward, normal), -1, 1)
    x, y = dr.dot(toward, along), dr.dot(toward, beside)
    sine = dr.sqrt(dr.square(x) + dr.square(y))
    flat = sine > 0
    return TangentSlab(
        thickness=dr.maximum(thickness, depth),
        depth=depth,
        mu=mu,
        cos_phi=dr.select(flat, x / sine, Float(1)),
        sin_phi=dr.select(flat, y / sine, Float(0)),
        mu_l=mu_l,
        foot=dr.fma(normal, below, point),
        normal=normal,
        along=along,
        beside=beside,
    )


def _facing(normal: Any, axis: Any) -> tuple[Any, Any]:
    """Return a unit normal that faces the light by `LEAST_COSINE` at least, and its cosine."""
    length = dr.norm(normal)
    normal = dr.select(length > _LEAST_LENGTH, normal / length, -axis)
    cosine = -dr.dot(normal, axis)
    # n + s (-w_L), whose cosine is c: s = c sqrt((1 - a^2)/(1 - c^2)) - a, with a that of n.
    sine = dr.sqrt(dr.maximum(1 - dr.square(cosine), 0))
    turn = LEAST_COSINE / (1 - LEAST_COSINE**2) ** 0.5 * sine - cosine
    low = cosine < LEAST_COSINE
    normal = dr.select(low, dr.normalize(dr.fma(axis, -turn, normal)), normal)
    return normal, dr.select(low, type(cosine)(LEAST_COSINE), dr.minimum(cosine, 1))
