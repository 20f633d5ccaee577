# SPDX-License-Identifier: BSD-3-Clause
r"""What one scattering sends along camera rays: the estimator of the integrator `single-scatter`, in Dr.Jit.

For each point or spot light and each medium that a ray crosses, from x0 to x1,

    L = int_{x0}^{x1} T(0, x) sigma_s p(cos)/(4 pi) I/r^2 V T(x, light) dx

(T transmittance, V visibility) is estimated at distances that `reference.monte_carlo.single_scatter.distance_sampling`
draws. A surface at the end of the ray adds f cos I/r^2 V T T, which needs no sampling. Intensity I, phase function,
material f and the coefficients of the media are the answers of Mitsuba's own plugins, and only they. A directional
light has its irradiance E in the place of I/r^2; its distances come from
`reference.monte_carlo.single_scatter.directional_sampling`. Lights with extent:
`reference.monte_carlo.single_scatter.area_estimate`.

In a scene whose extinction depends on the channel all channels use the same distances, with the density of the mixture
over the channels, so that no channel's variance can become infinite.
"""

from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi

from reference.monte_carlo.single_scatter.area_estimate import area_airlight, area_leg, area_surface
from reference.monte_carlo.single_scatter.boundary_walk import (
    Leg,
    coefficients,
    is_boundary,
    medium_at,
    step_beyond,
    transmittance,
)
from reference.monte_carlo.single_scatter.density_grid import grid_light
from reference.monte_carlo.single_scatter.directional_sampling import drawn, mean_over_directions, sample_stretch
from reference.monte_carlo.single_scatter.distance_sampling import (
    Span,
    closest_approach,
    cone_ends,
    mixture_of,
    sample_distance,
)
from reference.monte_carlo.single_scatter.height_fog import height_fog_light
from reference.monte_carlo.single_scatter.scene_data import Light, Task
from reference.monte_carlo.single_scatter.stretches import Ray, Stretch, cell_of, point_on


def ray_light(task: Task, sampler, ray: Ray, medium, active) -> tuple[Any, Any]:
    """Return airlight and lit surface along camera rays [W/(m^2 sr)].

    `task`: see `reference.monte_carlo.single_scatter.scene_data`; `sampler`: Mitsuba's sampler, with one stream for
    each ray; `ray`: the rays; `medium`: what the rays start in: a Mitsuba medium, a pointer to one, or None for a
    vacuum; `active`: mask.
    """
    if medium is None:
        medium = dr.zeros(mi.MediumPtr)
    elif isinstance(medium, mi.Medium):
        medium = mi.MediumPtr(medium)
    if task.fog is not None:
        return height_fog_light(task, sampler, ray, medium, active)
    if task.majorant:
        return grid_light(task, sampler, ray, medium, active)
    if task.around.bounded:
        return _through_media(task, sampler, ray, medium, active)
    nothing = dr.zeros(mi.Spectrum, dr.width(active))
    at_lights = (medium,) * len(task.lights)
    stretch = Stretch(mi.Float(0), mi.Float(dr.inf), nothing, medium, *coefficients(medium, active), at_lights, medium)
    if not task.around.surfaces:
        return _airlight(task, sampler, ray, stretch, active), nothing
    hit = task.around.scene.ray_intersect(mi.Ray3f(ray.origin, ray.direction), active)
    stretch = replace(stretch, end=dr.select(hit.is_valid(), hit.t, dr.inf))
    airlight = _airlight(task, sampler, ray, stretch, active)
    return airlight, _surface(task, sampler, ray, hit, stretch, active & hit.is_valid())


