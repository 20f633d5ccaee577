# SPDX-License-Identifier: BSD-3-Clause
"""Height fog: a medium whose density depends on height alone, between a floor and a cap, without sides.

With the height z of a point and layers i

    sigma_t(z) = sigma_0 + sum_i sigma_i exp(-(z - z_i)/H_i),     clamped: sigma_i exp(-max(z - z_i, 0)/H_i).

**Optical depth.** A layer's mean over a segment is its density at the *lower* end times phi(u) = (1 - e^-u)/u, with
u >= 0 the rise in scale heights: from the upper end e^u would overflow where the value is small. Rounding of u near 0
changes phi by half as much, so level rays are no special case. The length in which a layer's depth grows by T follows
by inversion, -log(1 - c T/s)/c with the density s where it begins and c = dz/H.

**Suns.** tau(x, sun) = (1/mu) int_z^cap sigma_t dz, mu the height of the sun, so that the exponent E of both ways grows
by sigma_t (1 - dz/mu) along a ray, whatever the layers. Over a lit segment of the depth tau

    int sigma_t exp(-E) dx = exp(-E(a)) tau phi(q),     q = (1 - dz/mu) tau;     exp(-E(b)) tau phi(-q) for q < 0

(plane-parallel single scattering, Chandrasekhar 1960). It costs two optical depths and no node.

**Lights at places.** With s = x - foot, h the height and w = asinh(s/h), dx/r^2 = dw/r, and what is left is smooth: the
poles of 1/r and of Henyey and Greenstein's lobes lie at Im w = pi/2. Panels of nodes in w end where they would be too
wide, rise by too many scale heights or be optically too thick; 8 nodes are right to 2e-6, 16 to 2e-11 (certified rays).
Segments are cut at the bases of clamped layers. Of a layer that is not clamped, the depth from z to z' is sigma_i H_i
|e(z) - e(z')| times the length that rises by one scale height: one exponential a leg, whose difference from 1 comes
with it.
"""

import math
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.errors import InputError
from realtime.numerics.array_types import is_single
from realtime.numerics.functions import exp_bounded, exp_expm1_bounded, unit_nodes
from realtime.scene.media.medium import LitRays, VaryingMedium, optical_reach
from realtime.scene.phase import Phase

