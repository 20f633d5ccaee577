# SPDX-License-Identifier: BSD-3-Clause
"""The geometry of a ray and a light: the foot of the perpendicular, the height, the lit part
of the ray, and the relative intensity there.

With v = l - w origin, the homogeneous vector from the camera to the light
(`realtime.scene.lights`), and a unit direction d, ``foot = v . d`` and ``height = |v x d|``. For a
light at infinity, w = 0, v has unit length, and foot and height are the cosine and the sine of the
angle between ray and light. The textbook form sqrt(|v|^2 - foot^2) cancels where the ray passes
close to the light: at height 1e-3 |v| it has no correct digit left in float32, and a difference of
products of rounded numbers has none either. Foot, height and the ends of the lit part are computed
once for a ray and a light, in float64, from the aim of the ray as the camera has it
(`realtime.scene.camera`), and are rounded at the end. Each component of the cross product is a
difference of two products, a b - c d. Kahan's form with fused multiply-add gives this difference to
1.5 units in the last place, so that v x d is at right angles to d however close to the light the
ray passes:

    w = c d;   e = fma(-c, d, w)   (the exact rounding error of w);   a b - c d = fma(a, b, -w) + e

A light sample with the normal n lights the half space before its plane; its profile is the cosine
of the angle to n. The vector from the light to the point of the ray at x, s = x - foot from the
foot, is (v x d) x d + s d, hence

    r cos = axial s + offset,     axial = n . d,     offset = n . ((v x d) x d).

The ray meets the plane where r cos = 0. The vector in brackets has the length of the height, so
that the cosine is right to rounding as close to the light as v x d is.

**Where a ray enters and leaves a cone about a spot's axis.**

With v = light - origin, a unit direction d and a unit axis a, let w = v x d, whose length is the
height h of the ray, and let w x d = d (v . d) - v be the vector from the light to the foot point.
The point at the distance s from the foot lies in the cone of half angle b where

    axial s + offset >= cos(b) sqrt(s^2 + h^2),     axial = a . d,     offset = a . (w x d).

Squared, this is A s^2 + 2 B s + C >= 0 with

    A = axial^2 - cos^2,   B = axial offset,   C = offset^2 - cos^2 h^2,
    B^2 - A C = cos^2 D,   D = offset^2 + h^2 A.

**The discriminant.** A ray that grazes the cone has two roots close to each other, and D cancels.
But d, (w x d)/h and w/h are three unit vectors at right angles, so with across = a . w

    axial^2 + (offset/h)^2 + (across/h)^2 = 1,     hence     D = h^2 sin^2 - across^2.

One difference remains, and it is zero where the ray is tangent. If rounding adds the fraction e of
h^2 to it, a chord of length 0 becomes one of sqrt(e) times the distance: half of float64's digits
are lost there, and the other half is as many as float32 has. An error in the length of d is a
common factor of h and across.

**The roots.** The end where A s + B > 0 is where the ray enters the cone, the
other where it leaves it,

    enter = (-B + cos sqrt(D)) / A,     leave = (-B - cos sqrt(D)) / A.

Where A is close to 0 one of the two roots cancels. That root is computed as C/q instead, with the
numerator of the other root, q = -B - sign(B) cos sqrt(D). But C cancels too, by up to axial^2 where
the ray is tangent. The first form therefore serves for A < -cos^2/2, which means axial^2 < cos^2/2,
and C/q elsewhere: neither loses more than 2/cos^2. A itself cancels for rays along lines on the
cone. The form h^2 A = D - offset^2 gives A with all digits where the ray is tangent; for rays along
a narrow beam, where axial and cos are both close to 1, it keeps the digits that axial^2 - cos^2
loses.

**The nappe.** Squaring adds the nappe behind the light. For A < 0 both roots are on the same one,
where axial s + offset has the sign that it has in their middle s = -B/A, which is the sign of
offset: the solution is the interval between them, or nothing. For A >= 0 there is one root on each,
and the solution is a half line: from `enter` on if axial > 0, else up to `leave`.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.scene.lights import Cone, Light


@dataclass(frozen=True)
class AxisGeometry:
    """Rays and the axis of a spot; names as above."""

    axial: Any
    offset: Any  # [m]
    height: Any  # [m]
    square: Any  # its square [m^2]
    across: Any  # [m]


def axis_geometry(w, direction, axis) -> AxisGeometry:
    """Return rays as a spot's axis sees them; `w` is v x d [m], all in float64."""
    # The triple product keeps its digits where the light is close to the ray.
    offset, square = dr.dot(axis, dr.cross(w, direction)), dr.squared_norm(w)
    return AxisGeometry(dr.dot(axis, direction), offset, dr.sqrt(square), square, dr.dot(axis, w))


