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

**Lights at places.** With s = x - foot, the height h and distance r of the light, N^2 = (r + s)/2 and D^2 = (r - s)/2,
2 N D is h. At E = N/D = (r + s)/h there is s/r = (E^2 - 1)/(E^2 + 1), E^2/(1 + E^2) and 1/(1 + E^2) are sin^2 and
cos^2 of half the scattering angle, and dx/r^2 = (2/h) dE/(1 + E^2). In a panel N and D are linear in t from 0 to 1,
with C = N0 N1 + D0 D1, and

    s - s0 = t h (s1 - s0)/(2 C) (N N0 + D D0)/(N D),    r = h (N^2 + D^2)/(2 N D),
    dx/r^2 = (s1 - s0)/C dt/(N^2 + D^2).

Nothing cancels or divides by h, and there is no function but the reciprocal. In the middle E is the geometric mean of
the ends', and about exponential in t throughout; by w = ln E the light and the lobe of Henyey and Greenstein lie at
|Im w| = pi/2, whatever g is. A panel may be so wide in w, or rise by so many scale heights or change either depth by so
much, and less of each if they come together. It begins at its lower end: there a node has one exponential for each
layer, e^-u - 1, for the density and for the depth from the camera; the depth to the light takes the density at both its
ends. Panels end at the bases of clamped layers and at kinks of spots.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.errors import InputError
from airlight.realtime.numerics.array_types import is_single
from airlight.realtime.numerics.functions import exp_bounded, exp_expm1_bounded, unit_nodes
from airlight.realtime.scene.media.medium import LitRays, VaryingMedium, optical_reach, unfinished
from airlight.realtime.scene.phase import Phase

_NODES, _NODES_DOUBLE = 12, 28
_WIDTH, _SCALE_HEIGHTS, _DEPTH = 4.2, 10.0, 12.0  # of a panel at most: in ln E, of rise, of optical depth
_WIDTH_ASKED = 6.0  # in ln E of panels with a number of nodes that was asked for
_MOST = 200  # panels of a segment: a frame whose segments need more is refused
_UNBOUNDED = 1e9  # [m]
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
    summary = "height fog: depths and suns in closed form, panels of nodes for lights at places"

    def rays(self, origin, direction, aim=None):
        """Return rays with the distances between which they are in the fog [m], and their heights and rise."""
        start, rise = dr.dot(origin, self.up), dr.dot(direction, self.up)
        ends = [(z - start) / rise for z in (self.floor, self.cap)]
        level, inside = rise == 0, (start >= self.floor) & (start <= self.cap)
        enter = dr.select(level, 0, dr.maximum(dr.minimum(*ends), 0))
        leave = dr.select(level, dr.select(inside, _UNBOUNDED, 0), dr.clip(dr.maximum(*ends), 0, _UNBOUNDED))
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
            return (self._overhead(z) / -dr.dot(light.axis, self.up),)
        return (self._between(z, dr.dot(light.position, self.up), r),)

    def length_from(self, rays, x, depth: float):
        """Return a length after x [m] in which the optical depth grows by `depth` or more; infinite: it does not."""
        _, (start, rise) = rays.crossed
        z, longest = dr.fma(rise, x, start), depth / self.constant
        for layer in self.layers:
            fraction = depth / (layer.sigma_t * self._fall(layer, z))
            c = rise / layer.scale_height
            bend = c * fraction
            # From below the base a clamped layer grows no faster than at the base.
            grown = dr.select(dr.abs(bend) < 1e-3, fraction, dr.select(bend < 1, -dr.log(1 - bend) / c, dr.inf))
            if self.clamped:
                grown = dr.select((z < layer.base) | (rise < 0), fraction, grown)
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

    def lit(self, rays, light, geometry, kernel=None):
        """Return rays with one light, by the panels of this module, or by those of the kernel `quadrature`.

        Raises
        ------
        InputError
            For other kernels, which are those of homogeneous media.
        """
        nodes = None if kernel is None or kernel.exact else kernel.asinh_nodes
        if light.w and not (kernel is None or kernel.exact or nodes is not None):
            raise InputError(
                f"kernel: got {kernel.name}, which is of homogeneous fog; expected exact, or quadrature with its "
                "nodes, in height fog"
            )
        return HeightRays(self, light, rays, geometry, kernel, nodes)

    def _fall(self, layer: Layer, z):
        # A quotient to its last digit by the reciprocal, which is the same everywhere.
        height, steep = z - layer.base, dr.rcp(layer.scale_height)
        above = height * steep
        above = dr.fma(dr.fma(-above, layer.scale_height, height), steep, above)
        # Where it is 1e24, all is as dark as beyond.
        return exp_bounded(-dr.maximum(above, 0 if self.clamped else -55.0))

    def _column(self, layer: Layer, low, rise, ends):
        """Return the integral of a layer over heights, `rise` [m] from `low` up, by its densities at the `ends` [m]."""
        below = dr.clip(layer.base - low, 0, rise) if self.clamped else 0
        above, largest = rise - below, dr.maximum(*ends)
        u = above / layer.scale_height
        if not is_single(type(u)):
            return below + above * largest * phi(u)
        # Above 1/2 the difference has its digits; below, the series does, and takes less than an exponential.
        series = type(u)(1 / 5040)
        for divisor in (720, 120, 24, 6, 2, 1):
            series = dr.fma(-u, series, 1 / divisor)
        return below + dr.select(u < 0.5, largest * (above * series), layer.scale_height * dr.abs(ends[0] - ends[1]))

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

    def _overhead(self, z):
        """Return the optical depth straight up from heights [m]."""
        low = dr.clip(z, self.floor, self.cap)
        return (self.cap - low) * self._mean(low, self.cap - low)


