# SPDX-License-Identifier: BSD-3-Clause
"""Single scattering in a density grid, sampled: extinctions by Mitsuba's plugin, transmittances by ratio tracking.

Transmittances are unbiased estimates by ratio tracking with Mitsuba's own majorant m (Novak, Selle, Jarosz 2014): the
product of 1 - sigma_t/m over the points of a Poisson process of the density m. No cell of the grid and no optical depth
is known here. Distances are equi-angular about lights at places and even under suns and skies, between the ends of the
box; a sky has a direction, a light with extent a point of its own for each sample. Integrands are bounded: over the
angle at a place sigma_t T_1 T_2 p height, under a sun sigma_t T_1 T_2 p.
"""

from typing import Any

import drjit as dr
import mitsuba as mi

from reference.monte_carlo.single_scatter.area_estimate import before_plane, path_begin, place_of, point_for_surface
from reference.monte_carlo.single_scatter.area_sampling import sample_point
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
    lies = active & meets & (ends[1] > ends[0])

    def equi_angular_sample(u, position, part):
        """Return a distance about a light, the way from there and its length, and r^2 over the density."""
        approach = closest_approach(ray.origin_double, ray.direction_double, position)
        low, high = (approach.foot + end for end in part(approach))
        low, high = dr.maximum(ends[0], low), dr.minimum(ends[1], high)
        used = high > low
        low, high = dr.select(used, low, 0), dr.select(used, high, 1)
        span = Span(approach.height, low - approach.foot, high - low)
        x = mi.Float(low + equi_angular(mi.Float64(u), span))
        way = ray.origin + ray.direction * x - mi.Point3f(position)
        # r^2 of the light and of the density are one.
        return x, way, dr.norm(way), dr.select(used, mi.Float(equi_angular_range(span) / span.height), 0)

    for light in task.lights:

        def sample(u, numbers, light=light):
            def part(approach):
                if light.axis is None:
                    return -dr.inf, dr.inf
                return cone_ends(approach, ray.direction_double, axis=light.axis, cutoff=light.cutoff)

            x, way, r, value = equi_angular_sample(u, light.position, part)
            point = point_on(ray, ray.origin + ray.direction * x)
            return x, point, mi.Point3f(light.position), way / r, r, intensity(light, point, True) * value

        airlight, sampler = _add(airlight, task, sampler, ray, medium, active=lies, sample=sample)
    for extended in task.area:

        def sample_area(u, numbers, light=extended):
            one, other = numbers
            point = sample_point(one, other, light, origin=ray.origin_double, direction=ray.direction_double)
            x, way, r, value = equi_angular_sample(
                u, point.position, lambda approach: before_plane(point, ray, approach.foot)
            )
            value *= dr.maximum(dr.dot(mi.Vector3f(point.normal), way / r), 0) / mi.Float(point.density)
            there, begin = point_on(ray, ray.origin + ray.direction * x), path_begin(point)
            path = there.p - begin
            value = light.radiance * dr.select(point.density > 0, value, 0)
            return x, there, begin, dr.normalize(path), dr.norm(path), value

        airlight, sampler = _add(airlight, task, sampler, ray, medium, active=lies, sample=sample_area)
    for emitter in task.far:

        def sample_far(u, numbers, emitter=emitter):
            x = ends[0] + (ends[1] - ends[0]) * u
            point = point_on(ray, ray.origin + ray.direction * x)
            towards, irradiance = emitter.sample_direction(point, mi.Point2f(*numbers), True)
            return x, point, towards.p, -towards.d, towards.dist, irradiance * (ends[1] - ends[0])

        airlight, sampler = _add(airlight, task, sampler, ray, medium, active=lies, sample=sample_far)
    if hit is not None:
        seen = active & hit.is_valid()
        for emitter in (*(light.emitter for light in task.lights), *task.far):

            def arriving(index, start, emitter=emitter):
                sample, irradiance = emitter.sample_direction(hit, mi.Point2f(*place_of(index, start)), seen)
                material = hit.bsdf().eval(mi.BSDFContext(), hit, hit.to_local(sample.d), seen)
                # Rays from afar lose digits: a ball of 1 m, met from 200 m away, would shadow a third of itself.
                return hit.spawn_ray(sample.d).o, sample.d, sample.dist, material * irradiance

            surface, sampler = _add_surface(surface, task, sampler, ray, medium, hit, active=seen, arriving=arriving)
        for extended in task.area:

            def from_area(index, start, light=extended):
                return point_for_surface(index, start, light, hit, seen)

            surface, sampler = _add_surface(surface, task, sampler, ray, medium, hit, active=seen, arriving=from_area)
    return airlight, surface


def _add(total, task: Any, sampler, ray: Ray, medium, *, active, sample) -> tuple[Any, Any]:
    """Add samples of one light, one from each cell of the unit interval; return the sum and the sampler."""
    shift, start = sampler.next_1d(active), sampler.next_2d(active)

    def add(index, total, sampler):
        cell, width = cell_of(index, shift, task.samples)
        x, point, begin, away, r, value = sample(cell + width * sampler.next_1d(), place_of(index, start))
        sigma_s, _, _ = medium.get_scattering_coefficients(point, active)
        phase, _ = medium.phase_function().eval_pdf(mi.PhaseFunctionContext(), point, -away, active)
        camera, sampler = tracked(task, medium, ray.origin, ray.direction, x, sampler, active)
        light, sampler = tracked(task, medium, point.p, -away, r, sampler, active)
        value = sigma_s * phase * value * (camera * light * width) * lit(task.around, begin, away, r, active)
        return index + 1, total + dr.select(active, value, 0), sampler

    state = (mi.UInt32(0), total, sampler)
    _, total, sampler = dr.while_loop(state, lambda index, *_: index < task.samples, add, label="distances")
    return total, sampler


def _add_surface(total, task: Any, sampler, ray: Ray, medium, hit, *, active, arriving) -> tuple[Any, Any]:
    """Add the mean of samples of one light by way of the surfaces; return the sum and the sampler."""
    start = sampler.next_2d(active)

    def add(index, total, sampler):
        begin, way, r, value = arriving(index, start)
        camera, sampler = tracked(task, medium, ray.origin, ray.direction, hit.t, sampler, active)
        light, sampler = tracked(task, medium, begin, way, r, sampler, active)
        value = value * lit(task.around, begin, way, r, active) * (camera * light / task.samples)
        return index + 1, total + dr.select(active, value, 0), sampler

    state = (mi.UInt32(0), total, sampler)
    _, total, sampler = dr.while_loop(state, lambda index, *_: index < task.samples, add, label="surfaces")
    return total, sampler
