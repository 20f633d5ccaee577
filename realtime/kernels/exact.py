# SPDX-License-Identifier: BSD-3-Clause
"""The default kernel: as few Gauss-Legendre nodes as a segment needs, placed by the
phase function's own lobe.

With E = q/h (q = (x - foot) + r, the path form of DESIGN section 2),

    J = (2/h) exp(-sigma_t (x0 + r0)) int_{E0}^{E1} exp(-sigma_t h (E - E0)) p / (1 + E^2) dE,
    sin^2(angle/2) = E^2/(1 + E^2),   cos^2(angle/2) = 1/(1 + E^2).

The integrand varies on two scales. The extinction and 1/(1 + E^2) vary at E ~ 1; a forward lobe
varies at a smaller E. The lobe of Henyey and Greenstein with g > 0 has the branch points E = +-i d,
d = (1 - g)/(1 + g), so close to the real axis that nodes in asinh E, even below E = 1, step over
it. The substitution

    E = d sinh v,     dE = d cosh v dv

is even where E < d and logarithmic above. It takes both pairs of singularities, +-i d and the poles
+-i of 1/(1 + E^2) (and the branch points +-i/d of a backward lobe), to |Im v| = pi/2, whatever g
is: one panel serves, and no cut at the foot point. For the lobes cos^16 and cos^64 of half the
angle ("hazy", "murky"), whose poles lie at +-i already, d is their width.

Every segment takes as many panels of eight nodes as its width in v and its optical depth ask for;
in float32 a short segment takes four nodes in x instead. Both leave less than 1e-6. In float64 a
panel has 22 nodes, which leave 1e-6 to the power of 22/8, 1e-16, and holds more depth: by the bound
below 22 nodes leave 1e-20 of T = 24.

**Panels** of Gauss-Legendre nodes: every ray takes as many as its segment
needs. The integral in v is

    I = int_{v0}^{v1} exp(-a (E - E0)) P(E) d cosh v dv,     a = sigma_t h,     P = p/(1 + E^2).

**How many panels.** P has its singularities at |Im v| = pi/2. On a panel of half width D, Gauss's
rule with n nodes is wrong by about M rho^(-2n), where rho = H + sqrt(1 + H^2), H = pi/(2 D), is the
size of the largest ellipse about the panel that holds none of them (Trefethen 2013, theorem 19.3)
and M the largest value of the integrand on it: for a given accuracy a panel may have some width,
whatever the ray. Two things make M large. Lobes of a high power of 1/(1 + E^2) grow steeply towards
their poles; their panels are narrower. And the extinction, bounded by 1 where Re E > E0, grows to
the left of the panel like exp(T t), with t the distance in widths of the panel and

    T = a d cosh(v0) (v1 - v0)

the optical depth that the segment would have, if all of it were as dense in v as its beginning. For
a pure exponential the rule errs by less than T^2n (n!)^4 / ((2n + 1) (2n)!^3) of the first value,
4e-7 for n = 8 and T = 10.5: a panel may also have some T. Hence there are

    m = ceil(max((v1 - v0)/w, T/T1))

equal panels. w is the largest width at which the error of the rule is at most 1e-6 of any panel,
found for each phase function (`realtime.scene.rule_reach`); `tests/realtime/kernels/test_exact.py`
tries random rays.

**Cost.** All rays of a packet take part in as many steps as the one that needs most, no more.
Panels of a ray are equally wide: sinh and cosh of the offsets of the nodes are the same in each,
and computed once. From the start of a panel, with F = E/d and C = sqrt(1 + F^2) there,

    F' - F = F (cosh u - 1) + C sinh u,     C' = C cosh u + F sinh u,

are sums of positive terms, for its nodes and for its end, where the next begins. The extinctions of
a coloured medium share all but the exponential: the smallest one sets the range, the largest one T.

Against the panels of any medium (`realtime.scene.media.integrate`), which differ by 4e-7 of the
brightest pixel, this kernel takes half of the time in `open-fog` (26 and 57 ms, unshadowed, 400 x
300), where rays have no end, and a twentieth less in `hall` (288 and 303 ms, shadow planes, 800 x
600, 29 November 2026, processor time in turns).

**Segments that are short** compared with their distance from the light have few nodes, in float32.
Between the edges of shadows most segments are short. Over them the integrand of

    J = int_{x0}^{x1} exp(-sigma_t (x + r)) p/r^2 dx,     r^2 = s^2 + h^2,     s = x - foot,

needs no substitution. It has singularities where r vanishes, s = +-i h; the singularities of p are
no closer: with E = (s + r)/h, dE/ds = E/r, and E is never closer to +-i d, the singularities of a
lobe, than to 0. Over a segment of the length L all of them are therefore r/L or more lengths away,
r being the least distance between segment and light, and Gauss's rule converges as fast for every
ray with the same r/L (by the theorem above). The exponent changes fastest at the end, by sigma_t
(1 + s1/r1) a metre.

A segment is short where L/r and sigma_t (1 + s1/r1) L are below limits up to which four nodes leave
no more than 1e-6, wherever the segment lies (`realtime.scene.rule_reach` again). Nodes are places
s0 + f L, s0 = x0 - foot: close to the light, x itself lacks the digits.
"""