def _through_media(task: Task, sampler, ray: Ray, medium, active) -> tuple[Any, Any]:
    """Follow camera rays from boundary to boundary, and add up what each stretch sends."""

    def walk(walking, sampler, done, start, depth, medium, airlight, surface):
        """Add the stretch to the next thing on the way, `done` being where the ray goes on, `start` the boundary."""
        onward = mi.Ray3f(ray.origin + ray.direction * done, ray.direction)
        hit = task.around.scene.ray_intersect(onward, walking)
        met = walking & hit.is_valid()
        end = dr.select(met, done + hit.t, dr.inf)
        stretch = Stretch(start, end, depth, medium, *coefficients(medium, walking), at_lights, at_camera)
        airlight = airlight + _airlight(task, sampler, ray, stretch, walking)
        passed = is_boundary(hit, met)
        surface = surface + _surface(task, sampler, ray, hit, stretch, met & ~passed)
        depth = dr.select(passed, depth + stretch.sigma_t * (end - start), depth)
        changes = passed & hit.is_medium_transition()
        medium = dr.select(changes, hit.target_medium(ray.direction), medium)
        done = dr.select(passed, end + step_beyond(hit.p), done)
        return passed, sampler, done, dr.select(passed, end, start), depth, medium, airlight, surface

    at_camera = medium
    places = [mi.Point3f(light.position) for light in task.lights]
    at_lights = tuple(medium_at(task.around, place, ray.origin, medium, active) for place in places)
    zero, nothing = dr.zeros(mi.Float, dr.width(active)), dr.zeros(mi.Spectrum, dr.width(active))
    medium = dr.select(active, medium, dr.zeros(mi.MediumPtr))
    state = (
        mi.Bool(active),
        sampler,
        zero,
        mi.Float(zero),
        nothing,
        medium,
        mi.Spectrum(nothing),
        mi.Spectrum(nothing),
    )
    final = dr.while_loop(state, lambda walking, *_: walking, walk, label="camera ray through media")
    return final[-2], final[-1]


def _airlight(task: Task, sampler, ray: Ray, stretch: Stretch, active):
    """Estimate what all lights send from a stretch of the ray."""
    total = dr.zeros(mi.Spectrum, dr.width(active))
    active = active & (dr.max(stretch.sigma_s) > 0)
    for number in range(len(task.lights)):
        total += _light_airlight(task, number, sampler, ray, stretch, active)
    for emitter in task.far:
        total += _directional_airlight(task, emitter, sampler, ray, stretch, active)
    for extended in task.area:
        total += area_airlight(task, extended, sampler, ray, stretch, active)
    return total


def _light_airlight(task: Task, number: int, sampler, ray: Ray, stretch: Stretch, active):
    """Estimate what one light sends from a stretch of the ray: a loop over the cells of the unit interval."""
    light = task.lights[number]
    approach = closest_approach(ray.origin_double, ray.direction_double, light.position)
    height, normal = mi.Float(approach.height), mi.Vector3f(approach.normal)
    first, last = stretch.start - approach.foot, stretch.end - approach.foot
    start, end = first, last
    if light.axis is not None:
        low, high = cone_ends(approach, ray.direction_double, axis=light.axis, cutoff=light.cutoff)
        start, end = dr.maximum(first, low), dr.minimum(last, high)
    span = Span(approach.height, start, end - start)
    active = active & (end > start)
    mixture = mixture_of(span, [stretch.sigma_t[0]] if task.grey else list(stretch.sigma_t))

    before = mi.Float(start - first)  # from the start of the stretch to that of the span
    shift = sampler.next_1d(active)

    def add_sample(index, total, sampler):
        cell, width = cell_of(index, shift, task.samples)
        y, s, density = sample_distance(cell + width * sampler.next_1d(active), mixture)
        r = dr.sqrt(height * height + s * s)
        from_light = (normal * height + ray.direction * s) / r
        used = active & (density > 0)
        sent = _scattered(task, number, ray, stretch, from_light, r, used)
        camera_leg = stretch.depth + stretch.sigma_t * (before + y)
        value = sent * dr.exp(-camera_leg) * (width / (r * r * density))
        return index + 1, total + dr.select(used, value, 0), sampler

    state = (mi.UInt32(0), dr.zeros(mi.Spectrum, dr.width(active)), sampler)
    return dr.while_loop(state, lambda index, *_: index < task.samples, add_sample, label="distances")[1]