def cone_interval(ray: AxisGeometry, cone: Cone):
    """Return the signed distances from the foot at which rays enter and leave a cone [m];
    both -inf if they miss it.

    Valid for half angles below 90 degrees. Half lines end at infinity. A ray through the light is
    in the cone on one side of it, or nowhere.
    """
    # D = h^2 sin^2 - across^2: below 0 the ray misses the cone as a line.
    discriminant = ray.square * cone.square_sin - dr.square(ray.across)
    # B, and C as a product: the difference of the squares would cancel near the edge of the cone.
    b = ray.axial * ray.offset
    c = (ray.offset - cone.cos * ray.height) * (ray.offset + cone.cos * ray.height)
    # A ray through the light has B = C = D = h = 0. `tiny` stands for its D and its h^2, so that
    # the signs of the roots remain.
    tiny = 2.0**-100
    root = cone.cos * dr.sqrt(dr.maximum(discriminant, tiny))
    q = -(b + dr.mulsign(root, b))
    # h^2 A = D - offset^2, which has all digits where the ray is tangent; `inverse` is 1/A.
    scaled = dr.fma(
        tiny, dr.abs(ray.axial) - cone.cos, dr.fma(-ray.offset, ray.offset, discriminant)
    )
    inverse = dr.maximum(ray.square, tiny) / scaled
    # Where A is close to 0, q/A is the root far from the foot and C/q the near one, without
    # cancellation. Rays steeper to the axis take (-B +- cos sqrt(D))/A, as C cancels for them.
    far, near = q * inverse, c / q
    middle, half = -b * inverse, root * inverse
    steep, swapped = dr.square(ray.axial) < 0.5 * dr.square(cone.cos), q < 0
    enter = dr.select(steep, middle + half, dr.select(swapped, near, far))
    leave = dr.select(steep, middle - half, dr.select(swapped, far, near))
    # For A > 0 there is one root on each nappe: the cone before the light is a half line.
    half_line, forward = inverse > 0, ray.axial > 0
    enter = dr.select(half_line & ~forward, -dr.inf, enter)
    leave = dr.select(half_line & forward, dr.inf, leave)
    # A ray parallel to a line on the cone meets it at infinity, if at all. For A < 0 both roots are
    # on the nappe of the sign of `offset`.
    hit = dr.select(half_line, enter < dr.inf, (discriminant >= 0) & (ray.offset >= 0))
    return dr.select(hit, enter, -dr.inf), dr.select(hit, leave, -dr.inf)


def axis_distance(ray: AxisGeometry) -> dict[str, Any]:
    """Return `slant`, `slide` and `gap`: the distance from the axis is sqrt((slant
    s - slide)^2 + gap^2) [m].

    Along d, (w x d)/h and w/h the point at s is (s, h, 0) from the light, the axis is (axial,
    offset/h, across/h), and the distance is the length of their cross product,

        sqrt((across/h)^2 (s^2 + h^2) + (axial h - (offset/h) s)^2).

    With n^2 = (offset/h)^2 + (across/h)^2 = 1 - axial^2 this is the sum of squares above for
    slant = n, slide = axial offset / n, gap = |across| / n.
    """
    # n h = sqrt(offset^2 + across^2).
    size = dr.sqrt(dr.fma(ray.offset, ray.offset, dr.square(ray.across)))
    # For a ray through the light only the sine remains, which loses digits only near the axis.
    sine = dr.sqrt(dr.maximum(dr.fma(-ray.axial, ray.axial, 1), 0))
    slant = dr.select(ray.height > 0, size / ray.height, sine)
    # A ray parallel to the axis is everywhere as far from the axis as from the light.
    parallel = size == 0
    slide = dr.select(parallel, 0, ray.axial * ray.height * (ray.offset / size))
    gap = dr.select(parallel, ray.height, ray.height * (dr.abs(ray.across) / size))
    return {"slant": slant, "slide": slide, "gap": gap}


