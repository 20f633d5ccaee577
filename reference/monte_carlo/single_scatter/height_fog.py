# SPDX-License-Identifier: BSD-3-Clause
r"""Single scattering in height fog, sampled: Mitsuba's plugin says the density, antiderivatives the optical depths.

With an antiderivative G of the density over the height, constant beyond floor and cap, the optical depth of a segment
of length l between two heights is l (G(z_1) - G(z_0))/(z_1 - z_0), and that up to a sun at the height mu
(G(cap) - G(z))/mu. A sky shines from below too: then it is (G(z) - G(floor))/|mu|. For a layer

    G(z) = -sigma_i H_i exp(-(z - z_i)/H_i),     clamped below z_i:  sigma_i (z - z_i - H_i).

Where the heights are as good as one, the depth is the density between them times l. (The quadrature takes the lower end
and (1 - e^-u)/u.)

A free flight has the density sigma exp(-tau)/(1 - exp(-tau_end)): tau is inverted by bisection. Under a sun every
distance is one: the estimate is the transmittance of its path, and bounded. Under a light at a place one half of the
samples are equi-angular (`reference.monte_carlo.single_scatter.distance_sampling`). A light with extent has a point of
its own for each sample (`reference.monte_carlo.single_scatter.area_sampling`).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from reference.monte_carlo.single_scatter.area_estimate import area_surface, before_plane, path_begin, place_of
from reference.monte_carlo.single_scatter.area_sampling import AreaLight, sample_point
from reference.monte_carlo.single_scatter.boundary_walk import Leg, Surroundings, transmittance
from reference.monte_carlo.single_scatter.directional_sampling import drawn, mean_over_directions
from reference.monte_carlo.single_scatter.distance_sampling import (
    Span,
    closest_approach,
    cone_ends,
    equi_angular,
    equi_angular_range,
)
from reference.monte_carlo.single_scatter.stretches import Ray, cell_of, point_on

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
        there = dr.select(inside, length * self._density(middle), 0)
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

    def _density(self, z):
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
class _Way:
    """Camera rays in the fog."""

    ray: Ray
    start: Any  #: height of the camera [m]
    rise: Any  #: vertical component of the directions
    first: Any  #: where they enter the fog [m]
    last: Any  #: where they leave it or meet a surface [m]

    def depth(self, fog: HeightDensity, x):
        """Return the optical depth from the camera to distances x [m]."""
        return fog.depth(self.start, self.start + self.rise * x, x)


def height_fog_light(task: Any, sampler, ray: Ray, medium, active) -> tuple[Any, Any]:
    """Return airlight and lit surface along camera rays in height fog [W/(m^2 sr)]; see `estimator.ray_light`."""
    fog, around = task.fog, task.around
    airlight, surface = dr.zeros(mi.Spectrum, dr.width(active)), dr.zeros(mi.Spectrum, dr.width(active))
    start, rise = fog.height(ray.origin_double), fog.height(ray.direction_double)
    ends = [(z - start) / rise for z in (fog.floor, fog.cap)]
    level, inside = rise == 0, (start >= fog.floor) & (start <= fog.cap)
    first = dr.select(level, 0, dr.maximum(dr.minimum(*ends), 0))
    last = dr.select(level, dr.select(inside, _FARTHEST, 0), dr.clip(dr.maximum(*ends), 0, _FARTHEST))
    hit = None
    if around.surfaces:
        hit = around.scene.ray_intersect(mi.Ray3f(ray.origin, ray.direction), active)
        last = dr.select(hit.is_valid(), dr.minimum(last, mi.Float64(hit.t)), last)
    way = _Way(ray, start, rise, first, last)
    for light in task.lights:
        airlight += _local_airlight(task, sampler, way, medium, active, _of_light(light, ray.direction_double))
    for light in task.area:
        source = _of_area(light, ray, sampler.next_2d(active))
        airlight += _local_airlight(task, sampler, way, medium, active, source)
    for emitter in task.far:
        airlight += _sun_airlight(task, emitter, sampler, way, medium, active)
    if hit is not None:
        surface += _surface(task, sampler, way, hit, active & hit.is_valid())
    return airlight, surface


def _flight(fog: HeightDensity, way: _Way, u, low, high):
    """Return distances of free flights between two distances [m], with exp(-tau) there over the density, for u."""
    before, behind = way.depth(fog, low), way.depth(fog, high)
    whole = 1 - dr.exp(-(behind - before))
    wanted = before - dr.log(1 - mi.Float64(u) * whole)

    def halve(number, low, high):
        middle = 0.5 * (low + high)
        short = way.depth(fog, middle) < wanted
        return number + 1, dr.select(short, middle, low), dr.select(short, high, middle)

    state = (mi.UInt32(0), mi.Float64(low), mi.Float64(high))
    _, low, high = dr.while_loop(state, lambda number, *_: number < _BISECTIONS, halve, label="inverse of the depth")
    return 0.5 * (low + high), whole * dr.exp(-before)


def _sun_airlight(task: Any, emitter, sampler, way: _Way, medium, active):
    fog = task.fog
    active = active & (way.last > way.first)
    shift = sampler.next_1d(active)

    def add_sample(index, total, sampler):
        cell, width = cell_of(index, shift, task.samples)
        x, arrived = _flight(fog, way, cell + width * sampler.next_1d(active), way.first, way.last)
        point = point_on(way.ray, way.ray.origin + way.ray.direction * mi.Float(x))
        sample, irradiance = emitter.sample_direction(point, drawn(emitter, sampler, active), active)
        phase, _ = medium.phase_function().eval_pdf(mi.PhaseFunctionContext(), point, sample.d, active)
        depth = fog.beyond(way.start + way.rise * x, fog.height(sample.d))
        seen = lit(task.around, point.p, sample.d, sample.dist, active)
        value = _albedo(medium, point, active) * phase * irradiance * seen * mi.Float(arrived * dr.exp(-depth)) * width
        return index + 1, total + dr.select(active, value, 0), sampler

    state = (mi.UInt32(0), dr.zeros(mi.Spectrum, dr.width(active)), sampler)
    return dr.while_loop(state, lambda index, *_: index < task.samples, add_sample, label="distances")[1]


@dataclass(frozen=True)
class _Source:
    """A light at a place, or a point of a light with extent."""

    position: Any  #: of double precision [m]
    begin: Any  #: where its paths begin [m]
    ends: tuple[Any, Any]  #: of the part of the line that it could light, from the foot [m]
    sent: Callable[[Any, Any], Any]  #: to points, in directions from it: its intensity, over the density of the point
    counts: Any = True  #: where it was sampled


def _of_light(light, direction) -> Callable[[Any, Any], _Source]:
    """Return the source of a point or spot light."""

    def source(index, approach_to):
        ends = -dr.inf, dr.inf
        if light.axis is not None:
            ends = cone_ends(approach_to(light.position), direction, axis=light.axis, cutoff=light.cutoff)
        return _Source(light.position, mi.Point3f(light.position), ends, lambda at, _: intensity(light, at, True))

    return source


def _of_area(light: AreaLight, ray: Ray, start) -> Callable[[Any, Any], _Source]:
    """Return the sources of a light with extent, a point for each sample."""

    def source(index, approach_to):
        point = sample_point(*place_of(index, start), light, origin=ray.origin_double, direction=ray.direction_double)

        def sent(at, from_light):
            cosine = dr.maximum(dr.dot(mi.Vector3f(point.normal), from_light), 0)
            return light.radiance * (cosine / mi.Float(point.density))

        ends = before_plane(point, ray, approach_to(point.position).foot)
        return _Source(point.position, path_begin(point), ends, sent, point.density > 0)

    return source


def _local_airlight(task: Any, sampler, way: _Way, medium, active, source: Callable[[Any, Any], _Source]):
    """Estimate what lights at places send."""
    fog, ray = task.fog, way.ray
    shift = sampler.next_1d(active)

    def approach_to(position):
        return closest_approach(ray.origin_double, ray.direction_double, position)

    def add_sample(index, total, sampler):
        cell, width = cell_of(index, shift, task.samples)
        u = cell + width * sampler.next_1d(active)
        own, flies = dr.select(u < 0.5, 2 * u, 2 * u - 1), u >= 0.5
        lamp = source(index, approach_to)
        approach = approach_to(lamp.position)
        low, high = (approach.foot + end for end in lamp.ends)
        low, high = dr.maximum(way.first, low), dr.minimum(way.last, high)
        used = active & (high > low) & lamp.counts
        low, high = dr.select(used, low, 0), dr.select(used, high, 1)
        span = Span(approach.height, low - approach.foot, high - low)
        flown, arrived = _flight(fog, way, own, low, high)
        x = dr.select(flies, flown, low + equi_angular(mi.Float64(own), span))
        s = x - approach.foot
        square = approach.height * approach.height + s * s
        kept = dr.exp(-way.depth(fog, x))
        r = dr.sqrt(square)
        from_light = (
            mi.Vector3f(approach.normal) * mi.Float(approach.height) + ray.direction * mi.Float(s)
        ) / mi.Float(r)
        point = point_on(ray, mi.Point3f(lamp.position) + from_light * mi.Float(r))
        sigma_s, _, sigma_t = medium.get_scattering_coefficients(point, used)
        flights = dr.select(arrived > 0, mi.Float64(sigma_t[0]) * kept / arrived, 0)
        density = 0.5 * (flights + approach.height / (equi_angular_range(span) * square))
        phase, _ = medium.phase_function().eval_pdf(mi.PhaseFunctionContext(), point, -from_light, used)
        depth = fog.depth(way.start + way.rise * x, fog.height(lamp.position), r)
        path = point.p - lamp.begin
        seen = lit(task.around, lamp.begin, dr.normalize(path), dr.norm(path), used)
        value = sigma_s * phase * lamp.sent(point, from_light) * seen
        value *= mi.Float(kept * dr.exp(-depth) / (square * density)) * width
        return index + 1, total + dr.select(used & (density > 0), value, 0), sampler

    state = (mi.UInt32(0), dr.zeros(mi.Spectrum, dr.width(active)), sampler)
    return dr.while_loop(state, lambda index, *_: index < task.samples, add_sample, label="distances")[1]


def _surface(task: Any, sampler, way: _Way, hit, active):
    fog, total = task.fog, dr.zeros(mi.Spectrum, dr.width(active))
    at_hit, camera = fog.height(hit.p), way.depth(fog, mi.Float64(hit.t))
    for light in task.lights:
        position = mi.Point3f(light.position)
        from_light = hit.p - position
        r = dr.norm(from_light)
        from_light = from_light / r
        material = hit.bsdf().eval(mi.BSDFContext(), hit, hit.to_local(-from_light), active)
        depth = camera + fog.depth(at_hit, fog.height(light.position), mi.Float64(r))
        sent = material * intensity(light, hit, active) / (r * r) * lit(task.around, position, from_light, r, active)
        total += dr.select(active, sent * mi.Float(dr.exp(-depth)), 0)
    for emitter in task.far:

        def sent_by(numbers, emitter=emitter):
            sample, irradiance = emitter.sample_direction(hit, numbers, active)
            material = hit.bsdf().eval(mi.BSDFContext(), hit, hit.to_local(sample.d), active)
            depth = camera + fog.beyond(at_hit, fog.height(sample.d))
            # Rays from afar lose digits: a ball of 1 m, met from 200 m away, would shadow a third of itself.
            start = hit.spawn_ray(sample.d).o
            seen = lit(task.around, start, sample.d, sample.dist, active)
            return material * irradiance * seen * mi.Float(dr.exp(-depth))

        total += dr.select(active, mean_over_directions(emitter, sampler, task.samples, active, sent_by), 0)

    def left(begin, from_light, r):
        depth = camera + fog.depth(at_hit, fog.height(begin), mi.Float64(r))
        return lit(task.around, begin, from_light, r, active) * mi.Float(dr.exp(-depth))

    for light in task.area:
        total += area_surface(light, sampler, task.samples, hit, left=left, active=active)
    return total


def _albedo(medium, point, active):
    sigma_s, _, sigma_t = medium.get_scattering_coefficients(point, active)
    return dr.select(sigma_t > 0, sigma_s / sigma_t, 0)


def lit(around: Surroundings, start, direction, distance, active):
    """Return 1 where nothing stands within a distance, 0 elsewhere."""
    nothing = Leg(dr.zeros(mi.MediumPtr), dr.zeros(mi.Spectrum, dr.width(active)))
    return transmittance(around, start, direction, distance, media=nothing, active=active)


def intensity(light, interaction, active):
    """Return what a light at a place sends towards points [W/sr]."""
    sample, irradiance = light.emitter.sample_direction(interaction, mi.Point2f(0.5), active)
    return irradiance * sample.dist * sample.dist
