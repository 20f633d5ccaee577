# SPDX-License-Identifier: BSD-3-Clause
"""The default kernel: as few Gauss-Legendre nodes as a segment needs, placed by the phase function's own lobe.

With E = q/h as in `realtime.kernels.quadrature`,

    J = (2/h) exp(-sigma_t (x0 + r0)) int_{E0}^{E1} exp(-sigma_t h (E - E0)) p / (1 + E^2) dE,
    sin^2(angle/2) = E^2/(1 + E^2),   cos^2(angle/2) = 1/(1 + E^2).

The integrand varies on two scales: where the extinction and 1/(1 + E^2) do, E ~ 1, and where a forward lobe does. That
of Henyey and Greenstein with g > 0 has the branch points E = +-i d, d = (1 - g)/(1 + g), so close to the real axis that
nodes in asinh E, even below E = 1, step over it. The substitution

    E = d sinh v,     dE = d cosh v dv

is even where E < d and logarithmic above. It takes both pairs of singularities, +-i d and the poles +-i of 1/(1 + E^2)
(and the branch points +-i/d of a backward lobe), to |Im v| = pi/2, whatever g is: one panel serves, and no cut at the
foot point. For the lobes cos^16 and cos^64 of half the angle ("hazy", "murky"), whose poles lie at +-i already, d is
their width.

In float32 every segment takes as many panels of eight nodes as its width in v and its optical depth ask for, see
`realtime.kernels.panels`, or four or eight nodes in x if it is short, see `realtime.kernels.short_segments`; they
leave less than 1e-6. In float64 the numbers of nodes are the same for all, the smallest with which the certified cases
and random rays of optical depth 1e-6 to 50, heights down to 1e-7 of the distance and |g| up to 0.95 stay below 1e-10;
the isotropic case has no lobe, and pairs of nodes about the centre share their exponentials: it is
`quadrature` with 40 nodes.
"""

from functools import reduce

import drjit as dr
import mitsuba as mi

from realtime.kernels.panels import panels_mean
from realtime.kernels.quadrature import path_interval, quadrature
from realtime.kernels.short_segments import FEW, MORE, extent, serves, short_segment
from realtime.numerics.array_types import is_single
from realtime.numerics.gauss_legendre import unit_nodes
from realtime.rays.ray_light import RayGeometry
from realtime.scene.lights import Light
from realtime.scene.media.homogeneous import Homogeneous
from realtime.scene.phase import Phase

#: In float64: nodes of the isotropic case, and of each panel of the others; the phase function says how many panels.
_ISOTROPIC_DOUBLE, _PANEL_NODES = 40, 24


def exact(geometry: RayGeometry, x0, x1, medium: Homogeneous, light: Light):
    """Return the airlight integral J to the accuracy of the arithmetic [1/m].

    Valid for any extinction (vacuum included), any ray, the light beside the segment (height 0) included, any segment,
    endless ones and those of length 0 included, and |g| < 1. Where the ray meets the light (height 0) on the segment,
    its ends included, the integral is infinite, and so is the result.

    Largest relative error found on the certified cases: see `airlight study integrals`; in float32 below 3e-5 for
    |g| <= 0.9.
    A tabulated phase function is integrated across its kinks, which is wrong by up to a quarter of the largest second
    difference of its values, relative to them: 7e-4 was found with 513 values of "murky", 1.8e-3 with 129. Where a
    spot's intensity falls off between beam and cut-off, the segment is cut into three; those that are empty cost
    nothing.
    """
    if is_single(type(geometry.height)):
        # The extinctions share their nodes.
        values = _in_single(geometry, (x0, x1), medium.sigma_t, medium.phase, light)
        J = values[0] if len(values) == 1 else type(medium.albedo)(*values)
    else:
        J = medium.per_extinction(lambda sigma_t: _in_double(geometry, (x0, x1), sigma_t, medium, light))
    meets = (geometry.height == 0) & (x0 <= geometry.foot) & (geometry.foot <= x1) & (x0 < x1)
    return dr.select(meets, dr.inf, J)