from collections.abc import Callable
from functools import reduce
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.numerics.array_types import is_single, smallest
from airlight.realtime.numerics.functions import (
    LOG2_E,
    exp2_bounded,
    exp_bounded,
    sinh_bounded,
    unit_nodes,
)
from airlight.realtime.rays import RayGeometry
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.medium import Homogeneous, half_angle, optical_reach
from airlight.realtime.scene.phase import Phase
from airlight.realtime.scene.rule_reach import FEW_DEPTH, FEW_NODES, PANEL_DEPTH, PANEL_NODES


def is_short(geometry: RayGeometry, x0, x1, extinctions, phase: Phase):
    """Return whether the rule of few nodes serves segments [x0, x1] [m]; False
    where a value is not finite.

    Length and depth share the error that is allowed: each alone may reach its limit, both
    together an ellipse between the limits.
    """
    s0, length, height_squared = x0 - geometry.foot, x1 - x0, dr.square(geometry.height)
    s1 = s0 + length
    # The place of the segment that is closest to the light, counted from the foot.
    nearest = dr.clip(0, s0, s1)
    # sigma_t (1 + s1/r1) L of the largest extinction, and (L/r)^2, infinite at the light.
    rate = dr.fma(s1, dr.rsqrt(dr.fma(s1, s1, height_squared)), 1) * reduce(dr.maximum, extinctions)
    square = dr.square(length) * dr.rcp(dr.fma(nearest, nearest, height_squared))
    return dr.fma(square, 1 / phase.reach.few**2, dr.square(rate * length) * (1 / FEW_DEPTH**2)) < 1


def short_segment(geometry: RayGeometry, x0, x1, phase: Phase, extinctions):
    """Return J of short segments for each extinction [1/m].

    `geometry`, `x0`, `x1`: see `realtime.kernels`; `phase`: the phase function;
    `extinctions`: one or more [1/m].
    """
    s0, length, height_squared = x0 - geometry.foot, x1 - x0, dr.square(geometry.height)
    totals = [type(length)(0) for _ in extinctions]
    for fraction, node_weight in unit_nodes(FEW_NODES):
        # The node is s0 + f L: close to the light, x itself lacks the digits.
        step = length * fraction
        s = s0 + step
        square = dr.fma(s, s, height_squared)
        inverse = dr.rsqrt(square)
        r = square * inverse
        # p/r^2 is the same for all extinctions; only exp(-sigma_t (x + r)) differs.
        value = node_weight * dr.square(inverse)
        if not phase.constant:
            value *= phase.evaluate_half(*half_angle(s, r, inverse, height_squared))
        path = x0 + (step + r)
        totals = [
            dr.fma(value, exp_bounded(-sigma_t * path), total)
            for sigma_t, total in zip(extinctions, totals)
        ]
    return [total * length for total in totals]


#: no segment needs as many, but a loop over values that are not numbers must end too
MOST_PANELS = 160
DEEPEST = 116.0  #: power of 2 beyond which nothing is left: e^-80


