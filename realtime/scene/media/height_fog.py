# SPDX-License-Identifier: BSD-3-Clause
"""Height fog: a medium whose density depends on height alone, between a floor
and a cap, without sides.

With the height z of a point and layers i

    sigma_t(z) = sigma_0 + sum_i sigma_i exp(-(z - z_i)/H_i),
    clamped:     sigma_0 + sum_i sigma_i exp(-max(z - z_i, 0)/H_i).

**Optical depth.** A layer's mean over a segment is its density at the *lower* end times phi(u) =
(1 - e^-u)/u, with u >= 0 the rise in scale heights: from the upper end e^u would overflow where the
value is small. Rounding of u near 0 changes phi by half as much, so level rays are no special case.
The length in which a layer's depth grows by T follows by inversion, -log(1 - c T/s)/c with the
density s where it begins and c = dz/H.

**Suns.** tau(x, sun) = (1/mu) int_z^cap sigma_t dz, mu the height of the sun, so that the exponent
E of both ways grows by sigma_t (1 - dz/mu) along a ray, whatever the layers. Over a lit segment of
the depth tau

    int sigma_t exp(-E) dx = exp(-E(a)) tau phi(q),     q = (1 - dz/mu) tau;
                             exp(-E(b)) tau phi(-q)     for q < 0

(plane-parallel single scattering, Chandrasekhar 1960). It costs two optical depths and no node.

**Lights at places.** A panel (`realtime.scene.media.integrate`) is computed from its lower end:
there a node has one exponential for each layer, e^-u - 1, for the density and for the depth from
the camera; the depth to the light takes the density at both its ends. Panels end at the bases of
clamped layers. Beyond a base the mean density of the way to a light goes like 1/(z - z_light),
which limits a panel there. A layer that falls along the ray counts by the fourth root of its
fraction of the density, since the rule leaves about the fourth power of what it does not resolve.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from airlight.errors import InputError
from airlight.realtime.numerics.array_types import is_single
from airlight.realtime.numerics.functions import exp_bounded, exp_expm1_bounded, opacity
from airlight.realtime.scene.media.integrate import Node, Start
from airlight.realtime.scene.media.medium import LitRays, VaryingMedium, optical_reach
from airlight.realtime.scene.phase import Phase
from airlight.realtime.scene.rule_reach import CHANGE


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

    def check_beam(self, axis, name):
        """Refuse light from the horizon or below."""
        if not axis @ np.array(self.up, dtype=np.float64).ravel() < 0:
            raise InputError(
                f"light '{name}' is directional and shines from the horizon or below: each of its "
                "light paths "
                "through height fog, which has no sides, is infinitely deep; expected a light from "
                "above the horizon"
            )

    def rays(self, origin, direction, aim=None):
        """Return rays with the distances between which they are in the fog [m],
        and their heights and rise.
        """
        # The height along a ray is start + rise x. It passes floor and cap at two distances; a
        # level ray in the fog passes neither, and leaves it at 1e9 m.
        unbounded = 1e9
        start, rise = dr.dot(origin, self.up), dr.dot(direction, self.up)
        ends = [(z - start) / rise for z in (self.floor, self.cap)]
        level, inside = rise == 0, (start >= self.floor) & (start <= self.cap)
        enter = dr.select(level, 0, dr.maximum(dr.minimum(*ends), 0))
        leave = dr.select(
            level, dr.select(inside, unbounded, 0), dr.clip(dr.maximum(*ends), 0, unbounded)
        )
        crossed = (dr.minimum(enter, leave), leave), (start, rise)
        return replace(super().rays(origin, direction, aim), crossed=crossed)

    def density(self, z):
        """Return the extinction at heights between floor and cap [1/m]."""
        return self.constant + sum(layer.sigma_t * self._fall(layer, z) for layer in self.layers)

    def extinction(self, rays, x):
        """Return the extinction [1/m]."""
        (enter, leave), (start, rise) = rays.crossed
        return (dr.select((x >= enter) & (x < leave), self.density(dr.fma(rise, x, start)), 0),)

    def optical_depth(self, rays, x0, x1):
        """Return the optical depth of segments [m], in closed form [1]."""
        (enter, leave), (start, rise) = rays.crossed
        a, b = dr.clip(x0, enter, leave), dr.clip(x1, enter, leave)
        # The mean density from the lower end up (see the module), times the length in the fog.
        length = dr.maximum(b - a, 0)
        return (
            length
            * self._mean(dr.fma(rise, dr.select(rise > 0, a, b), start), dr.abs(rise) * length),
        )

    def depth_to_light(self, light, point, r, active=True):
        """Return the optical depth from points [m] to a light, in closed form [1]."""
        z = dr.dot(point, self.up)
        # A sun shines through all of the fog above; the slant path is longer by 1/mu.
        if not getattr(light, "w", 1):
            return (self._overhead(z) / -dr.dot(light.axis, self.up),)
        return (self._between(z, dr.dot(light.position, self.up), r),)

    def bends(self, rays, light):
        """Return where rays pass the bases of clamped layers [m]."""
        _, (start, rise) = rays.crossed
        return tuple((layer.base - start) / rise for layer in self.layers) if self.clamped else ()

    def longest(self, rays, light, x, change):
        """Return a length in which depths and the logarithm of the density change by
        no more than a number [m].
        """
        (_, (start, rise)), end = rays.crossed, self._end(light)
        z = dr.fma(rise, x, start)
        # The depth to the light is r times the column of the fog between both heights over their
        # difference, `whole`; `part` of it lies within the fog.
        whole, part, low = self._to_light(z, light, end)
        r = dr.norm(light.position - rays.at(x))
        # The density here, its integral over the heights up to the light, and
        # what changes behind a base.
        density, column, behind = self.constant, self.constant * part, type(x)(0)
        extinctions = []
        for layer in self.layers:
            at_point = self._fall(layer, z)
            of_layer = self._column(layer, low, part, (at_point, self._fall(layer, end)))
            extinctions.append(layer.sigma_t * at_point)
            density, column = density + extinctions[-1], dr.fma(layer.sigma_t, of_layer, column)
            if self.clamped:
                # Whether the base lies between the point and the light. A panel may begin at the
                # base itself, rounded: there the point counts as beyond it, to 1e-4 of a scale
                # height.
                above = end - layer.base
                crossed = (z - layer.base) * above < 1e-4 * layer.scale_height * dr.abs(above)
                changes = r * layer.sigma_t * dr.abs(at_point - of_layer / part)
                behind = dr.maximum(behind, dr.select(crossed, _root(changes), 0))
        # Upwards a layer counts by its fraction of the density; downwards
        # any can become the largest.
        up, down = type(x)(0), type(x)(0)
        for layer, extinction in zip(self.layers, extinctions, strict=True):
            steep = dr.rcp(layer.scale_height)
            up = dr.fma(steep, _root(extinction * dr.rcp(dr.maximum(density, 1e-30))), up)
            down = dr.maximum(down, steep)
        steep = dr.abs(rise) * dr.select(rise > 0, up, down)
        # The rates of both depths: the density here, and the mean density of the way to the light.
        thick = density + column * dr.rcp(whole)
        # Downwards depths grow as exponentials of the way, by `change` after log(1 +
        # change steep/thick)/steep.
        grown = change * steep * dr.rcp(thick)
        thick = dr.select((rise < 0) & (grown > 1e-2), change * steep / dr.log(1 + grown), thick)
        # The three rates add up: depths, the logarithm of the density, what changes behind a base.
        return change / (thick + steep + dr.abs(rise) * (behind * dr.rcp(whole)))

    def length_from(self, rays, x, depth: float):
        """Return a length after x [m] in which the optical depth grows by `depth` or
        more; infinite: it does not.
        """
        _, (start, rise) = rays.crossed
        z, longest = dr.fma(rise, x, start), depth / self.constant
        # By layer -log(1 - c T/s)/c, c = rise/H: T/s where c T/s is small, and no length where the
        # layer thins out before it has the depth T. The first layer to reach T decides.
        for layer in self.layers:
            even = fraction = depth / (layer.sigma_t * self._fall(layer, z))
            c, to_base = rise / layer.scale_height, type(z)(0)
            if self.clamped:
                # A ray that rises has the density of the base up to there, and bends beyond it.
                to_base = dr.select(rise > 0, dr.maximum((layer.base - z) / rise, 0), 0)
                fraction = fraction - to_base
            bend = c * fraction
            grown = to_base + dr.select(
                dr.abs(bend) < 1e-3, fraction, dr.select(bend < 1, -dr.log(1 - bend) / c, dr.inf)
            )
            if self.clamped:
                # Downwards a layer has at least the density of the beginning.
                grown = dr.select((fraction < 0) | (rise < 0), even, grown)
            longest = dr.minimum(longest, grown)
        return longest

    def part(self, rays, x0, x1, *, uniform):
        """Return the part of a segment [m] between floor and cap, as far as
        something is left of the light.
        """
        (enter, leave), _ = rays.crossed
        begin = dr.clip(x0, enter, leave)
        # A ray that goes on in thick fog ends where nothing is left of its light.
        end = dr.minimum(
            dr.clip(x1, enter, leave),
            begin + self.length_from(rays, begin, optical_reach(type(begin))),
        )
        meets = end > begin
        return dr.select(meets, begin, 0), dr.select(meets, end, 0)

    def thicker(self, factor):
        """Return it with the extinction times a factor."""
        layers = tuple(replace(layer, sigma_t=layer.sigma_t * factor) for layer in self.layers)
        thicker = replace(self, layers=layers, constant=self.constant * factor)
        dr.make_opaque([layer.sigma_t for layer in layers], thicker.constant)
        return thicker

    def lit(self, rays, light, geometry, kernel=None):
        """Return rays with one light, by the panels of this module, or by those of
        the kernel `quadrature`.

        Raises
        ------
        InputError
            For other kernels, which are those of homogeneous media.
        """
        # The kernel `quadrature` alone names a number of nodes, which the panels take over.
        nodes = None if kernel is None or kernel.exact else kernel.asinh_nodes
        if light.w and not (kernel is None or kernel.exact or nodes is not None):
            raise InputError(
                f"kernel: got {kernel.name}, which is of homogeneous fog; expected exact, or "
                "quadrature with its "
                "nodes, in height fog"
            )
        return HeightRays(self, light, rays, geometry, kernel, nodes)

    def _end(self, light):
        """Return the height of a light, or where the fog ends before it [m]."""
        return dr.clip(dr.dot(light.position, self.up), self.floor, self.cap)

    def _to_light(self, z, light, end):
        """Return how far a light is from heights upwards, how far within the fog, and
        the lower end of that [m].
        """
        # Columns are divided by these differences of heights: 1e-20 m stands for none.
        whole, part = (
            dr.maximum(dr.abs(other - z), 1e-20) for other in (dr.dot(light.position, self.up), end)
        )
        return whole, part, dr.minimum(z, end)

    def _fall(self, layer: Layer, z):
        # A quotient to its last digit by the reciprocal, which is the same everywhere.
        height, steep = z - layer.base, dr.rcp(layer.scale_height)
        above = height * steep
        above = dr.fma(dr.fma(-above, layer.scale_height, height), steep, above)
        # Where it is 1e24, all is as dark as beyond.
        return exp_bounded(-dr.maximum(above, 0 if self.clamped else -55.0))

    def _column(self, layer: Layer, low, rise, ends):
        """Return the integral of a layer over heights, `rise` [m] from `low` up, by its
        densities at the `ends` [m].
        """
        # Densities are over that at the base. Below the base of a clamped layer they are 1; above,
        # the mean over heights is the density at the lower end, the larger one, times phi.
        below = dr.clip(layer.base - low, 0, rise) if self.clamped else 0
        above, largest = rise - below, dr.maximum(*ends)
        u = above / layer.scale_height
        if not is_single(type(u)):
            return below + above * largest * phi(u)
        # Above 1/2 the difference has its digits; below, the series does, and takes
        # less than an exponential.
        series = type(u)(1 / 5040)
        for divisor in (720, 120, 24, 6, 2, 1):
            series = dr.fma(-u, series, 1 / divisor)
        return below + dr.select(
            u < 0.5, largest * (above * series), layer.scale_height * dr.abs(ends[0] - ends[1])
        )

    def _mean(self, low, rise):
        """Return the mean density between a height `low` and one `rise` above it, both
        between floor and cap [1/m].
        """
        total = self.constant
        for layer in self.layers:
            if not self.clamped:
                total = total + layer.sigma_t * self._fall(layer, low) * phi(
                    rise / layer.scale_height
                )
                continue
            # The part of the rise below the base has the density 1; a level segment lies below the
            # base or above it.
            below = dr.clip(layer.base - low, 0, rise)
            part = dr.select(rise > 0, below / rise, dr.select(low < layer.base, 1, type(rise)(0)))
            above = self._fall(layer, low) * phi((rise - below) / layer.scale_height)
            total = total + layer.sigma_t * (part + (1 - part) * above)
        return total

    def _between(self, z, other, r):
        """Return the optical depth between two heights a distance r apart; what is beyond
        floor and cap is left out.
        """
        a, b = dr.clip(z, self.floor, self.cap), dr.clip(other, self.floor, self.cap)
        low, rise, whole = dr.minimum(a, b), dr.abs(b - a), dr.abs(other - z)
        # The part of the path between floor and cap, by heights; within the fog it is all of r.
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

    #: of each panel, which then ends at the foot, too; None: as many as it needs
    nodes_asked: int | None = None

    def airlight(self, x0, x1):
        """Return the integral over lit segments [x0, x1] [m]."""
        if self.light.w:
            return super().airlight(x0, x1)
        # A sun in closed form, without nodes.
        x0, x1 = self.within(*self.geometry.lit_segment(x0, x1))
        return self.medium.albedo * dr.select(x1 > x0, self._sun(x0, x1), 0)

    def within(self, x0, x1):
        """Return the part of segments between floor and cap [m]. It goes on beyond the camera's
        optical reach: the depth to the light may fall as the depth to the camera grows.
        """
        enter, leave = self.rays.crossed[0]
        return dr.clip(x0, enter, leave), dr.clip(x1, enter, leave)

    def _sun(self, x0, x1):
        medium, (start, rise) = self.medium, self.rays.crossed[1]
        mu = -dr.dot(self.light.axis, medium.up)
        # exp(-E) tau phi(|q|), with the exponent E of both ways at the end where it is smaller: at
        # the beginning if E grows along the ray, q >= 0, else at the end.
        (tau,) = medium.optical_depth(self.rays, x0, x1)
        q = (1 - rise / mu) * tau
        x = dr.select(q >= 0, x0, x1)
        exponent = (
            medium.optical_depth(self.rays, 0, x)[0] + medium._overhead(dr.fma(rise, x, start)) / mu
        )
        return exp_bounded(-exponent) * tau * phi(dr.abs(q)) * self.angle(None, None)(medium.phase)

    def nodes(self, Float):
        """Return the number that was asked for, otherwise the usual one."""
        return self.nodes_asked or super().nodes(Float)

    def panel_width(self, Float):
        """Return the width of panels with the nodes that were asked for,
        otherwise the usual one.
        """
        # 6.0 in ln E for panels with a number of nodes that was asked for.
        return Float(6.0) if self.nodes_asked else super().panel_width(Float)

    def bends(self):
        """Return the bends of the fog; panels with nodes that were asked
        for end at the foot, too.
        """
        return (*super().bends(), self.geometry.foot) if self.nodes_asked else super().bends()

    def sum(self, totals):
        """Return the albedo times the sum of panels."""
        return self.medium.albedo * totals[0]

    def zeros(self, width):
        """Return one number: the fog is grey."""
        return [dr.zeros(type(self.geometry.height), width)]

    def panel(self, start: Start, depths):
        """Return the ends of panels, the density times p exp(-tau) at nodes, and the
        depths behind the panels.
        """
        (before,), medium, light = depths, self.medium, self.light
        Float, (origin, slope) = type(before), self.rays.crossed[1]
        rate = (
            Float(0) if self.nodes_asked else 1 / medium.longest(self.rays, light, start.x, CHANGE)
        )
        end = start.end(rate)
        length, x1 = end - start.s, start.foot + end

        # The density of each layer at the lower end, and its part of the depth of the panel.
        up, rise = slope > 0, dr.abs(slope)
        z_low = dr.fma(slope, dr.select(up, start.x, x1), origin)
        across, layers, at_light = medium.constant * length, [], medium._end(light)
        for layer in medium.layers:
            # Scale heights a metre of the ray; 1e-12 stands for none, and the layer's part is then
            # its density times the length. A clamped layer is constant below its base, where panels
            # end.
            steep = dr.maximum(rise / layer.scale_height, 1e-12)
            if medium.clamped:
                steep = dr.select(dr.fma(0.5 * rise, length, z_low) < layer.base, 1e-12, steep)
            at_low = medium._fall(layer, z_low)
            along = -at_low / steep
            across = dr.fma(layer.sigma_t * along, exp_expm1_bounded(-steep * length)[1], across)
            layers.append((layer, steep, at_low, along, medium._fall(layer, at_light)))
        after = before + across
        lowest, sign = dr.select(up, before, after), dr.select(up, Float(1), -1)

        def values(node: Node):
            # The distance of the node from the lower end, and heights from there to the light.
            far = dr.select(up, node.far, node.rest)
            whole, part, lower = medium._to_light(dr.fma(rise, far, z_low), light, at_light)
            density, camera, segment = (
                medium.constant,
                medium.constant * far,
                medium.constant * part,
            )
            # By layer one exponential: the density at the node, the depth from the lower end to it,
            # and the column between the node and the light.
            for layer, steep, at_low, along, at_end in layers:
                fraction, less = exp_expm1_bounded(-steep * far)
                at_node = at_low * fraction
                density = dr.fma(layer.sigma_t, at_node, density)
                camera = dr.fma(layer.sigma_t * along, less, camera)
                segment = dr.fma(
                    layer.sigma_t, medium._column(layer, lower, part, (at_node, at_end)), segment
                )
            # From the lower end upwards the depth from the camera rises on rays that rise, else
            # falls.
            exponent = dr.fma(sign, camera, lowest) + node.r * (segment * dr.rcp(whole))
            return [
                density * exp_bounded(-exponent) * medium.phase.evaluate_half(node.down, node.up)
            ]

        return end, values, [after]


def _root(fraction):
    """Return the fourth root: a panel may have so many scale heights of what is a
    fraction of its integral.
    """
    return dr.sqrt(dr.sqrt(fraction))


def phi(u):
    """Return (1 - e^-u)/u, 1 at u = 0, for u >= 0 (see the module)."""
    return dr.select(u > 0, opacity(u) / u, 1)
