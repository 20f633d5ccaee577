# SPDX-License-Identifier: BSD-3-Clause
"""Where a ray enters and leaves a cone about a spot's axis.

With v = light - origin, a unit direction d and a unit axis a, let w = v x d, whose length is the height h of the ray,
and let w x d = d (v . d) - v be the vector from the light to the foot point. The point at the distance s from the foot
lies in the cone of half angle b where

    axial s + offset >= cos(b) sqrt(s^2 + h^2),     axial = a . d,     offset = a . (w x d).

Squared, this is A s^2 + 2 B s + C >= 0 with

    A = axial^2 - cos^2,   B = axial offset,   C = offset^2 - cos^2 h^2,   B^2 - A C = cos^2 (offset^2 + h^2 A).

**The discriminant.** A ray that grazes the cone has two roots close to each other, and the sum in brackets cancels. But
d, (w x d)/h and w/h are three unit vectors at right angles, so with across = a . w

    axial^2 + (offset/h)^2 + (across/h)^2 = 1,     offset^2 + h^2 A = h^2 sin^2 - across^2
                                                                    = (h sin - |across|) (h sin + |across|).

One difference is left. It is zero where the ray is tangent to the cone; as a share of h the error of h and of across is
that of the share of the chord's square, so float32 loses half of its digits there, for the rounding errors of v, d, a,
sin and w enter alike. All of these are known (`realtime.error_free`): with the low parts of h, across and sin the
difference is right to rounding, unless it is below 1e-13 of h. A common factor of d, which its low part leaves open, is
one of h and across both.

**The roots.** They are -B/A -+ cos sqrt(...)/A. Where A is close to 0 the sum cancels for one of them, which then is
C/q, q = -B - sign(B) cos sqrt(...). But C cancels in turn, by up to axial^2 where the ray is tangent. So the first form
serves for A < -cos^2/2, that is axial^2 < cos^2/2, and the second one elsewhere: neither loses more than 2/cos^2.

**The nappe.** Squaring adds the nappe behind the light. For A < 0 both roots are on the same one, where axial s +
offset has the sign it has in their middle s = -B/A, hence that of offset: the solution is the interval between them, or
nothing. For A >= 0 there is one root on each, and the solution is a half line: beyond the larger root if axial > 0,
before the smaller one otherwise.
"""


def cone_interval(axial, offset, moments, cone):
    """Return the signed distances from the foot at which rays enter and leave a cone [m]; both -inf if they miss it.

    Parameters
    ----------
    axial
        Cosine between ray and axis.
    offset
        Component along the axis of the vector from the light to the foot [m].
    moments
        (h, across), each a pair of a number and its low part [m], see above.
    cone
        A `realtime.lights.Cone`.

    Notes
    -----
    Valid for half angles below 90 degrees. Half lines end at infinity.
    """
    import drjit as dr

    from realtime.error_free import two_product

    (height, height_low), (across, across_low) = moments
    cosine, square = cone.cos, dr.square(cone.cos)
    limit, limit_low = two_product(height, cone.sin)
    limit_low = dr.fma(height_low, cone.sin, dr.fma(height, cone.sin_low, limit_low))
    # Near a tangent the first difference is exact.
    margin = (limit - dr.abs(across)) + (limit_low - dr.mulsign(across_low, across))
    root = cosine * dr.sqrt(dr.maximum(margin, 0) * (limit + dr.abs(across)))
    a = (axial - cosine) * (axial + cosine)
    b = axial * offset
    c = (offset - cosine * height) * (offset + cosine * height)
    q = -(b + dr.mulsign(root, b))
    inverse = dr.rcp(a)
    middle, half = -b * inverse, dr.abs(root * inverse)
    root_a, root_c = q * inverse, c / q
    steep = a < -0.5 * square
    low = dr.select(steep, middle - half, dr.minimum(root_a, root_c))
    high = dr.select(steep, middle + half, dr.maximum(root_a, root_c))
    half_line, forward = a >= 0, axial > 0
    begin = dr.select(half_line, dr.select(forward, high, -dr.inf), low)
    end = dr.select(half_line, dr.select(forward, dr.inf, low), high)
    # A ray parallel to a line on the cone meets it at infinity, if at all.
    hit = dr.select(half_line, begin < dr.inf, (margin >= 0) & (offset >= 0))
    return dr.select(hit, begin, -dr.inf), dr.select(hit, end, -dr.inf)