def _in_single(geometry: RayGeometry, segment, extinctions, phase: Phase, light: Light):
    """Return one value per extinction."""
    # Branches hand no derivatives on to what they see from outside. The rule for all segments needs none.
    if light.varies or dr.grad_enabled(segment, (geometry.foot, geometry.height), extinctions, phase):
        return _over_subsegments(geometry, segment, extinctions, phase, light)
    x0, x1 = segment
    segment_extent = extent(geometry, x0, x1, extinctions)

    def longer(x0, x1):
        return dr.if_stmt(
            args=(x0, x1),
            cond=serves(MORE, segment_extent, phase),
            true_fn=lambda x0, x1: short_segment(geometry, x0, x1, phase, extinctions, rule=MORE),
            false_fn=lambda x0, x1: _subsegment(geometry, x0, x1, extinctions, phase, light),
        )

    return dr.if_stmt(
        args=(x0, x1),
        cond=serves(FEW, segment_extent, phase),
        true_fn=lambda x0, x1: short_segment(geometry, x0, x1, phase, extinctions, rule=FEW),
        false_fn=longer,
    )


def _in_double(geometry: RayGeometry, segment, sigma_t, medium: Homogeneous, light: Light):
    if medium.phase.constant and not light.varies:
        x0, x1 = segment
        grey = Homogeneous((sigma_t,), medium.albedo, medium.phase)
        return quadrature(geometry, x0, x1, grey, light, nodes=_ISOTROPIC_DOUBLE)
    return _over_subsegments(geometry, segment, (sigma_t,), medium.phase, light)[0]


def _over_subsegments(geometry: RayGeometry, segment, extinctions, phase: Phase, light: Light):
    """Return one value per extinction."""
    parts = [
        _subsegment(geometry, a, b, extinctions, phase, light) for a, b in geometry.smooth_subsegments(light, *segment)
    ]
    return [sum(values) for values in zip(*parts)]


def _subsegment(geometry: RayGeometry, x0, x1, extinctions, phase: Phase, light: Light):
    Float = type(geometry.height)
    scale, tail = phase.lobe_scales(Float)
    h, e0, e1, difference = path_interval(geometry, x0, x1, reduce(dr.minimum, extinctions), tail=tail)
    f0, f1 = e0 / scale, e1 / scale
    c0, c1 = dr.sqrt(dr.fma(f0, f0, 1)), dr.sqrt(dr.fma(f1, f1, 1))
    width = dr.asinh((difference / scale) * ((f0 + f1) / dr.fma(f1, c0, f0 * c1)))

    def weight(e):
        return geometry.falloff_beside(light, 0.5 * h * (e - dr.rcp(e)))

    add_up = panels_mean if is_single(Float) else _double_mean
    decays = [sigma_t * h for sigma_t in extinctions]
    means = add_up(phase, (f0, c0), scale, width, decays, weight if light.varies else None)
    r0 = dr.sqrt(dr.fma(x0 - geometry.foot, x0 - geometry.foot, h * h))
    shared = (width * scale) * (2 / h)
    return [mean * shared * dr.exp(-sigma_t * (x0 + r0)) for mean, sigma_t in zip(means, extinctions)]


def _double_mean(phase: Phase, start, scale, width, decays, weight):
    """Do what `panels_mean` does, in float64 and for one extinction: a loop over as many panels for all."""
    Float = type(width)
    f0, c0 = start
    (decay,) = decays
    count = phase.panels_double

    def node(fraction):
        grown = dr.exp(width * (0.5 * fraction))
        shrunk = dr.rcp(grown)
        sinh_half, cosh_half = 0.5 * (grown - shrunk), 0.5 * (grown + shrunk)
        sinh, cosh_less = 2 * sinh_half * cosh_half, 2 * dr.square(sinh_half)
        step = scale * dr.fma(f0, cosh_less, c0 * sinh)
        e = scale * f0 + step
        up = dr.rcp(dr.fma(e, e, 1))
        lobe = dr.fma(c0, cosh_less, dr.fma(f0, sinh, c0)) * up * phase.evaluate_half(dr.square(e) * up, up)
        value = dr.exp(-decay * step) * lobe
        return value if weight is None else value * weight(e)

    def panel(index, total):
        start = Float(index)
        part = sum(share * node((start + fraction) * (1 / count)) for fraction, share in unit_nodes(_PANEL_NODES))
        return index + 1, total + part * (1 / count)

    _, total = dr.while_loop(
        state=(mi.UInt32(0), dr.zeros(Float, dr.width(width))),
        cond=lambda index, total: index < count,
        body=panel,
        labels=("index", "total"),
    )
    return [total]
