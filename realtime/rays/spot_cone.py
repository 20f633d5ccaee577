# SPDX-License-Identifier: BSD-3-Clause
"""Where a ray enters and leaves a cone about a spot's axis.

With v = light - origin, a unit direction d and a unit axis a, let w = v x d, whose length is the height h of the ray,
and let w x d = d (v . d) - v be the vector from the light to the foot point. The point at the distance s from the foot
lies in the cone of half angle b where

    axial s + offset >= cos(b) sqrt(s^2 + h^2),     axial = a . d,     offset = a . (w x d).

Squared, this is A s^2 + 2 B s + C >= 0 with

    A = axial^2 - cos^2,   B = axial offset,   C = offset^2 - cos^2 h^2,   B^2 - A C = cos^2 D,   D = offset^2 + h^2 A.

**The discriminant.** A ray that grazes the cone has two roots close to each other, and D cancels. But d, (w x d)/h and
w/h are three unit vectors at right angles, so with across = a . w

    axial^2 + (offset/h)^2 + (across/h)^2 = 1,     hence     D = h^2 sin^2 - across^2.

One difference is left, zero where the ray is tangent. A share e of h^2 that rounding adds to it changes a chord that is
sqrt(e) of the distance from nothing to that: half of float64's digits are lost there, and float32 has its own. A common
factor of d is one of h and across both.

**The roots.** The end where A s + B > 0 is where the ray enters the cone, the other where it leaves it,

    enter = (-B + cos sqrt(D)) / A,     leave = (-B - cos sqrt(D)) / A.

Where A is close to 0 one of them cancels, which then is C/q, q = -B - sign(B) cos sqrt(D) the numerator of the other.
But C cancels in turn, by up to axial^2 where the ray is tangent. So the first form serves for A < -cos^2/2, that is
axial^2 < cos^2/2, and C/q elsewhere: neither loses more than 2/cos^2. A itself cancels for rays along lines on the
cone. From h^2 A = D - offset^2 it has all digits where the ray is tangent, and keeps those that axial^2 - cos^2 loses
of rays along a narrow beam, where axial and cos are both close to 1.

**The nappe.** Squaring adds the nappe behind the light. For A < 0 both roots are on the same one, where axial s +
offset has the sign it has in their middle s = -B/A, hence that of offset: the solution is the interval between them, or
nothing. For A >= 0 there is one root on each, and the solution is a half line: from `enter` on if axial > 0, else up to
`leave`.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from realtime.scene.lights import Cone

_TINY = 2.0**-100


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
    """Return the signed distances from the foot at which rays enter and leave a cone [m]; both -inf if they miss it.

    Valid for half angles below 90 degrees. Half lines end at infinity. A ray through the light is in the cone on one
    side of it, or nowhere.
    """
    discriminant = ray.square * cone.square_sin - dr.square(ray.across)
    # For a ray through the light only the signs remain, times `_TINY`.
    b = ray.axial * ray.offset
    c = (ray.offset - cone.cos * ray.height) * (ray.offset + cone.cos * ray.height)
    root = cone.cos * dr.sqrt(dr.maximum(discriminant, _TINY))
    q = -(b + dr.mulsign(root, b))
    scaled = dr.fma(_TINY, dr.abs(ray.axial) - cone.cos, dr.fma(-ray.offset, ray.offset, discriminant))
    inverse = dr.maximum(ray.square, _TINY) / scaled
    far, near = q * inverse, c / q
    middle, half = -b * inverse, root * inverse
    steep, swapped = dr.square(ray.axial) < 0.5 * dr.square(cone.cos), q < 0
    enter = dr.select(steep, middle + half, dr.select(swapped, near, far))
    leave = dr.select(steep, middle - half, dr.select(swapped, far, near))
    half_line, forward = inverse > 0, ray.axial > 0
    enter = dr.select(half_line & ~forward, -dr.inf, enter)
    leave = dr.select(half_line & forward, dr.inf, leave)
    # A ray parallel to a line on the cone meets it at infinity, if at all.
    hit = dr.select(half_line, enter < dr.inf, (discriminant >= 0) & (ray.offset >= 0))
    return dr.select(hit, enter, -dr.inf), dr.select(hit, leave, -dr.inf)


def axis_distance(ray: AxisGeometry) -> dict[str, Any]:
    """Return `slant`, `slide` and `gap`: the distance from the axis is sqrt((slant s - slide)^2 + gap^2) [m].

    Along d, (w x d)/h and w/h the point at s is (s, h, 0) from the light, the axis is (axial, offset/h, across/h), and
    the distance is the length of their cross product,

        sqrt((across/h)^2 (s^2 + h^2) + (axial h - (offset/h) s)^2).

    With n^2 = (offset/h)^2 + (across/h)^2 = 1 - axial^2 this is the sum of squares above for slant = n, slide =
    axial offset / n, gap = |across| / n.
    """
    size = dr.sqrt(dr.fma(ray.offset, ray.offset, dr.square(ray.across)))
    # For a ray through the light only the sine remains, which loses digits only near the axis.
    sine = dr.sqrt(dr.maximum(dr.fma(-ray.axial, ray.axial, 1), 0))
    slant = dr.select(ray.height > 0, size / ray.height, sine)
    parallel = size == 0
    slide = dr.select(parallel, 0, ray.axial * ray.height * (ray.offset / size))
    gap = dr.select(parallel, ray.height, ray.height * (dr.abs(ray.across) / size))
    return {"slant": slant, "slide": slide, "gap": gap}
