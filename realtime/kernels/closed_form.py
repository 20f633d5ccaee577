# SPDX-License-Identifier: BSD-3-Clause
"""The closed form of Pegoraro and Parker 2009: a difference of complex exponential integrals.

With E = q/h (path form of DESIGN section 2), a = sigma_t h and u = 1/(1 + E^2),

    J = (2/h) exp(-sigma_t foot) int_{E0}^{E1} exp(-a E) p u dE.

**Isotropic.** Since 1/(E - i) = (E + i) u and int_E^inf exp(-a E')/(E' - i) dE' = exp(-i a)
E1(a (E - i)), the tails

    T_m = int_E^inf exp(-a E') u^m dE',      U_m = int_E^inf exp(-a E') E' u^m dE'

begin with U_1 + i T_1 = exp(-a E) S(z), where z = a (E - i) and S(z) = exp(z) E1(z) is scaled and
never overflows. Arguments have Re z >= 0 and Im z <= 0, away from the branch cut. From E0 = 0 this
is the published F(a, v) = Im(exp(-i a) [E1(-i a) - E1(a tan v - i a)]).

**Polynomials in the cosine.** cos = (1 - E^2)/(1 + E^2) = 2 u - 1, so a phase function that is a
polynomial in the cosine is one in u, and the lobes ((1 + cos)/2)^n are single powers: Rayleigh is
3/2 - 3 u + 3 u^2, hazy (1 + 9 u^8)/2, murky 33/83 (1 + 50 u^32). Powers of u follow by parts, from
the derivatives of exp(-a E) u^m and exp(-a E) E u^m:

    2 m U_{m+1} = B_m - a T_m,                          B_m = exp(-a E) u^m,
    2 m T_{m+1} = (2 m - 1) T_m + a U_m - E B_m.

Both steps hand on the errors of T_m and U_m: T's times (2 m - 1)/(2 m) < 1, and by way of U times
a^2/(4 m (m - 1)) over two steps, altogether at most (a/2)^n/n! after n steps and never more than
exp(a/2). Each step adds the rounding of its terms, which is below the rounding of T_1 and U_1:
where E is large, T_m is smaller than this rounding and lost, but its fraction of J is then as
small. Degree 32 is therefore no harder than degree 8, until a is large: at a = 20 (murky) float32
still has four digits and float64 thirteen, at a = 60 float32 has none and float64 two.

**S(z).** For |z| < R the series S = exp(z) (-gamma - log z - sum_k (-z)^k/(k k!)), whose terms grow
like exp(|z|); beyond, Stieltjes' continued fraction 1/(z + 1 - 1/(z + 3 - 4/(z + 5 - 9/(z + 7 -
...)))) from the tail up, n levels. Its error falls like exp(-4 sqrt(n) Re sqrt(z)), slowest on the
imaginary axis. Counts are fixed for each precision, by the error that they leave there; a test on
the change from one level to the next would stop too early or never. In the fraction all terms that
make Im w agree in sign, so Im S keeps its relative accuracy where it is tiny.
"""

import drjit as dr

from airlight.errors import InputError
from airlight.realtime.kernels.exact import path_over_height
from airlight.realtime.numerics.array_types import is_single, smallest
from airlight.realtime.rays import RayGeometry
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.medium import Homogeneous
from airlight.realtime.scene.phase import PHASES


def closed_form(geometry: RayGeometry, x0, x1, medium: Homogeneous, light: Light):
    """Return the airlight integral J by complex exponential integrals [1/m].

    Valid for any extinction, vacuum included, and x1 infinite; a segment of zero length gives 0. J
    is the difference of two tails, so its relative error is a few roundings times (tail0 +
    tail1)/J, in float32 6e-8 times that. This is harmless where the segment holds most of the light
    that comes from beyond its near end; it leaves nothing, and can turn the result negative, for
    slivers and for segments that end well before the foot point, most of all with small h, where a
    tail is about pi/h. Hazy and murky lose a factor of up to exp(sigma_t h/2) more (see the
    module): nothing is left in float32 at sigma_t h = 60, and in float64 of murky at 80. Height 0
    is replaced by 1e-9 (float64: 1e-17) of the distances: harmless beyond the light, useless before
    it. A ray through the light gives a large number instead of +inf.

    Pegoraro, Parker 2009, *An analytical solution to single scattering in homogeneous participating
    media*, Computer Graphics Forum 28(2); Pegoraro, Schott, Parker 2009, *An analytical approach to
    single scattering for anisotropic media and light distributions*, Graphics Interface, for
    polynomials in the cosine.

    Parameters
    ----------
    geometry, x0, x1, medium, light
        As for `realtime.kernels.registry.Kernel`.

    Raises
    ------
    InputError
        For Henyey-Greenstein and tabulated phase functions, which are no polynomials, for a spot
        that falls off inside its cone, and for a light sample.
    """
    polynomial = medium.phase.polynomial
    if polynomial is None:
        polynomials = ", ".join(phase.name for phase in PHASES if phase.polynomial)
        raise InputError(
            f"kernel closed-form: phase function {medium.phase.name!r} is no polynomial in the "
            f"cosine; use the kernel 'quadrature' or one of {polynomials}"
        )
    if light.varies:
        raise InputError(
            "kernel closed-form: a spot that falls off between beam and cut-off, or an area light, "
            "has no closed form here; use the kernel 'quadrature', or a spot with beam_width = "
            "cutoff_angle"
        )
    foot, h = geometry.foot, geometry.height
    Float = type(h)
    # J is even in h, so a height below the rounding of the distances is as good as zero, and
    # this one keeps E = q/h finite, unless the segment begins at the light itself.
    floor = 1e-9 if is_single(Float) else 1e-17
    h = dr.maximum(h, floor * (dr.abs(x0 - foot) + smallest(Float)))

    # The integral between the ends is the tail of the near end less the tail of the far end.
    def integral(sigma_t):
        return (2 / h) * (
            _tail(foot, h, x0, sigma_t, polynomial) - _tail(foot, h, x1, sigma_t, polynomial)
        )

    return medium.per_extinction(integral)


