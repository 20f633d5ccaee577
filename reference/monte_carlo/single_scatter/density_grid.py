# SPDX-License-Identifier: BSD-3-Clause
"""Single scattering in a density grid, sampled: extinctions by Mitsuba's plugin, transmittances by ratio tracking.

Transmittances are unbiased estimates by ratio tracking with Mitsuba's own majorant m (Novak, Selle, Jarosz 2014): the
product of 1 - sigma_t/m over the points of a Poisson process of the density m. No cell of the grid and no optical depth
is known here. Distances are equi-angular about lights at places and even under suns, between the ends of the box. Both
integrands are bounded. Over the angle at a place it is sigma_t T_1 T_2 p height, under a sun sigma_t T_1 T_2 p.
"""

from typing import Any

import drjit as dr
import mitsuba as mi

from reference.monte_carlo.single_scatter.distance_sampling import (
    Span,
    closest_approach,
    cone_ends,
    equi_angular,
    equi_angular_range,
)
from reference.monte_carlo.single_scatter.height_fog import intensity, lit
from reference.monte_carlo.single_scatter.stretches import Ray, cell_of, point_on

_FARTHEST = 1e6  # of rays that meet nothing [m]


def read_majorant(medium) -> float:
    """Return the largest extinction of a Mitsuba medium with a grid [1/m], 0 of others."""
    if "sigma_t.data" not in mi.traverse(medium):
        return 0.0
    return float(dr.max(medium.get_majorant(dr.zeros(mi.MediumInteraction3f)))[0])


def tracked(task: Any, medium, origin, direction, distance, sampler, active) -> tuple[Any, Any]:
    """Return estimates of the transmittance along lines, up to a distance [m], and the sampler."""
    meets, near, far = medium.intersect_aabb(mi.Ray3f(origin, direction))
    begin, end = dr.maximum(near, 0), dr.minimum(far, distance)

    def fly(x, kept, sampler):
        x = x - dr.log(1 - sampler.next_1d()) / task.majorant
        place = dr.zeros(mi.MediumInteraction3f)
        place.p = origin + direction * x
        _, _, sigma_t = medium.get_scattering_coefficients(place, x < end)
        return x, dr.select(x < end, kept * (1 - sigma_t[0] / task.majorant), kept), sampler

    start = dr.select(active & meets, begin, dr.inf)
    state = start, dr.full(mi.Float, 1, dr.width(start)), sampler
    _, kept, sampler = dr.while_loop(state, lambda x, *_: x < end, fly, label="ratio tracking")
    return kept, sampler


def grid_light(task: Any, sampler, ray: Ray, medium, active) -> tuple[Any, Any]:
    """Return airlight and lit surface along camera rays in a density grid [W/(m^2 sr)]; see `estimator.ray_light`."""
    around, last, hit = task.around, mi.Float(_FARTHEST), None
    if around.surfaces:
        hit = around.scene.ray_intersect(mi.Ray3f(ray.origin, ray.direction), active)
        last = dr.select(hit.is_valid(), hit.t, last)
    meets, near, far = medium.intersect_aabb(mi.Ray3f(ray.origin, ray.direction))
    ends = dr.maximum(near, 0), dr.minimum(far, last)
    airlight, surface = dr.zeros(mi.Spectrum, dr.width(active)), dr.zeros(mi.Spectrum, dr.width(active))
    for light in task.lights:
        approach = closest_approach(ray.origin_double, ray.direction_double, light.position)
        low, high = (mi.Float64(end) for end in ends)
        if light.axis is not None:
            cone = cone_ends(approach, ray.direction_double, axis=light.axis, cutoff=light.cutoff)
            low, high = dr.maximum(low, approach.foot + cone[0]), dr.minimum(high, approach.foot + cone[1])
        lies = active & meets & (high > low)
        low, high = dr.select(lies, low, 0), dr.select(lies, high, 1)
        span = Span(approach.height, low - approach.foot, high - low)
        angle, position = equi_angular_range(span), mi.Point3f(light.position)

        def sample(u, low=low, span=span, angle=angle, position=position, light=light):
            x = mi.Float(low + equi_angular(mi.Float64(u), span))
            point = point_on(ray, ray.origin + ray.direction * x)
            way = point.p - position
            r = dr.norm(way)
            # r^2 of the light and of the density are one.
            return x, point, position, way / r, r, intensity(light, point, True) * mi.Float(angle / span.height)

        found, sampler = _sum(task, sampler, ray, medium, lies, sample)
        airlight += found
    for emitter in task.far:
        lies = active & meets & (ends[1] > ends[0])

        def sample_sun(u, emitter=emitter):
            x = ends[0] + (ends[1] - ends[0]) * u
            point = point_on(ray, ray.origin + ray.direction * x)
            towards, irradiance = emitter.sample_direction(point, mi.Point2f(0.5), True)
            return x, point, towards.p, -towards.d, towards.dist, irradiance * (ends[1] - ends[0])

        found, sampler = _sum(task, sampler, ray, medium, lies, sample_sun)
        airlight += found
    if hit is not None:
        for emitter in (*(light.emitter for light in task.lights), *task.far):
            surface += _surface(task, emitter, sampler, ray, medium, hit, active & hit.is_valid())
    return airlight, surface


def _sum(task: Any, sampler, ray: Ray, medium, active, sample) -> tuple[Any, Any]:
    """Return the mean of samples of one light, one from each cell of the unit interval, and the sampler."""
    shift = sampler.next_1d(active)

    def add(index, total, sampler):
        cell, width = cell_of(index, shift, task.samples)
        x, point, start, away, r, value = sample(cell + width * sampler.next_1d())
        sigma_s, _, _ = medium.get_scattering_coefficients(point, active)
        phase, _ = medium.phase_function().eval_pdf(mi.PhaseFunctionContext(), point, -away, active)
        camera, sampler = tracked(task, medium, ray.origin, ray.direction, x, sampler, active)
        light, sampler = tracked(task, medium, point.p, -away, r, sampler, active)
        value = sigma_s * phase * value * (camera * light * width) * lit(task.around, start, away, r, active)
        return index + 1, total + dr.select(active, value, 0), sampler

    state = (mi.UInt32(0), dr.zeros(mi.Spectrum, dr.width(active)), sampler)
    _, total, sampler = dr.while_loop(state, lambda index, *_: index < task.samples, add, label="distances")
    return total, sampler


def _surface(task: Any, emitter, sampler, ray: Ray, medium, hit, active):
    """Return the surface in the light of one emitter: the mean of as many transmittances as there are samples."""
    towards, arriving = emitter.sample_direction(hit, mi.Point2f(0.5), active)
    material = hit.bsdf().eval(mi.BSDFContext(), hit, hit.to_local(towards.d), active)
    sent = material * arriving * lit(task.around, towards.p, -towards.d, towards.dist, active)

    def add(index, total, sampler):
        camera, sampler = tracked(task, medium, ray.origin, ray.direction, hit.t, sampler, active)
        light, sampler = tracked(task, medium, hit.p, towards.d, towards.dist, sampler, active)
        return index + 1, total + camera * light, sampler

    state = (mi.UInt32(0), dr.zeros(mi.Float, dr.width(active)), sampler)
    _, kept, _ = dr.while_loop(state, lambda index, *_: index < task.samples, add, label="transmittances")
    return dr.select(active, sent * (kept / task.samples), 0)