def panels_mean(
    phase: Phase,
    start,
    scale,
    width,
    decays,
    weight: Callable[[Any], Any] | None,
    *,
    nodes: int = PANEL_NODES,
    most: float = PANEL_DEPTH,
):
    """Return I/(d (v1 - v0)), the mean over the range of v, for each extinction [1].

    `phase`: the phase function; `start`: (F, C), sinh and cosh of v0; `scale`: d, see above;
    `width`: v1 - v0; 0 where there is nothing to integrate; `decays`: a = sigma_t h, one or more;
    `weight`: relative intensity of the light by E, or None where it is 1 everywhere; `nodes`,
    `most`: of a panel, and T1.

    Valid for any decay. The values are 0 where e^-80 is.
    """
    Float = type(width)
    f, c = start
    largest = reduce(dr.maximum, decays)
    # m = ceil(max((v1 - v0)/w, T/T1)) panels, T by the largest extinction.
    count = panel_count(phase, width, largest * scale * c * width / most, soft=weight is not None)
    part_of_all = dr.rcp(dr.maximum(Float(count), 1))
    part = width * part_of_all
    # All panels of a ray are equally wide: sinh u and cosh u - 1 of the nodes, and of the end of a
    # panel, are the same in each.
    offsets = [
        (node_weight, *_offset(part * fraction)) for fraction, node_weight in unit_nodes(nodes)
    ]
    sinh_end, less_end = _offset(part)
    # How fast the transmittance falls with F, in powers of 2. Not 0 in a vacuum, where Dr.Jit would
    # see a depth that no turn of the loop changes, and drop it from the state.
    rates = [dr.minimum(-decay * scale * LOG2_E, -1e-30) for decay in decays]

    def panel(index, f, c, depths, totals):
        for node_weight, sinh, less in offsets:
            # F' - F and C' of the node, sums of positive terms; the density is P cosh v.
            step = dr.fma(f, less, c * sinh)
            value = node_weight * phase.density(
                f + step, dr.fma(f, sinh, dr.fma(c, less, c)), scale
            )
            if weight is not None:
                value *= weight(scale * (f + step))
            transmittances = [
                _transmittance(dr.fma(rate, step, depth)) for rate, depth in zip(rates, depths)
            ]
            totals = [
                dr.fma(value, transmittance, total)
                for transmittance, total in zip(transmittances, totals)
            ]
        # The end of the panel, where the next one begins.
        step = dr.fma(f, less_end, c * sinh_end)
        c = dr.fma(f, sinh_end, dr.fma(c, less_end, c))
        return (
            index + 1,
            f + step,
            c,
            [dr.fma(rate, step, depth) for rate, depth in zip(rates, depths)],
            totals,
        )

    # The state of the loop is as wide as all that it reads, and starts at the beginning of the
    # segment with no depth and no light.
    lanes = dr.zeros(Float, dr.width(width, f, *decays))
    none = [lanes + 0 for _ in decays]
    *_, totals = dr.while_loop(
        state=(
            mi.UInt32(0) + dr.zeros(mi.UInt32, dr.width(lanes)),
            f + lanes,
            c + lanes,
            none,
            [*none],
        ),
        cond=lambda index, f, c, depths, totals: index < count,
        body=panel,
        labels=("index", "f", "c", "depths", "totals"),
    )
    # The weights of each panel add up to 1, and the panels are equal: the mean over the panels.
    return [total * part_of_all for total in totals]


def _transmittance(depth):
    return exp2_bounded(dr.maximum(depth, -DEEPEST))


def panel_count(phase: Phase, width, depths, *, soft: bool = False):
    """Return the number of panels m of segments of some width in v, and T/T1
    [1]; 0 where the width is 0.
    """
    Float = type(width)
    widest = phase.panel_width(Float)
    # The falloff of a light that varies is no part of the phase function's w: at most 0.85 then.
    if soft:
        widest = dr.minimum(widest, 0.85)
    count = dr.maximum(width / widest, depths)
    # As whole numbers: a minimum of floats lets through what is no number, as 2^32 - 1 panels.
    return dr.select(width > 0, dr.minimum(mi.UInt32(dr.ceil(count)), MOST_PANELS), 0)


def _offset(u):
    """Return sinh u and cosh u - 1."""
    if is_single(type(u)):
        half = sinh_bounded(0.5 * u)
        double = 2 * half
        return double * dr.sqrt(dr.fma(half, half, 1)), double * half
    grown = dr.exp(u)  # what cancels where u is small moves a node by a rounding error
    shrunk = dr.rcp(grown)
    return 0.5 * (grown - shrunk), 0.5 * (grown + shrunk) - 1