_NODES, _NODES_DOUBLE = 8, 16
_WIDEST, _SCALE_HEIGHTS, _DEPTH = 3.4, 6.0, 10.0  # of a panel at most: in w, in scale heights, in optical depth
_MOST = 200  # panels of a segment: no segment needs as many
_ENDLESS = 1e9  # [m]
_LEVEL = 1e-20  # the rise of a ray, and a difference of heights [m], that stand for none


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
        # A quotient to its last digit by the reciprocal, which is the same everywhere.
        height, steep = z - layer.base, dr.rcp(layer.scale_height)
        above = height * steep
        above = dr.fma(dr.fma(-above, layer.scale_height, height), steep, above)
        return exp_bounded(-dr.maximum(above, 0 if self.clamped else -88.0))

    def _from(self, layer: Layer, height):
        """Return a function of how far below a height a place is: a layer's exponential, and its difference exactly.

        From forty scale heights above the base on, the exponential is as good as 0.
        """
        least, steep = dr.minimum(height, dr.fma(40, layer.scale_height, layer.base)), dr.rcp(layer.scale_height)
        there, beyond = self._fall(layer, least), (least - height) * steep

        def at(below):
            factor, less = exp_expm1_bounded(dr.fma(below, steep, beyond))
            return there * factor, there * dr.abs(less)

        return at

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
        return medium.albedo * sum(self._panels(begin, end) for begin, end in self._smooth(x0, x1))

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
        Float, integrand = type(x0), self._integrand()
        if self.nodes is not None:
            foot = dr.clip(self.geometry.foot, x0, x1)
            return sum(self._panel(integrand, a, b, self.nodes) for a, b in ((x0, foot), (foot, x1)))
        count = _NODES if is_single(Float) else _NODES_DOUBLE
        width = dr.width(self.geometry.height, x0, x1)

        def panel(turn, x, total):
            end = dr.minimum(x + self._longest(x0, x), x1)
            return turn + 1, end, total + self._panel(integrand, x, end, count)

        *_, total = dr.while_loop(
            state=(dr.zeros(mi.UInt32, width), x0 + dr.zeros(Float, width), dr.zeros(Float, width)),
            cond=lambda turn, x, total: (x < x1) & (turn < _MOST),
            body=panel,
            labels=("turn", "x", "total"),
        )
        return total

    def _longest(self, x0, x):
        """Return the length of the longest panel that begins at x, of a segment that begins at x0 [m]."""
        medium, (start, rise) = self.medium, self.rays.crossed[1]
        s, h = x - self.geometry.foot, self._height()
        # From w to w + W in w = asinh(s/h), s grows to s cosh W + r sinh W.
        longest = dr.fma(s, math.cosh(_WIDEST) - 1, dr.sqrt(dr.fma(s, s, h * h)) * math.sinh(_WIDEST))
        thickness = _DEPTH / medium.density(dr.fma(rise, x, start))
        if medium.layers:
            slope = dr.abs(rise) / reduce(dr.minimum, [layer.scale_height for layer in medium.layers])
            # Upwards less and less is left to be right about.
            longest = dr.minimum(longest, _SCALE_HEIGHTS / slope + dr.select(rise > 0, x - x0, 0))
            # Downwards the depth grows by T in log(1 + y)/slope, y = slope T/density; 2y/(2 + y) is a lower bound.
            thickness *= dr.select(rise < 0, 2 / dr.fma(slope, thickness, 2), 1)
        return dr.minimum(longest, thickness)

    def _height(self):
        return dr.maximum(self.geometry.height, 1e-12)

    def _panel(self, integrand, x0, x1, count: int):
        """Integrate one panel by nodes in w, with dx/r^2 = dw/r.

        With p = s + r = h e^w the middle is at h e^w = sqrt(p0 p1), and w1 - w0 = log(p1/p0), where p1/p0 - 1 =
        (x1 - x0)/(r0 + r1) (1 + p1/p0) keeps its digits in short panels. A pair of nodes has one exponential.
        """
        h = self._height()
        s0, s1 = x0 - self.geometry.foot, x1 - self.geometry.foot
        r0, r1 = dr.sqrt(dr.fma(s0, s0, h * h)), dr.sqrt(dr.fma(s1, s1, h * h))
        p0, p1 = (dr.select(s >= 0, s + r, h * h / (r - s)) for s, r in ((s0, r0), (s1, r1)))
        grows = (x1 - x0) / (r0 + r1) * (1 + p1 / p0)
        grown = 1 + grows
        half = 0.5 * dr.select(grown == 1, grows, dr.log(grown) * (grows / (grown - 1)))
        after = dr.sqrt(p0) * dr.sqrt(p1)
        before = h * h / after
        total, nodes = type(x0)(0), unit_nodes(count)
        for t, weight in nodes[: count // 2]:
            grown = exp_bounded((1 - 2 * t) * half)
            shrunk = dr.rcp(grown)
            total += weight * (integrand(after * grown, before * shrunk) + integrand(after * shrunk, before * grown))
        return dr.select(x1 > x0, 2 * half * total, 0)

    def _integrand(self):
        """Return a function of r + s and r - s, s = x - foot and r from the light [m]: sigma_t exp(-tau) p / r."""
        medium, ((enter, _), (start, rise)) = self.medium, self.rays.crossed
        at_light = dr.dot(self.light.position, medium.up)
        end, climb = dr.clip(at_light, medium.floor, medium.cap), dr.select(dr.abs(rise) < _LEVEL, _LEVEL, rise)
        flat, entry = dr.rcp(dr.abs(climb)), dr.fma(rise, enter, start)
        layers = [(layer, medium._from(layer, entry), medium._from(layer, end)) for layer in medium.layers]

        def integrand(after, before):
            total, s = after + before, 0.5 * (after - before)
            r, x = 0.5 * total, self.geometry.foot + s
            z = dr.fma(rise, x, start)
            fall = dr.maximum(dr.abs(at_light - z), _LEVEL)
            both = dr.rcp(total * fall)  # one division for two
            slant, inverse = r * total * both, fall * both
            if medium.clamped:
                density, exponent = medium.density(z), medium.optical_depth(self.rays, 0, x)[0]
                exponent += medium._between(z, at_light, r)
            else:
                # A layer's depth is the difference of its exponentials times the length that rises by one scale height.
                length, density, to_camera = x - enter, medium.constant, 0
                to_light = medium.constant * dr.abs(end - z)
                for layer, from_entry, from_end in layers:
                    column, (here, difference) = layer.sigma_t * layer.scale_height, from_end(end - z)
                    density = dr.fma(layer.sigma_t, here, density)
                    to_camera = dr.fma(column, from_entry(-climb * length)[1], to_camera)
                    to_light = dr.fma(column, difference, to_light)
                exponent = dr.fma(to_camera, flat, medium.constant * length)
                exponent += dr.select(fall > _LEVEL, to_light * slant, density * r)
            phase = medium.phase.evaluate_half(after * inverse, before * inverse)
            value = density * exp_bounded(-exponent) * phase * (2 * inverse)
            return value * self.geometry.falloff_beside(self.light, s) if self.light.varies else value

        return integrand


def phi(u):
    """Return (1 - e^-u)/u, 1 at u = 0, for u >= 0 (see the module)."""
    return dr.select(u > 0, -exp_expm1_bounded(-u)[1] / u, 1)
