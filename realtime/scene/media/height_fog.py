# SPDX-License-Identifier: BSD-3-Clause
"""Height fog: a medium whose density depends on height alone, between a floor and a cap, without sides.

With the height z of a point and layers i

    sigma_t(z) = sigma_0 + sum_i sigma_i exp(-(z - z_i)/H_i),     clamped: sigma_i exp(-max(z - z_i, 0)/H_i).

**Optical depth.** A layer's mean over a segment is its density at the *lower* end times phi(u) = (1 - e^-u)/u, with
u >= 0 the rise in scale heights: from the upper end e^u would overflow where the value is small. Rounding of u near 0
changes phi by half as much, so level rays are no special case. In float32 phi is its series to u^6 below 1/2 and the
quotient above: 2.5e-7. The length in which a layer's depth grows by T follows by inversion, -log(1 - c T/s)/c with the
density s where it begins and c = dz/H.

**Suns.** tau(x, sun) = (1/mu) int_z^cap sigma_t dz, mu the height of the sun, so that the exponent E of both ways grows
by sigma_t (1 - dz/mu) along a ray, whatever the layers. Over a lit segment of the depth tau

    int sigma_t exp(-E) dx = exp(-E(a)) tau phi(q),     q = (1 - dz/mu) tau;     exp(-E(b)) tau phi(-q) for q < 0

(plane-parallel single scattering, Chandrasekhar 1960). It costs two optical depths and no node.

**Lights at places.** Panels of nodes end where they would turn by some angle about the light, grow in distance from it
by some factor, rise by some scale heights or be optically thicker than some depth. In a panel the tangent of the angle
from its beginning is linear in t, which takes 1/r^2 away and cancels nowhere (`realtime.scene.media.bounded_rays`).
Segments are cut at the bases of clamped layers.
"""

from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.errors import InputError
from realtime.numerics.array_types import is_single
from realtime.numerics.functions import exp_bounded, unit_nodes
from realtime.scene.media.medium import LitRays, VaryingMedium, optical_reach
from realtime.scene.phase import Phase

_NODES, _NODES_DOUBLE = 8, 12
_TANGENT, _FARTHER, _NEARER, _SCALE_HEIGHTS, _DEPTH = 1.0, 1.5, 0.6, 3.0, 3.0  # of a panel at most
_MOST = 200  # panels of a segment: no segment needs as many
_ENDLESS = 1e9  # [m]


@dataclass(frozen=True)
class Layer:
    """A layer of height fog."""

    sigma_t: Any  #: at the base [1/m]
    base: Any  #: [m]
    scale_height: Any  #: [m]


