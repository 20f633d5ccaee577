# SPDX-License-Identifier: BSD-3-Clause
r"""Camera rays in height fog, sampled: Mitsuba's plugin says the density, antiderivatives the optical depths.

With an antiderivative G of the density over the height, constant beyond floor and cap, the optical depth of a segment
of length l between two heights is l (G(z_1) - G(z_0))/(z_1 - z_0), and that up to a sun at the height mu
(G(cap) - G(z))/mu. A sky shines from below too: then it is (G(z) - G(floor))/|mu|. For a layer

    G(z) = -sigma_i H_i exp(-(z - z_i)/H_i),     clamped below z_i:  sigma_i (z - z_i - H_i).

Where the heights are as good as one, the depth is the density between them times l. (The quadrature takes the lower end
and (1 - e^-u)/u.)

A free flight has the density sigma exp(-tau)/(1 - exp(-tau_end)): tau is inverted by bisection. Under a sun every
distance is one: the estimate is the transmittance of its path, and bounded. Under a light at a place one half of the
samples are equi-angular (`reference.monte_carlo.single_scatter.distance_sampling`).
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from reference.monte_carlo.single_scatter.boundary_walk import Surroundings
from reference.monte_carlo.single_scatter.distance_sampling import Span, equi_angular, equi_angular_pdf
from reference.monte_carlo.single_scatter.stretches import Part, Path, Ray, lit

_LEVEL = 1e-5  # scale heights between two heights that are as good as one
_FARTHEST = 1e6  # of level rays [m]
_BISECTIONS = 48


@dataclass(frozen=True)
class HeightDensity:
    """The numbers of a `heightfog`, of double precision."""

    layers: tuple[tuple[float, float, float], ...]  #: extinction [1/m], base [m], scale height [m]
    constant: float  #: [1/m]
    clamped: bool
    floor: float  #: [m]
    cap: float  #: [m]
    up: Any  #: unit vector

    def height(self, point):
        """Return heights of points or vectors [m]."""
        return dr.dot(mi.Vector3d(point), self.up)

    def depth(self, z0, z1, length):
        """Return optical depths between two heights, a length apart [m]."""
        least = min((scale for _, _, scale in self.layers), default=1.0)
        level = dr.abs(z1 - z0) < _LEVEL * least
        rise = dr.select(level, 1, z1 - z0)
        middle = 0.5 * (z0 + z1)
        inside = (middle >= self.floor) & (middle <= self.cap)
        there = dr.select(inside, length * self.density(middle), 0)
        return dr.select(level, there, length * (self.antiderivative(z1) - self.antiderivative(z0)) / rise)

    def beyond(self, z, rise):
        """Return the optical depth from heights [m] out of the fog; `rise`: vertical, of unit directions."""
        there = self.antiderivative(z)
        above, below = (self.antiderivative(mi.Float64(end)) for end in (self.cap, self.floor))
        return dr.select(rise > 0, above - there, there - below) / dr.maximum(dr.abs(rise), 1e-30)

    def antiderivative(self, z):
        """Return G at heights [m]."""
        z = dr.clip(z, self.floor, self.cap)
        total = self.constant * z
        for sigma_t, base, scale in self.layers:
            over = z - base
            fallen = -scale * dr.exp(-(dr.maximum(over, 0) if self.clamped else over) / scale)
            total += sigma_t * (dr.select(over < 0, over - scale, fallen) if self.clamped else fallen)
        return total

    def density(self, z):
        """Return the extinction at heights between floor and cap [1/m]."""
        total = mi.Float64(self.constant)
        for sigma_t, base, scale in self.layers:
            over = z - base
            total += sigma_t * dr.exp(-(dr.maximum(over, 0) if self.clamped else over) / scale)
        return total


def read_height_density(medium) -> HeightDensity | None:
    """Return the numbers of a Mitsuba medium that is height fog, None of others."""
    parameters = mi.traverse(medium)
    if "sigma_t.H_1" not in parameters:
        return None
    scale = float(parameters["scale"])
    number = {
        key[8:]: np.ravel(np.array(parameters[key], dtype=np.float64))
        for key in parameters.keys()  # noqa: SIM118 - of pairs
        if key.startswith("sigma_t.")
    }
    layers = tuple(
        (scale * float(number[f"sigma_{i}"][0]), float(number[f"z_{i}"][0]), float(number[f"H_{i}"][0]))
        for i in "12"
        if number[f"sigma_{i}"][0] > 0
    )
    ends = float(number["floor"][0]), float(number["cap"][0])
    up = mi.Vector3d(*(float(each) for each in number["up"]))
    return HeightDensity(layers, scale * float(number["sigma_0"][0]), bool(number["clamped"][0]), *ends, up)


@dataclass(frozen=True)
class _FogPart(Part):
    """Camera rays in the fog."""

    fog: HeightDensity
    height: Any  # of the camera [m]
    rise: Any  # vertical component of the directions

    def depth(self, x):
        """Return the optical depth from the camera to distances x [m]."""
        return self.fog.depth(self.height, self.height + self.rise * x, x)

    def distances(self, u, low, length, span: Span | None) -> tuple[Any, Any]:
        """Sample free flights, for a light at a place half of the distances by the angle at it; see `Part`."""
        u = mi.Float64(u)
        before = self.depth(low)
        whole = 1 - dr.exp(before - self.depth(low + length))
        own = u if span is None else dr.select(u < 0.5, 2 * u, 2 * u - 1)
        wanted = before - dr.log(1 - own * whole)

        def halve(number, below, above):
            middle = 0.5 * (below + above)
            short = self.depth(middle) < wanted
            return number + 1, dr.select(short, middle, below), dr.select(short, above, middle)

        state = (mi.UInt32(0), mi.Float64(low), mi.Float64(low + length))
        found = dr.while_loop(state, lambda number, *_: number < _BISECTIONS, halve, label="inverse of the depth")
        y = 0.5 * (found[1] + found[2]) - low
        if span is not None:
            y = dr.select(u < 0.5, equi_angular(own, span), y)
        x = low + y
        kept = dr.exp(before - self.depth(x))
        flights = dr.select(whole > 0, self.fog.density(self.height + self.rise * x) * kept / whole, 0)
        return y, flights if span is None else 0.5 * (flights + equi_angular_pdf(y, span))

    def kept(self, x, point, path: Path, ray: Ray, sampler, active) -> tuple[Any, Any]:
        """Return the transmittance of both ways; see `Part`."""
        fog, z = self.fog, self.fog.height(point.p)
        if path.end is None:
            depth = fog.depth(z, fog.height(path.begin), mi.Float64(path.length))
        else:
            depth = fog.beyond(z, fog.height(-path.away))
        return lit(self.around, path, active) * mi.Float(dr.exp(-self.depth(x) - depth)), sampler


def height_fog_part(fog: HeightDensity, around: Surroundings, ray: Ray, medium, distance) -> Part:
    """Return the part of camera rays in height fog, up to the surface at a distance [m]."""
    height, rise = fog.height(ray.origin_double), fog.height(ray.direction_double)
    ends = [(z - height) / rise for z in (fog.floor, fog.cap)]
    level, inside = rise == 0, (height >= fog.floor) & (height <= fog.cap)
    first = dr.select(level, 0, dr.maximum(dr.minimum(*ends), 0))
    last = dr.select(level, dr.select(inside, _FARTHEST, 0), dr.clip(dr.maximum(*ends), 0, _FARTHEST))
    last = dr.minimum(last, mi.Float64(distance))
    return _FogPart(around, first, last, medium, last > first, fog, height, rise)