def exact(geometry: RayGeometry, x0, x1, medium: Homogeneous, light: Light):
    """Return the airlight integral J to the accuracy of the arithmetic [1/m].

    Valid for any extinction, vacuum included; for any ray, a light on its line beside the segment
    (height 0) included; for any segment, unbounded or of length 0; and for |g| < 1. Where the ray
    meets the light (height 0) on the segment, its ends included, the integral is infinite, and so
    is the result.

    Largest relative error found on the certified cases: see `airlight study integrals`; in float32
    below 3e-5 for |g| <= 0.9. A tabulated phase function is integrated across its kinks, which is
    wrong by up to a quarter of the largest second difference of its values, relative to them: 7e-4
    was found with 513 values of "murky", 1.8e-3 with 129. Where a spot's intensity falls off
    between beam and cut-off, the segment is cut into three; empty pieces cost nothing.

    Parameters
    ----------
    geometry, x0, x1, medium, light
        As for `realtime.kernels.registry.Kernel`.
    """
    # The extinctions share their nodes.
    J = medium.colour(_by_extinction(geometry, (x0, x1), medium.sigma_t, medium.phase, light))
    # The ray passes through the light within a segment that is not empty: 1/r^2 has no integral.
    meets = (geometry.height == 0) & (x0 <= geometry.foot) & (geometry.foot <= x1) & (x0 < x1)
    return dr.select(meets, dr.inf, J)


def _by_extinction(geometry: RayGeometry, segment, extinctions, phase: Phase, light: Light):
    """Return J for each extinction, by the rule that the segment asks for [1/m]."""
    # A branch hands no derivatives on to the values that it reads from outside. The panels serve
    # all segments without one.
    single = is_single(type(geometry.height))
    if (
        not single
        or light.varies
        or phase.edge is not None
        or dr.grad_enabled(segment, (geometry.foot, geometry.height), extinctions, phase)
    ):
        return _over_subsegments(geometry, segment, extinctions, phase, light)
    # A branch, not a selection: where all rays of a packet have one kind of segment, they do not
    # pay for the other rule.
    x0, x1 = segment
    return dr.if_stmt(
        args=(x0, x1),
        cond=is_short(geometry, x0, x1, extinctions, phase),
        true_fn=lambda x0, x1: short_segment(geometry, x0, x1, phase, extinctions),
        false_fn=lambda x0, x1: _subsegment(geometry, x0, x1, extinctions, phase, light),
    )


def path_interval(geometry: RayGeometry, x0, x1, sigma_t, *, tail=1.0):
    """Return the height [m], E = q/h at both ends of [x0, x1] [m], and their difference
    without cancellation [1].

    The far end is brought to where extinction or p/(1 + E^2) have left nothing behind it. `tail` is
    the E from which on p/(1 + E^2) falls like 1/E^2: 1, or where a backward lobe ends. `sigma_t` is
    the extinction [1/m]. Valid for any segment.
    """
    foot, h = geometry.foot, geometry.height
    Float = type(h)
    single = is_single(Float)
    # J is even in h, so a height below rounding of the distances is as good as zero, and
    # this one keeps E finite, unless the segment begins at the light itself.
    s0, s1 = x0 - foot, x1 - foot
    h = dr.maximum(h, (1e-9 if single else 1e-17) * (dr.abs(s0) + smallest(Float)))
    r0 = dr.sqrt(dr.fma(s0, s0, h * h))
    e0 = path_over_height(s0, r0, h)
    # Beyond the first term extinction has left e^-20 (e^-40); beyond the second, p/(1+E^2) has.
    extinction = dr.maximum(sigma_t * h, smallest(Float))
    reach = dr.minimum(optical_reach(Float) / extinction, (1e7 if single else 1e12) * (tail + e0))
    # An infinite end is clipped below, whatever finite place stands for it here.
    s1 = dr.select(dr.isfinite(s1), s1, 0)
    r1 = dr.sqrt(dr.fma(s1, s1, h * h))
    e1 = path_over_height(s1, r1, h)
    clipped = dr.isinf(x1) | (e1 > e0 + reach)
    e1 = dr.select(clipped, e0 + reach, e1)
    # q1 - q0 = (x1 - x0) (q0 + q1)/(r0 + r1), of positive sums.
    return h, e0, e1, dr.select(clipped, reach, (x1 - x0) * (e0 + e1) / (r0 + r1))