@dataclass(frozen=True)
class HeightRays(LitRays):
    """Rays in height fog with one light: integrals are RGB [1/m^2], of suns [1]."""

    nodes: int | None = None  #: of each panel, which then ends at the foot, too; None: as many as float32 needs

    @property
    def end(self):
        """The height of the light, or where the fog ends before it [m]."""
        return dr.clip(dr.dot(self.light.position, self.medium.up), self.medium.floor, self.medium.cap)

    def airlight(self, x0, x1):
        """Return the integral over lit segments [x0, x1] [m]."""
        medium, (enter, leave) = self.medium, self.rays.crossed[0]
        x0, x1 = self.geometry.lit_segment(x0, x1)
        x0, x1 = dr.clip(x0, enter, leave), dr.clip(x1, enter, leave)
        if not self.light.w:
            return medium.albedo * dr.select(x1 > x0, self._sun(x0, x1), 0)
        return medium.albedo * dr.select(x1 > x0, self._panels(x0, x1), 0)

    def _sun(self, x0, x1):
        medium, (start, rise) = self.medium, self.rays.crossed[1]
        mu = -dr.dot(self.light.axis, medium.up)
        (tau,) = medium.optical_depth(self.rays, x0, x1)
        q = (1 - rise / mu) * tau
        x = dr.select(q >= 0, x0, x1)
        exponent = medium.optical_depth(self.rays, 0, x)[0] + medium._overhead(dr.fma(rise, x, start)) / mu
        return exp_bounded(-exponent) * tau * phi(dr.abs(q)) * self.angle(None, None)(medium.phase)

    def _panels(self, x0, x1):
        """Sum panels of a segment."""
        Float, medium, (start, rise) = type(x0), self.medium, self.rays.crossed[1]
        width = dr.width(self.geometry.height, x0, x1)
        bends = [end for _, end in self.geometry.smooth_subsegments(self.light, x0, x1)[:-1]]
        if medium.clamped:
            bends += [(layer.base - start) / rise for layer in medium.layers]
        (before,) = medium.optical_depth(self.rays, 0, x0)
        # Twice the usual reach: out of thick fog the way to the light may lose more depth than the camera's gains.
        reach = 2 * optical_reach(Float)
        deepest = before + reach
        if self.nodes is not None:
            bends.append(self.geometry.foot)
            x1 = dr.minimum(x1, x0 + medium.length_from(self.rays, x0, reach))

        def panel(turn, x, depth, total):
            end = dr.minimum(x + self._longest(x), x1)
            for bend in bends:
                end = dr.minimum(end, dr.select(bend > x, bend, dr.inf))
            part, depth = self._panel(x, end, depth)
            return turn + 1, end, depth, total + part

        _, reached, depth, total = dr.while_loop(
            state=(dr.zeros(mi.UInt32, width), x0 + dr.zeros(Float, width), before, dr.zeros(Float, width)),
            cond=lambda turn, x, depth, total: (x < x1) & (depth < deepest) & (turn < _MOST),
            body=panel,
            labels=("turn", "x", "depth", "total"),
        )
        return unfinished((reached < x1) & (depth < deepest), total)

    def _longest(self, x):
        """Return the length of the longest panel that begins at x [m]."""
        medium, (start, rise) = self.medium, self.rays.crossed[1]
        s = x - self.geometry.foot
        r = dr.sqrt(dr.fma(s, s, dr.square(self.geometry.height)))
        width = _WIDTH if self.nodes is None else _WIDTH_ASKED
        longest = dr.fma(math.cosh(width) - 1, s, math.sinh(width) * r)
        if self.nodes is not None:
            return longest
        z = dr.fma(rise, x, start)
        whole, part, low = self._to_light(z)
        density, segment, falling, steepest = medium.constant, medium.constant * part, 0, 0
        for layer in medium.layers:
            here, steep = medium._fall(layer, z), dr.rcp(layer.scale_height)
            own = layer.sigma_t * here
            density, falling, steepest = density + own, dr.fma(own, steep, falling), dr.maximum(steepest, steep)
            segment = dr.fma(
                layer.sigma_t, medium._column(layer, low, part, (here, medium._fall(layer, self.end))), segment
            )
        # Upwards the layers by their share in the density; downwards, where it grows, any can become the largest.
        steep = rise * dr.select(rise > 0, falling * dr.rcp(dr.maximum(density, 1e-30)), steepest)
        thick = dr.maximum(dr.fma(-0.5 * _DEPTH, dr.minimum(steep, 0), density), segment * dr.rcp(whole))
        rate = dr.maximum((1 / _DEPTH) * thick, (1 / _SCALE_HEIGHTS) * dr.abs(steep))
        return longest * dr.rsqrt(dr.fma(longest * rate, longest * rate, 1))

    def _to_light(self, z):
        """Return how far the light is from heights upwards, how far within the fog, and the lower end of that [m]."""
        ends = dr.dot(self.light.position, self.medium.up), self.end
        whole, part = (dr.maximum(dr.abs(end - z), _LEVEL) for end in ends)
        return whole, part, dr.minimum(z, self.end)

    def _panel(self, x0, x1, before):
        """Integrate one panel, to whose beginning the optical depth is `before`; return that to its end, too."""
        Float, medium, (start, slope) = type(x0), self.medium, self.rays.crossed[1]
        foot, h, length = self.geometry.foot, dr.maximum(self.geometry.height, 1e-12), x1 - x0
        up, rise = slope > 0, dr.abs(slope)
        low, high = dr.select(up, x0, x1), dr.select(up, x1, x0)
        z_low = dr.fma(slope, low, start)
        across, layers = medium.constant * length, []
        for layer in medium.layers:
            steep = dr.maximum(rise / layer.scale_height, 1e-12)
            if medium.clamped:
                steep = dr.select(dr.fma(0.5 * rise, length, z_low) < layer.base, 1e-12, steep)
            at_low = medium._fall(layer, z_low)
            along = -at_low / steep
            across = dr.fma(layer.sigma_t * along, exp_expm1_bounded(-steep * length)[1], across)
            layers.append((layer, steep, at_low, along, medium._fall(layer, self.end)))
        after = before + across
        at_lowest, sign = dr.select(up, before, after), dr.select(up, Float(1), -1)
        (n0, d0), (n1, d1) = _roots(low - foot, h), _roots(high - foot, h)
        fraction = length / dr.fma(n0, n1, d0 * d1)
        total = Float(0)
        for t, weight in unit_nodes(self.nodes or (_NODES if is_single(Float) else _NODES_DOUBLE)):
            n, d = dr.fma(n1 - n0, t, n0), dr.fma(d1 - d0, t, d0)
            square_n, square_d = dr.square(n), dr.square(d)
            inverse, scale = dr.rcp(square_n + square_d), 0.5 * h * dr.rcp(n * d)
            far, r = fraction * t * (dr.fma(n, n0, d * d0) * scale), (square_n + square_d) * scale
            whole, part, lower = self._to_light(dr.fma(rise, far, z_low))
            density, camera, segment = medium.constant, medium.constant * far, medium.constant * part
            for layer, steep, at_low, along, at_end in layers:
                kept, less = exp_expm1_bounded(-steep * far)
                here = at_low * kept
                density = dr.fma(layer.sigma_t, here, density)
                camera = dr.fma(layer.sigma_t * along, less, camera)
                segment = dr.fma(layer.sigma_t, medium._column(layer, lower, part, (here, at_end)), segment)
            exponent = dr.fma(sign, camera, at_lowest) + r * (segment * dr.rcp(whole))
            value = weight * inverse * density * exp_bounded(-exponent)
            if not medium.phase.constant:
                value *= medium.phase.evaluate_half(square_n * inverse, square_d * inverse)
            if self.light.varies:
                value *= self.geometry.falloff_beside(self.light, (square_n - square_d) * scale)
            total += value
        return dr.select(x1 > x0, total * fraction, 0), after


def _roots(s, h):
    """Return N and D, the square roots of (r + s)/2 and (r - s)/2 (see the module); 2 N D = h."""
    larger = dr.sqrt(0.5 * (dr.abs(s) + dr.sqrt(dr.fma(s, s, h * h))))
    smaller = 0.5 * h * dr.rcp(larger)
    return dr.select(s > 0, larger, smaller), dr.select(s > 0, smaller, larger)


def phi(u):
    """Return (1 - e^-u)/u, 1 at u = 0, for u >= 0 (see the module)."""
    return dr.select(u > 0, -exp_expm1_bounded(-u)[1] / u, 1)