@dataclass(frozen=True)
class HeightFog(VaryingMedium):
    """Exponential layers and a constant between a floor and a cap; grey."""

    layers: tuple[Layer, ...]
    constant: Any  #: [1/m]
    clamped: bool
    floor: Any  #: [m]
    cap: Any  #: [m]
    up: Any  #: unit vector
    albedo: Any
    phase: Phase

    def rays(self, origin, direction, aim=None):
        """Return rays with the distances between which they are in the fog [m], and their heights and rise."""
        start, rise = dr.dot(origin, self.up), dr.dot(direction, self.up)
        ends = [(z - start) / rise for z in (self.floor, self.cap)]
        level, inside = rise == 0, (start >= self.floor) & (start <= self.cap)
        enter = dr.select(level, 0, dr.maximum(dr.minimum(*ends), 0))
        leave = dr.select(level, dr.select(inside, _ENDLESS, 0), dr.clip(dr.maximum(*ends), 0, _ENDLESS))
        crossed = (dr.minimum(enter, leave), leave), (start, rise)
        return replace(super().rays(origin, direction, aim), crossed=crossed)

    def density(self, z):
        """Return the extinction at heights between floor and cap [1/m]."""
        return self.constant + sum(layer.sigma_t * self._fall(layer, z) for layer in self.layers)

    def extinction(self, rays, x):
        """Return the extinction [1/m]."""
        (enter, leave), (start, rise) = rays.crossed
        return (dr.select((x >= enter) & (x <= leave), self.density(dr.fma(rise, x, start)), 0),)

    def optical_depth(self, rays, x0, x1):
        """Return the optical depth of segments [m], in closed form [1]."""
        (enter, leave), (start, rise) = rays.crossed
        a, b = dr.clip(x0, enter, leave), dr.clip(x1, enter, leave)
        length = dr.maximum(b - a, 0)
        return (length * self._mean(dr.fma(rise, dr.select(rise > 0, a, b), start), dr.abs(rise) * length),)

    def depth_to_light(self, light, point, r, active=True):
        """Return the optical depth from points [m] to a light, in closed form [1]."""
        z = dr.dot(point, self.up)
        if not getattr(light, "w", 1):
            return (self._column(z) / -dr.dot(light.axis, self.up),)
        return (self._between(z, dr.dot(light.position, self.up), r),)

    def length_from(self, rays, x, depth: float):
        """Return a length after x [m] in which the optical depth grows by `depth` or more; infinite: it does not."""
        _, (start, rise) = rays.crossed
        z, longest = dr.fma(rise, x, start), depth / self.constant
        for layer in self.layers:
            share = depth / (layer.sigma_t * self._fall(layer, z))
            c = rise / layer.scale_height
            bend = c * share
            # From below the base a clamped layer grows no faster than at the base.
            grown = dr.select(dr.abs(bend) < 1e-3, share, dr.select(bend < 1, -dr.log(1 - bend) / c, dr.inf))
            if self.clamped:
                grown = dr.select((z < layer.base) | (rise < 0), share, grown)
            longest = dr.minimum(longest, grown)
        return longest

    def part(self, rays, x0, x1, *, uniform):
        """Return the part of a segment [m] between floor and cap, as far as something is left of the light."""
        (enter, leave), _ = rays.crossed
        begin = dr.clip(x0, enter, leave)
        end = dr.minimum(dr.clip(x1, enter, leave), begin + self.length_from(rays, begin, optical_reach(type(begin))))
        meets = end > begin
        return dr.select(meets, begin, 0), dr.select(meets, end, 0)

    def thicker(self, factor):
        """Return it with the extinction times a factor."""
        layers = tuple(replace(layer, sigma_t=layer.sigma_t * factor) for layer in self.layers)
        thicker = replace(self, layers=layers, constant=self.constant * factor)
        dr.make_opaque([layer.sigma_t for layer in layers], thicker.constant)
        return thicker

    def lit(self, rays, light, geometry, *, kernel=None, form="kernel"):
        """Return rays with one light, by the panels of this module, or by those of the kernel `quadrature`.

        Raises
        ------
        InputError
            For other kernels, which are those of homogeneous media, and for published forms of bounded media.
        """
        if form not in ("kernel", "exact"):
            raise InputError(f"media={form}: the published approximation is of bounded media; use media=exact")
        named = getattr(kernel, "func", kernel)
        name = getattr(named, "__name__", "exact") if kernel is not None else "exact"
        if light.w and name not in ("exact", "quadrature"):
            raise InputError(
                f"kernel: got {name}, which is of homogeneous fog; wanted exact, or quadrature with its nodes, in "
                "height fog"
            )
        nodes = getattr(kernel, "keywords", {}).get("nodes", 16) if name == "quadrature" else None
        return HeightRays(self, light, rays, geometry, kernel, nodes)

    def _fall(self, layer: Layer, z):
        above = (z - layer.base) / layer.scale_height
        return exp_bounded(-dr.maximum(above, 0)) if self.clamped else dr.exp(-above)

    def _mean(self, low, rise):
        """Return the mean density between a height `low` and one `rise` above it, both between floor and cap [1/m]."""
        total = self.constant
        for layer in self.layers:
            if not self.clamped:
                total = total + layer.sigma_t * self._fall(layer, low) * phi(rise / layer.scale_height)
                continue
            below = dr.clip(layer.base - low, 0, rise)
            part = dr.select(rise > 0, below / rise, dr.select(low < layer.base, 1, type(rise)(0)))
            above = self._fall(layer, low) * phi((rise - below) / layer.scale_height)
            total = total + layer.sigma_t * (part + (1 - part) * above)
        return total

    def _between(self, z, other, r):
        """Return the optical depth between two heights a distance r apart; what is beyond floor and cap is left out."""
        a, b = dr.clip(z, self.floor, self.cap), dr.clip(other, self.floor, self.cap)
        low, rise, whole = dr.minimum(a, b), dr.abs(b - a), dr.abs(other - z)
        inside = (a == z) & (b == other)
        length = dr.select(inside, r, dr.select(whole > 0, r * (rise / whole), 0))
        return length * self._mean(low, rise)

    def _column(self, z):
        """Return the optical depth straight up from heights [m]."""
        low = dr.clip(z, self.floor, self.cap)
        return (self.cap - low) * self._mean(low, self.cap - low)