@dataclass(frozen=True)
class RayGeometry:
    """Where a light lies as seen from a camera ray; every field has one entry per ray."""

    #: signed distance along the ray of the foot of the perpendicular from the
    #: light [m]; w = 0: a cosine
    foot: Any
    height: Any  #: distance from the light to the ray [m]; w = 0: a sine
    axial: Any = None  #: spot, light sample: cosine between the ray and the axis, or the normal
    #: spot, light sample: component along the axis, or the normal, of the vector from the light to
    #: the foot [m]
    offset: Any = None
    #: spot, light sample: distance at which the ray enters what is lit, -inf if it misses it [m]
    enter: Any = None
    #: spot, light sample: distance at which it leaves it, -inf if it misses it [m]
    leave: Any = None
    beam_enter: Any = None  #: soft spot only: the same for the cone of full intensity [m]
    beam_leave: Any = None
    slant: Any = None  #: soft spot only: sine between the ray and the axis
    #: soft spot only: slant times the distance from the foot to the point closest to the axis [m]
    slide: Any = None
    #: soft spot only: distance between the ray and the axis, as unbounded lines [m]
    gap: Any = None

    def lit_segment(self, x0, x1) -> tuple[Any, Any]:
        """Return the part of [x0, x1] that the light could reach, x1 = x0 where there is none [m].

        All of the ray is lit, except for a spot, which lights the part inside its cone, and a light
        sample, which lights the part before its plane.

        Parameters
        ----------
        x0, x1
            Distances along the rays [m]; `x1` may be infinite.
        """
        return (x0, x1) if self.enter is None else _clip(self.enter, self.leave, x0, x1)

    def distance_to_light(self, x):
        """Return r(x) = sqrt(height^2 + (x - foot)^2), the distance from the light
        to the point at `x` [m].
        """
        s = x - self.foot
        return dr.sqrt(dr.fma(s, s, self.height * self.height))

    def smooth_subsegments(self, light: Light, x0, x1):
        """Cut [x0, x1] [m] where a soft spot's `falloff` has kinks, at the cone of the
        beam; others are one piece.

        A ray that misses the beam is cut where it is closest to the axis: the closer it passes, the
        more like a kink. The last piece of an unbounded ray that stays in the beam is empty and
        lies at its beginning: at infinity kernels would multiply 0 by infinity. Valid for any
        segment.
        """
        if light.beam is None:
            return [(x0, x1)]
        inner0, inner1 = _clip(self.beam_enter, self.beam_leave, x0, x1)
        # The distance from the axis is least at s = slide/slant. Below a sine of 1e-6 between ray
        # and axis this distance is the same everywhere, and the ray has no closest point.
        crosses = self.slant > 1e-6
        closest = dr.clip(self.foot + dr.select(crosses, self.slide / self.slant, 0), x0, x1)
        misses = crosses & (inner0 >= inner1)
        inner0, inner1 = dr.select(misses, closest, inner0), dr.select(misses, closest, inner1)
        # The beam ends at infinity: the piece behind it is empty.
        stays = dr.isinf(inner1)
        return [
            (x0, inner0),
            (inner0, inner1),
            (dr.select(stays, x0, inner1), dr.select(stays, x0, x1)),
        ]

    def falloff_beside(self, light: Light, s):
        """Return `falloff` at `s` = x - foot [m]: for a light sample, x
        lacks the digits close to it.
        """
        if light.facing is None:
            return self.falloff(light, self.foot + s)
        square = dr.fma(s, s, dr.square(self.height))
        return dr.clip(dr.fma(self.axial, s, self.offset) * dr.rsqrt(square), 0, 1)

    def falloff(self, light: Light, x):
        """Return the relative intensity of a light at the point at `x`, for one that varies [1].

        A light sample has the cosine at its normal, 0 behind its plane. A spot has Mitsuba's
        profile, linear in the angle: one inside the beam, zero outside the cut-off; between the
        two, (cutoff - angle) / (cutoff - beam). The angle follows from the distances from the axis
        and along it: near the axis a cosine alone has lost it.
        """
        s = x - self.foot
        if light.facing is not None:
            return self.falloff_beside(light, s)
        # Distances of the point from the axis and along it [m].
        t = dr.fma(self.slant, s, -self.slide)
        away = dr.sqrt(dr.fma(t, t, dr.square(self.gap)))
        along = dr.fma(self.axial, s, self.offset)
        # `away` and `along` are R sin and R cos of the angle at the light, the arguments below R
        # sin and R cos of the cut-off minus this angle. Compute one angle: at the dim edge the
        # difference of two angles would cancel.
        cos, sin = (type(x)(value) for value in (light.cone.cos, dr.sqrt(light.cone.square_sin)))
        within = dr.atan2(sin * along - cos * away, dr.fma(cos, along, sin * away))
        return dr.clip(within * light.inverse_transition, 0, 1)


