# SPDX-License-Identifier: BSD-3-Clause
"""The geometry of a ray and a light: the foot of the perpendicular, the height, and the cone of a spot.

With v = light - origin and a unit direction d, ``foot = v . d`` and ``height = |v x d|``. The textbook form
sqrt(|v|^2 - foot^2) cancels where the ray passes close to the light: at height 1e-3 |v| it has no correct digit left in
float32. Each component of the cross product is a difference of two products, a b - c d, and Kahan's form with fused
multiply-add gives it to 1.5 units in the last place:

    w = c d;   e = fma(-c, d, w)   (the exact rounding error of w);   a b - c d = fma(a, b, -w) + e

That is as good as v and d are. The rounding errors of both are known, v's from the subtraction and d's from
`realtime.camera`, and enter to first order: (v + v') x (d + d') = v x d + v' x d + v x d'.
"""

from dataclasses import dataclass
from typing import Any

from realtime.lights import Light


@dataclass(frozen=True)
class RayGeometry:
    """Where a light lies as seen from a camera ray; every field has one entry per ray."""

    foot: Any  #: signed distance along the ray of the foot of the perpendicular from the light [m]
    height: Any  #: distance from the light to the ray [m]
    axial: Any  #: spot only: cosine between the ray and the axis of the spot
    offset: Any  #: spot only: component along the axis of the vector from the light to the foot [m]


def difference_of_products(a, b, c, d):
    """Return a b - c d with an error of at most 1.5 units in the last place.

    References
    ----------
    Jeannerod, Louvet, Muller 2013, *Further analysis of Kahan's algorithm for the accurate computation of 2x2
    determinants*, Mathematics of Computation 82.
    """
    import drjit as dr

    w = c * d
    error = dr.fma(-c, d, w)
    return dr.fma(a, b, -w) + error


def ray_geometry(origin, direction, light: Light, *, low=None) -> RayGeometry:
    """Return foot and height of rays with respect to one light.

    Parameters
    ----------
    origin, direction
        Camera rays, three-vectors of Dr.Jit arrays [m]; `direction` has unit length.
    light
        A point or spot light.
    low
        What rounding took from `direction`, if that is known (see `realtime.camera.ray_directions`).

    Notes
    -----
    Valid for any ray. A ray through the light has height 0.
    """
    import drjit as dr

    v = light.position - origin
    # The rounding error of the difference (Knuth's two_sum).
    of_origin = light.position - v
    v_low = (light.position - (v + of_origin)) + (of_origin - origin)
    d = direction
    cross = type(v)(
        difference_of_products(v.y, d.z, v.z, d.y),
        difference_of_products(v.z, d.x, v.x, d.z),
        difference_of_products(v.x, d.y, v.y, d.x),
    )
    cross += dr.cross(v_low, d)
    if low is not None:
        cross += dr.cross(v, low)
    foot = dr.dot(v, d)
    height = dr.norm(cross)
    if light.kind == "point":
        return RayGeometry(foot, height, None, None)
    perpendicular = d * foot - v
    return RayGeometry(foot, height, dr.dot(light.axis, d), dr.dot(light.axis, perpendicular))


def distance_to_light(geometry: RayGeometry, x):
    """Return r(x) = sqrt(height^2 + (x - foot)^2), the distance from the light to the point at `x` [m]."""
    import drjit as dr

    s = x - geometry.foot
    return dr.sqrt(dr.fma(s, s, geometry.height * geometry.height))


def clip_to_cone(geometry: RayGeometry, cos_angle, x0, x1):
    """Clip [x0, x1] to the part of the ray inside a cone around the axis of a spot.

    With s = x - foot, the point at x lies in the cone where (axial s + offset) >= cos_angle sqrt(s^2 + height^2).
    Squared,

        A s^2 + 2 B s + C >= 0,   A = axial^2 - cos^2,   B = axial offset,   C = offset^2 - cos^2 height^2,

    and (B^2 - A C) = cos^2 (offset^2 + height^2 A). The double cone loses its second nappe by the sign of axial s +
    offset: for A < 0 the solution is the interval between the roots, both on one nappe; for A > 0 it is a half line,
    beyond the larger root if axial > 0, before the smaller one otherwise.

    Parameters
    ----------
    geometry
        Rays and a spot.
    cos_angle
        Cosine of the half angle of the cone, in (0, 1).
    x0, x1
        The segment [m]; `x1` may be infinite.

    Returns
    -------
    x0, x1
        The clipped segment [m]; x1 = x0 where the segment misses the cone.
    """
    import drjit as dr

    axial, offset, height = geometry.axial, geometry.offset, geometry.height
    a = (axial - cos_angle) * (axial + cos_angle)
    b = axial * offset
    c = (offset - cos_angle * height) * (offset + cos_angle * height)
    discriminant = dr.square(cos_angle) * dr.fma(offset, offset, dr.square(height) * a)
    q = -(b + dr.mulsign(dr.sqrt(dr.maximum(discriminant, 0)), b))
    # The smaller root in magnitude is C/q, the other q/A: no cancellation, and A = 0 leaves an infinite root.
    root_a, root_b = q / a, c / q
    low, high = dr.minimum(root_a, root_b), dr.maximum(root_a, root_b)
    half_line = a >= 0
    begin = dr.select(half_line, dr.select(axial > 0, high, -dr.inf), low)
    end = dr.select(half_line, dr.select(axial > 0, dr.inf, low), high)
    middle = dr.select(half_line, dr.select(axial > 0, high, low), 0.5 * (low + high))
    hit = ((discriminant >= 0) | half_line) & ((axial * middle + offset) >= 0)
    begin = dr.select(hit, begin + geometry.foot, x0)
    end = dr.select(hit, end + geometry.foot, x0)
    x0_clipped = dr.clip(begin, x0, x1)
    return x0_clipped, dr.maximum(dr.clip(end, x0, x1), x0_clipped)


def stretches(geometry: RayGeometry, light: Light, x0, x1):
    """Cut [x0, x1] where a soft spot's `falloff` has kinks, at the cone of the beam; one stretch for other lights."""
    if not light.soft:
        return [(x0, x1)]
    inner0, inner1 = clip_to_cone(geometry, light.cos_beam, x0, x1)
    return [(x0, inner0), (inner0, inner1), (inner1, x1)]


def falloff(geometry: RayGeometry, light: Light, x):
    """Return the relative intensity of a spot at the point at `x`: Mitsuba's profile, linear in the angle [1].

    One inside the beam, zero outside the cut-off; between the two, (cutoff - angle) / (cutoff - beam).
    """
    import drjit as dr

    s = x - geometry.foot
    cosine = dr.fma(geometry.axial, s, geometry.offset) / distance_to_light(geometry, x)
    angle = dr.safe_acos(cosine)
    return dr.clip((light.cutoff - angle) * light.inverse_transition, 0, 1)