def _tail(foot, h, x, sigma_t, polynomial):
    """Return exp(-sigma_t foot) int_E^inf exp(-a E') p u dE' for the E of the point at `x`."""
    s = x - foot
    r = dr.sqrt(dr.fma(s, s, h * h))
    e = path_over_height(s, r, h)
    # U_1 and T_1, without their factor exp(-a E).
    tail_u, tail_t = scaled_e1(e, sigma_t * h)
    a = sigma_t * h
    u = dr.rcp(dr.fma(e, e, 1))
    # All tails below leave out the factor exp(-a E), and so does B_m = u^m.
    total, power = polynomial[0] * tail_t, type(h)(1)
    for m in range(1, len(polynomial)):
        # By parts, from T_m and U_m to T_{m+1} and U_{m+1} (module); `power` is u^m.
        power = power * u
        tail_t, tail_u = (
            dr.fma(2 * m - 1, tail_t, dr.fma(a, tail_u, -e * power)) / (2 * m),
            dr.fma(-a, tail_t, power) / (2 * m),
        )
        if polynomial[m]:
            total = dr.fma(polynomial[m], tail_t, total)
    # The factor that the tails leave out: a E + sigma_t foot = sigma_t (x + r). Behind a point at
    # infinity nothing is left, and the terms above are no numbers there.
    return dr.select(dr.isinf(r), 0, dr.exp(-sigma_t * (x + r)) * total)


def scaled_e1(e, a):
    """Return real and imaginary part of exp(z) E1(z) for z = a (e - i).

    `e`, `a`: Dr.Jit arrays [1], e >= 0 and a >= 0. At a = 0 the imaginary part is
    atan(1/e), the real part large.

    Valid for |z| up to 1e18 in float32. The imaginary part errs by at most 1e-5 of itself in
    float32 and 1e-13 in float64, just inside the circle at large e, and by about one rounding in
    the median; the real part by as little of |S|.
    """
    # Radius of the series, its terms, levels of the fraction, in float32 and float64. On the
    # circle |z| = R the series has lost a factor of 5 (float32) and 40 (float64) by cancellation,
    # the fraction stops below one rounding.
    radius, terms, levels = (1.0, 12, 42) if is_single(type(a)) else (2.0, 30, 90)
    x, y = a * e, -a
    inside = dr.fma(x, x, y * y) < radius * radius
    # Outside of the circle exp(x) and the powers may overflow: those lanes sum the series at z = 0,
    # and take the fraction.
    near_x, near_y = dr.select(inside, x, 0), dr.select(inside, y, 0)
    near = _series(near_x, near_y, dr.atan2(type(a)(1), e), terms)
    far = _fraction(x, y, levels)
    return dr.select(inside, near[0], far[0]), dr.select(inside, near[1], far[1])


def _series(x, y, argument, terms: int):
    """Return S(x + i y), where `argument` = -arg z is known better than z: it is
    atan(1/e), at a = 0 too.
    """
    Float = type(x)
    # log |z| with the larger component taken out, so that no square under- or overflows; the
    # maximum with 1 serves z = 0 alone, where both ratios are 0.
    magnitude = dr.maximum(dr.maximum(dr.abs(x), dr.abs(y)), smallest(Float))
    ratio_x, ratio_y = x / magnitude, y / magnitude
    log_z = dr.log(magnitude) + 0.5 * dr.log(
        dr.maximum(dr.fma(ratio_x, ratio_x, ratio_y * ratio_y), 1)
    )
    # Horner's scheme of -sum_{k>=1} (-z)^k/(k k!) = z (1 - z/4 (1 - 2 z/9 (1 - 3 z/16 ...))).
    real, imaginary = Float(1), Float(0)
    for k in range(terms - 1, 0, -1):
        factor = -k / (k + 1) ** 2
        real, imaginary = (
            dr.fma(factor, dr.fma(x, real, -y * imaginary), 1),
            factor * dr.fma(x, imaginary, y * real),
        )
    real, imaginary = dr.fma(x, real, -y * imaginary), dr.fma(x, imaginary, y * real)
    # -gamma - log z, whose imaginary part is -arg z.
    euler = 0.57721566490153286
    real, imaginary = real - (log_z + euler), imaginary + argument
    # Times exp(z) = exp(x) (cos y + i sin y).
    sine, cosine = dr.sincos(y)
    grown = dr.exp(x)
    return grown * dr.fma(cosine, real, -sine * imaginary), grown * dr.fma(
        cosine, imaginary, sine * real
    )


def _fraction(x, y, levels: int):
    """Return S(x + i y) by the continued fraction, from level `levels` up."""
    Float = type(x)

    # From w = z + 2 n + 1 up, w -> z + 2 k - 1 - k^2/w for k = n to 1; the fraction is 1/w.
    def step(k, real, imaginary):
        inverse = k * k / dr.fma(real, real, imaginary * imaginary)
        return k - 1, dr.fma(-inverse, real, x + (2 * k - 1)), dr.fma(inverse, imaginary, y)

    start = (Float(levels), x + (2 * levels + 1), y)
    _, real, imaginary = dr.while_loop(start, lambda k, real, imaginary: k > 0, step)
    inverse = dr.rcp(dr.fma(real, real, imaginary * imaginary))
    return real * inverse, -imaginary * inverse
