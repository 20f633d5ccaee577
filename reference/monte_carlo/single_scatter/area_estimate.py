# SPDX-License-Identifier: BSD-3-Clause
r"""What lights with extent send along camera rays: the estimator's part for `area` emitters, in Dr.Jit.

For each light and each medium that a ray crosses,

    L = int_A int_{x0}^{x1} T(0, x) sigma_s p(cos)/(4 pi) Le max(0, n . w)/r^2 V T(x, y) dx dA(y),

w the unit vector from the point y of the light to the point x of the ray. One sample is one point y and one distance
along the ray. The points are those of a Kronecker sequence with a random start (`_STEPS`), the distances lie in the
cells of `reference.monte_carlo.single_scatter.stretches`. The plane of y clips the ray: what lies behind it gets no
light from there. Phase function, material and media are the answers of Mitsuba's own plugins; the light is read again
(`reference.monte_carlo.single_scatter.area_sampling`), and nothing asks Mitsuba's `sample_direction` for it.

A surface at the end of a ray adds f cos Le max(0, n . w)/r^2 V T T, the mean over points spread evenly over the area.
Height fog and density grids take points and surfaces from here.
"""

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi

from reference.monte_carlo.single_scatter.area_sampling import AreaLight, LightPoint, sample_evenly, sample_point
from reference.monte_carlo.single_scatter.boundary_walk import Leg, medium_at, step_beyond, transmittance
from reference.monte_carlo.single_scatter.distance_sampling import Span, closest_approach, mixture_of, sample_distance
from reference.monte_carlo.single_scatter.stretches import Ray, Stretch, cell_of, point_on

_STEPS = (0.7548776662466927, 0.5698402909980532)  # 1/x and 1/x^2 with x^3 = x + 1: they fill a square evenly
_LEAST_SLOPE = 1e-12  # of a ray against the plane of a light's point


def area_airlight(task: Any, light: AreaLight, sampler, ray: Ray, stretch: Stretch, active):
    """Estimate what a light with extent sends from a stretch of the ray.

    `task`: what is fixed while the scene is traced; `light`: of `task`; `sampler`: Mitsuba's sampler; `ray`, `stretch`:
    camera rays, and their part in one medium; `active`: mask.
    """
    shift, start = sampler.next_1d(active), sampler.next_2d(active)

    def add_sample(index, total, sampler):
        cell, width = cell_of(index, shift, task.samples)
        point = sample_point(*place_of(index, start), light, origin=ray.origin_double, direction=ray.direction_double)
        approach = closest_approach(ray.origin_double, ray.direction_double, point.position)
        first, last = stretch.start - approach.foot, stretch.end - approach.foot
        low, high = before_plane(point, ray, approach.foot)
        low, high = dr.maximum(first, low), dr.minimum(last, high)
        used = active & (high > low) & (point.density > 0)
        low = dr.select(used, low, 0)
        span = Span(approach.height, low, dr.select(used, high - low, 1))
        mixture = mixture_of(span, [stretch.sigma_t[0]] if task.grey else list(stretch.sigma_t))
        y, s, density = sample_distance(cell + width * sampler.next_1d(active), mixture)
        height = mi.Float(approach.height)
        r = dr.sqrt(height * height + s * s)
        from_light = (mi.Vector3f(approach.normal) * height + ray.direction * s) / r
        used &= density > 0
        cosine = dr.maximum(dr.dot(mi.Vector3f(point.normal), from_light), 0)
        there = point_on(ray, mi.Point3f(point.position) + from_light * r)
        phase, _ = stretch.medium.phase_function().eval_pdf(mi.PhaseFunctionContext(), there, -from_light, used)
        begin = path_begin(point)
        way = there.p - begin
        leg = area_leg(task, ray, begin, dr.normalize(way), dr.norm(way), stretch=stretch, active=used)
        camera_leg = stretch.depth + stretch.sigma_t * (mi.Float(low - first) + y)
        weight = width * cosine / (r * r * density * mi.Float(point.density))
        value = stretch.sigma_s * phase * light.radiance * leg * dr.exp(-camera_leg) * weight
        return index + 1, total + dr.select(used, value, 0), sampler

    state = (mi.UInt32(0), dr.zeros(mi.Spectrum, dr.width(active)), sampler)
    return dr.while_loop(state, lambda index, *_: index < task.samples, add_sample, label="points of a light")[1]


def area_surface(light: AreaLight, sampler, samples: int, hit, *, left: Callable[[Any, Any, Any], Any], active):
    """Estimate what a light with extent sends by way of the surfaces that camera rays meet.

    `light`, `samples`: it, and points on it; `sampler`: Mitsuba's sampler; `hit`: surface interactions; `left`: what
    arrives at the camera, for where paths begin at the light, their unit directions and lengths; `active`: mask.
    """
    start = sampler.next_2d(active)

    def add_sample(index, total, sampler):
        begin, from_light, r, value = point_for_surface(index, start, light, hit, active)
        return index + 1, total + dr.select(active, value * left(begin, from_light, r) / samples, 0), sampler

    state = (mi.UInt32(0), dr.zeros(mi.Spectrum, dr.width(active)), sampler)
    return dr.while_loop(state, lambda index, *_: index < samples, add_sample, label="points for a surface")[1]


def point_for_surface(index, start, light: AreaLight, hit, active) -> tuple[Any, Any, Any, Any]:
    """Return where paths from a light begin, their unit directions, lengths [m], and f cos Le cos/(r^2 density)."""
    point = sample_evenly(*place_of(index, start), light)
    away = hit.p - mi.Point3f(point.position)
    r = dr.norm(away)
    from_light = away / r
    cosine = dr.maximum(dr.dot(mi.Vector3f(point.normal), from_light), 0)
    material = hit.bsdf().eval(mi.BSDFContext(), hit, hit.to_local(-from_light), active)
    begin = path_begin(point)
    way = hit.p - begin
    value = material * light.radiance * (cosine / (r * r * mi.Float(point.density)))
    return begin, dr.normalize(way), dr.norm(way), value


def place_of(index, start) -> tuple[Any, Any]:
    """Return a point of the unit square, given its number and where the sequence starts."""
    number = mi.Float64(index)
    u, v = (mi.Float64(begin) + number * step for begin, step in zip(start, _STEPS))
    return u - dr.floor(u), v - dr.floor(v)


def before_plane(point: LightPoint, ray: Ray, foot) -> tuple[Any, Any]:
    """Return the ends of the part of a line before the plane of a light's point, as distances from the foot."""
    slope = dr.dot(ray.direction_double, point.normal)
    level = dr.dot(ray.origin_double - point.position, point.normal)
    parallel = dr.abs(slope) < _LEAST_SLOPE
    crossing = -level / dr.select(parallel, 1, slope) - foot
    infinity = dr.inf
    low = dr.select(~parallel & (slope > 0), crossing, -infinity)
    high = dr.select(~parallel & (slope < 0), crossing, infinity)
    return low, dr.select(parallel & (level <= 0), -infinity, high)


def path_begin(point: LightPoint) -> Any:
    """Return where paths from a point of a light begin, a hair before the light's own surface [m]."""
    position = mi.Point3f(point.position)
    return position + mi.Vector3f(point.normal) * step_beyond(position)


def area_leg(task: Any, ray: Ray, begin, direction, distance, *, stretch: Stretch, active):
    """Return the transmittance of paths from a light."""
    at_light = (
        medium_at(task.around, begin, ray.origin, stretch.at_camera, active) if task.around.bounded else stretch.medium
    )
    return transmittance(task.around, begin, direction, distance, media=Leg(at_light, stretch.sigma_t), active=active)