def ray_geometry(origin, direction, light: Light) -> RayGeometry:
    """Return foot and height of rays with respect to one light, and the part that it lights.

    Valid for any ray. A ray through the light, or parallel to the light, has height 0.

    Parameters
    ----------
    origin
        Where rays start, one for all or one each, a three-vector in any precision [m].
    direction
        Directions of any length, in any precision; their errors are those of the height.
    light
        Any light; the result has the precision of its arrays.
    """
    # All in float64: v = l - w origin, the unit direction d, and v x d by Kahan's form, which is
    # taken of the aim as the camera has it and divided by its length afterwards.
    aim = mi.Vector3d(direction)
    v = mi.Vector3d(light.position) - mi.Vector3d(origin) if light.w else -light.exact_axis
    inverse = dr.rcp(dr.norm(aim))
    d, w = aim * inverse, _cross(v, aim) * inverse
    fields = {"foot": dr.dot(v, d), "height": dr.norm(w)}
    if light.facing is not None:
        axial, offset = (
            dr.dot(light.facing.exact_normal, d),
            dr.dot(light.facing.exact_normal, dr.cross(w, d)),
        )
        # The plane of the light sample is where axial s + offset = 0; the ray is before it on the
        # side where the cosine grows.
        meets = fields["foot"] - offset / axial
        # A ray along the plane is before it as a whole, or nowhere.
        along = axial == 0
        enter = dr.select(axial > 0, meets, -dr.inf)
        leave = dr.select(axial < 0, meets, dr.select(along & (offset <= 0), -dr.inf, dr.inf))
        fields |= {"axial": axial, "offset": offset, "enter": enter, "leave": leave}
    elif light.cone is not None:
        # A spot lights the ray inside its cone, and with full intensity inside its beam.
        ray = axis_geometry(w, d, light.exact_axis)
        enter, leave = (fields["foot"] + s for s in cone_interval(ray, light.cone))
        fields |= {"axial": ray.axial, "offset": ray.offset, "enter": enter, "leave": leave}
        if light.beam is not None:
            begin, end = (fields["foot"] + s for s in cone_interval(ray, light.beam))
            fields |= {"beam_enter": begin, "beam_leave": end, **axis_distance(ray)}
    # All of it was computed in float64; now it gets the precision of the light.
    Float = type(light.position.x)
    return RayGeometry(**{name: Float(value) for name, value in fields.items()})


def _cross(a, b):
    def difference(i, j):
        # `w` is the rounded product, and the second fma is exactly what its rounding lost.
        w = a[j] * b[i]
        return dr.fma(a[i], b[j], -w) + dr.fma(-a[j], b[i], w)

    return type(a)(difference(1, 2), difference(2, 0), difference(0, 1))


def _clip(enter, leave, x0, x1):
    # A segment beside the interval becomes a point at its own nearer end.
    begin = dr.clip(enter, x0, x1)
    return begin, dr.maximum(dr.clip(leave, x0, x1), begin)


def profile(light: Light, point, away):
    """Return the relative intensity of a light in unit directions `away` from it, to points [m]."""
    if light.facing is not None:
        return dr.maximum(dr.dot(light.normal, away), 0)
    if light.cone is None:
        return type(away.x)(1)
    inside = dr.dot(light.axis, away) > light.cos_cutoff
    if light.beam is None:
        return dr.select(inside, type(away.x)(1), 0)
    # The point lies at x = 0 of a ray that starts there.
    return dr.select(inside, ray_geometry(point, away, light).falloff(light, type(away.x)(0)), 0)