def _directional_airlight(task: Task, emitter, sampler, ray: Ray, stretch: Stretch, active):
    """Estimate what a directional light or a sky sends from a stretch of the ray, likewise."""
    length = stretch.end - stretch.start
    active = active & (length > 0) & (length < dr.inf)
    length = dr.select(active, length, 1)
    rates = [stretch.sigma_t[0]] if task.grey else list(stretch.sigma_t)
    shift = sampler.next_1d(active)

    def add_sample(index, total, sampler):
        cell, width = cell_of(index, shift, task.samples)
        y, density = sample_stretch(cell + width * sampler.next_1d(active), length, rates)
        point = point_on(ray, ray.origin + ray.direction * (stretch.start + y))
        arriving, towards = _arriving(task, emitter, point, drawn(emitter, sampler, active), active)
        phase, _ = stretch.medium.phase_function().eval_pdf(mi.PhaseFunctionContext(), point, towards, active)
        value = stretch.sigma_s * phase * arriving * dr.exp(-stretch.depth - stretch.sigma_t * y) * (width / density)
        return index + 1, total + dr.select(active, value, 0), sampler

    state = (mi.UInt32(0), dr.zeros(mi.Spectrum, dr.width(active)), sampler)
    return dr.while_loop(state, lambda index, *_: index < task.samples, add_sample, label="plain distances")[1]


def _arriving(task: Task, emitter, interaction, numbers, active) -> tuple[Any, Any]:
    """Return the irradiance of a light from infinity that reaches points, and the direction that its numbers choose.

    The emitter names a point of the light's way that lies beyond everything: the leg begins there, in clear air.
    """
    sample, irradiance = emitter.sample_direction(interaction, numbers, active)
    media = Leg(dr.zeros(mi.MediumPtr), dr.zeros(mi.Spectrum, dr.width(active)))
    leg = transmittance(task.around, sample.p, -sample.d, sample.dist, media=media, active=active)
    return irradiance * leg, sample.d


def _scattered(task: Task, number: int, ray: Ray, stretch: Stretch, from_light, r, active):
    """Return sigma_s p/(4 pi) I V T of points at a distance r from a light, in a unit direction from there."""
    light = task.lights[number]
    position = mi.Point3f(light.position)
    point = point_on(ray, position + from_light * r)
    phase, _ = stretch.medium.phase_function().eval_pdf(mi.PhaseFunctionContext(), point, -from_light, active)
    intensity = _intensity(light, point, active)
    media = Leg(stretch.at_lights[number], stretch.sigma_t)
    leg = transmittance(task.around, position, from_light, r, media=media, active=active)
    return stretch.sigma_s * phase * intensity * leg


def _surface(task: Task, sampler, ray: Ray, hit, stretch: Stretch, active):
    """Return what all lights send by way of the surface at the end of a stretch."""
    total = dr.zeros(mi.Spectrum, dr.width(active))
    camera_leg = stretch.depth + stretch.sigma_t * dr.select(active, stretch.end - stretch.start, 0)
    for light, medium in zip(task.lights, stretch.at_lights):
        position = mi.Point3f(light.position)
        from_light = hit.p - position
        r = dr.norm(from_light)
        from_light = from_light / r
        material = hit.bsdf().eval(mi.BSDFContext(), hit, hit.to_local(-from_light), active)
        media = Leg(medium, stretch.sigma_t)
        leg = transmittance(task.around, position, from_light, r, media=media, active=active)
        sent = material * _intensity(light, hit, active) * leg / (r * r)
        total += dr.select(active, sent * dr.exp(-camera_leg), 0)
    for emitter in task.far:

        def sent_by(numbers, emitter=emitter):
            arriving, towards = _arriving(task, emitter, hit, numbers, active)
            return arriving * hit.bsdf().eval(mi.BSDFContext(), hit, hit.to_local(towards), active)

        sent = mean_over_directions(emitter, sampler, task.samples, active, sent_by)
        total += dr.select(active, sent * dr.exp(-camera_leg), 0)

    def left(begin, from_light, r):
        return area_leg(task, ray, begin, from_light, r, stretch=stretch, active=active) * dr.exp(-camera_leg)

    for extended in task.area:
        total += area_surface(extended, sampler, task.samples, hit, left=left, active=active)
    return total


def _intensity(light: Light, interaction, active):
    """Return the radiant intensity towards a point [W/sr]: the emitter's irradiance there times squared distance."""
    sample, irradiance = light.emitter.sample_direction(interaction, mi.Point2f(0.5), active)
    return irradiance * sample.dist * sample.dist