@dataclass(frozen=True)
class HeightRays(LitRays):
    """Rays in height fog with one light: integrals are RGB [1/m^2], of suns [1]."""

    nodes: int | None = None  #: of each side of the foot, in one panel; None: panels as they are needed

    def airlight(self, x0, x1):
        """Return the integral over lit segments [x0, x1] [m]."""
        medium, (enter, leave) = self.medium, self.rays.crossed[0]
        x0, x1 = self.geometry.lit_segment(x0, x1)
        x0, x1 = dr.clip(x0, enter, leave), dr.clip(x1, enter, leave)
        if not self.light.w:
            return medium.albedo * dr.select(x1 > x0, self._sun(x0, x1), 0)
        # Twice the usual reach: out of thick fog the way to the light may lose more depth than the camera's gains.
        x1 = dr.minimum(x1, x0 + medium.length_from(self.rays, x0, 2 * optical_reach(type(x0))))
        total = type(x0)(0)
        for begin, end in self._smooth(x0, x1):
            total += dr.select(end > begin, self._panels(begin, end), 0)
        return medium.albedo * total

    def _smooth(self, x0, x1):
        """Cut segments where soft spots and the bases of clamped layers put kinks."""
        parts = self.geometry.smooth_subsegments(self.light, x0, x1)
        if not self.medium.clamped:
            return parts
        start, rise = self.rays.crossed[1]
        for layer in self.medium.layers:
            cut = dr.select(rise == 0, 0, (layer.base - start) / rise)
            parts = [part for a, b in parts for part in ((a, dr.clip(cut, a, b)), (dr.clip(cut, a, b), b))]
        return parts

    def _sun(self, x0, x1):
        medium, (start, rise) = self.medium, self.rays.crossed[1]
        mu = -dr.dot(self.light.axis, medium.up)
        (tau,) = medium.optical_depth(self.rays, x0, x1)
        q = (1 - rise / mu) * tau
        x = dr.select(q >= 0, x0, x1)
        exponent = medium.optical_depth(self.rays, 0, x)[0] + medium._column(dr.fma(rise, x, start)) / mu
        return exp_bounded(-exponent) * tau * phi(dr.abs(q)) * self.angle(None, None)(medium.phase)

    def _panels(self, x0, x1):
        """Sum panels of a segment in which the integrand is smooth."""
        Float = type(x0)
        if self.nodes is not None:
            foot = dr.clip(self.geometry.foot, x0, x1)
            return self._in_w(x0, foot) + self._in_w(foot, x1)
        count = _NODES if is_single(Float) else _NODES_DOUBLE
        width = dr.width(self.geometry.height, x0, x1)

        def panel(turn, x, total):
            end = dr.minimum(x + self._longest(x), x1)
            return turn + 1, end, total + self._panel(x, end, count)

        *_, total = dr.while_loop(
            state=(dr.zeros(mi.UInt32, width), x0 + dr.zeros(Float, width), dr.zeros(Float, width)),
            cond=lambda turn, x, total: (x < x1) & (turn < _MOST),
            body=panel,
            labels=("turn", "x", "total"),
        )
        return total

    def _longest(self, x):
        """Return the length of the longest panel that begins at x [m]."""
        medium, (_, rise) = self.medium, self.rays.crossed[1]
        h = dr.maximum(self.geometry.height, 1e-12)
        s = x - self.geometry.foot
        r = dr.sqrt(dr.fma(s, s, h * h))
        turning = h - _TANGENT * s
        longest = dr.select(turning > 0, _TANGENT * dr.square(r) / turning, dr.inf)
        longest = dr.minimum(longest, dr.select(s < 0, _NEARER, _FARTHER) * r)
        if medium.layers:
            least = reduce(dr.minimum, [layer.scale_height for layer in medium.layers])
            longest = dr.minimum(longest, _SCALE_HEIGHTS * least / dr.abs(rise))
        return dr.minimum(longest, medium.length_from(self.rays, x, _DEPTH))

    def _panel(self, x0, x1, count: int):
        """Integrate one panel by nodes that are equal in the tangent of the angle from its beginning."""
        foot, h = self.geometry.foot, dr.maximum(self.geometry.height, 1e-12)
        s0, s1 = x0 - foot, x1 - foot
        square = dr.fma(s0, s0, h * h)
        d = dr.fma(s0, s1, h * h)
        tangent = h * (x1 - x0) / d
        total = type(x0)(0)
        for t, weight in unit_nodes(count):
            near, far = (1 - t) * d, t * square
            s = dr.fma(near, s0, far * s1) / (near + far)
            total += self._integrand(s, dr.sqrt(dr.fma(s, s, h * h))) * (weight / dr.fma(t * tangent, t * tangent, 1))
        return dr.select(x1 > x0, total * ((x1 - x0) / d), 0)

    def _in_w(self, x0, x1):
        """Integrate a segment beside the foot in one panel of w = asinh((x - foot)/height)."""
        foot, h = self.geometry.foot, dr.maximum(self.geometry.height, 1e-12)
        w0, w1 = dr.asinh((x0 - foot) / h), dr.asinh((x1 - foot) / h)
        total = type(x0)(0)
        for t, weight in unit_nodes(self.nodes or 0):
            grown = dr.exp(dr.lerp(w0, w1, t))
            sinh, cosh = 0.5 * (grown - dr.rcp(grown)), 0.5 * (grown + dr.rcp(grown))
            total += self._integrand(h * sinh, h * cosh) * (weight / cosh)
        return dr.select(x1 > x0, total * ((w1 - w0) / h), 0)

    def _integrand(self, s, r):
        """Return sigma_t exp(-tau) p at s = x - foot and r from the light [1/m]."""
        medium, ((enter, _), (start, rise)) = self.medium, self.rays.crossed
        x = self.geometry.foot + s
        z = dr.fma(rise, x, start)
        at_light = dr.dot(self.light.position, medium.up)
        if medium.clamped:
            density, exponent = medium.density(z), medium.optical_depth(self.rays, 0, x)[0]
            exponent += medium._between(z, at_light, r)
        else:
            # One exponential a layer: those where the ray enters and at the light are the same for all nodes.
            length, end = dr.maximum(x - enter, 0), dr.clip(at_light, medium.floor, medium.cap)
            away = dr.abs(at_light - z)
            within = dr.select(end == at_light, r, r * (dr.abs(end - z) / dr.maximum(away, 1e-12)))
            density, exponent = medium.constant, medium.constant * (length + within)
            for layer in medium.layers:
                here, there = medium._fall(layer, z), medium._fall(layer, end)
                before = medium._fall(layer, dr.fma(rise, enter, start))
                rises = dr.abs(rise) * length / layer.scale_height, dr.abs(end - z) / layer.scale_height
                depth = length * mean_fall(before, here, rises[0]) + within * mean_fall(here, there, rises[1])
                density = dr.fma(layer.sigma_t, here, density)
                exponent = dr.fma(layer.sigma_t, depth, exponent)
        value = density * exp_bounded(-exponent) * medium.phase.evaluate(-s / r)
        return value * self.geometry.falloff_beside(self.light, s) if self.light.varies else value


def mean_fall(a, b, u):
    """Return the mean of an exponential between two places where it is a and b, u >= 0 scale heights apart."""
    if is_single(type(u)):
        return dr.select(u < 0.5, dr.maximum(a, b) * _series(u), dr.abs(a - b) / u)
    return dr.maximum(a, b) * phi(u)


def _series(u):
    """Return (1 - e^-u)/u to u^6, in float32 right to rounding below 1/2."""
    series = type(u)(1 / 5040)
    for divisor in (720, 120, 24, 6, 2, 1):
        series = dr.fma(-u, series, 1 / divisor)
    return series


def phi(u):
    """Return (1 - e^-u)/u, 1 at u = 0, for u >= 0 (see the module)."""
    if is_single(type(u)):
        return dr.select(u < 0.5, _series(u), (1 - exp_bounded(-u)) / u)
    e = dr.exp(-u)
    return dr.select(e == 1, 1, (1 - e) / dr.select(u < 1, -dr.log(e), u))