def path_over_height(s, r, h):
    """Return E = q/h from s = x - foot, r and the height, without cancellation."""
    # q = s + r = h^2/(r - s): before the foot, s < 0, the second form takes no difference.
    behind = s >= 0
    return dr.select(behind, s + r, h) / dr.select(behind, h, r - s)


def _over_subsegments(geometry: RayGeometry, segment, extinctions, phase: Phase, light: Light):
    """Return J for each extinction, by panels, over the pieces where light and phase function
    are smooth [1/m].
    """
    pieces = geometry.smooth_subsegments(light, *segment)
    if phase.edge is not None:
        # s = h (E - 1/E)/2, as in `falloff_by_path`.
        edge = dr.fma(0.5 * (phase.edge - 1 / phase.edge), geometry.height, geometry.foot)
        cuts = [(a, dr.clip(edge, a, b), b) for a, b in pieces]
        pieces = [piece for a, cut, b in cuts for piece in ((a, cut), (cut, b))]
    parts = [_subsegment(geometry, a, b, extinctions, phase, light) for a, b in pieces]
    return [sum(values) for values in zip(*parts)]


def _subsegment(geometry: RayGeometry, x0, x1, extinctions, phase: Phase, light: Light):
    Float = type(geometry.height)
    scale, tail = phase.lobe_scales(Float)
    # By the bound of the module, 22 nodes leave 1e-20 of T = 24 in float64.
    nodes, most = (PANEL_NODES, PANEL_DEPTH) if is_single(Float) else (22, 24.0)
    # The extinctions share their nodes, over the range of the smallest one.
    h, start, width = range_of_v(geometry, x0, x1, reduce(dr.minimum, extinctions), scale, tail)
    decays = [sigma_t * h for sigma_t in extinctions]
    weight = falloff_by_path(geometry, light, h)
    means = panels_mean(phase, start, scale, width, decays, weight, nodes=nodes, most=most)
    # J = (2/h) exp(-sigma_t (x0 + r0)) I, and I is its mean times d (v1 - v0).
    shared = (width * scale) * (2 / h)
    return [
        mean * shared * transmittance_before(geometry, x0, h, sigma_t)
        for mean, sigma_t in zip(means, extinctions)
    ]


def range_of_v(geometry: RayGeometry, x0, x1, sigma_t, scale=1.0, tail=1.0):
    """Return the height [m], (F, C) at the beginning of a segment, and its length in v."""
    h, e0, e1, difference = path_interval(geometry, x0, x1, sigma_t, tail=tail)
    # sinh(v1 - v0) = F1 C0 - F0 C1 = (F1^2 - F0^2)/(F1 C0 + F0 C1), whose one difference, F1 - F0,
    # `path_interval` gives without cancellation.
    f0, f1 = e0 / scale, e1 / scale
    # The square of F1 may overflow: rays straight away from a light that they all but pass.
    c0, c1 = dr.sqrt(dr.fma(f0, f0, 1)), dr.select(f1 > 1e9, f1, dr.sqrt(dr.fma(f1, f1, 1)))
    return h, (f0, c0), dr.asinh((difference / scale) * ((f0 + f1) / dr.fma(f1, c0, f0 * c1)))


def falloff_by_path(geometry: RayGeometry, light: Light, h):
    """Return the function of E that gives the relative intensity of a light; None
    for one that does not vary.
    """
    # q = s + r and h^2/q = r - s, hence s = (q - h^2/q)/2 = h (E - 1/E)/2.
    return (
        (lambda e: geometry.falloff_beside(light, 0.5 * h * (e - dr.rcp(e))))
        if light.varies
        else None
    )


def transmittance_before(geometry: RayGeometry, x0, h, sigma_t):
    """Return exp(-sigma_t (x0 + r0)), the transmittance at the beginning of a segment."""
    s0 = x0 - geometry.foot
    return dr.exp(-sigma_t * (x0 + dr.sqrt(dr.fma(s0, s0, h * h))))
