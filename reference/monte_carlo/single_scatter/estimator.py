# SPDX-License-Identifier: BSD-3-Clause
r"""Light scattered once into camera rays: the estimator of the integrator
`single-scatter`, in Dr.Jit.

For each light and each medium that a ray crosses, from x0 to x1,

    L = int_{x0}^{x1} T(0, x) sigma_s p(cos)/(4 pi) E V T(x, light) dx

(T transmittance, V visibility) is estimated at distances that the medium draws. E is the irradiance
of a light at the point, I/r^2 for a light at a place. Area lights and a sky are integrals over
their points and directions: each sample has its own, from a Kronecker sequence with a random start.
A surface at the end of the ray adds f cos E V T T, for such lights as the mean over samples; a mirror,
which no sample finds, the radiance of the light that it shows, through both ways. Lights
come from `reference.monte_carlo.single_scatter.sources`, transmittances from the medium
(`reference.monte_carlo.single_scatter.stretches.Part`); phase function, scattering and material f
come from Mitsuba's plugins alone. The equation of a model has
`reference.monte_carlo.single_scatter.model_rays`.

In a scene whose extinction depends on the channel all channels use the same distances, with the
density of the mixture over the channels, so that no channel's variance can become infinite.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import drjit as dr
import mitsuba as mi

from airlight.reference.monte_carlo.single_scatter.boundary_walk import (
    Surroundings,
    coefficients,
    is_boundary,
    medium_at,
    step_beyond,
)
from airlight.reference.monte_carlo.single_scatter.sources import AreaSource, FarSource, Source
from airlight.reference.monte_carlo.single_scatter.stretches import (
    Part,
    Ray,
    Stretch,
    cell_of,
    place_of,
)
from airlight.reference.monte_carlo.single_scatter.varying_media import varying_part
from airlight.reference.scene.varying import VaryingMedium

#: radiance that camera rays receive [W/(m^2 sr)], and the sampler after the numbers that it took
Estimate: TypeAlias = "tuple[mi.Spectrum, mi.Sampler]"
#: radiance from the air and from lit surfaces [W/(m^2 sr)]
Light: TypeAlias = "tuple[mi.Spectrum, mi.Spectrum]"


@dataclass(frozen=True)
class Task:
    """The constants of a scene while it is traced."""

    around: Surroundings  #: the shapes that rays can meet
    sources: tuple[Source, ...]  #: the lights
    samples: int  #: distances for each ray, light and medium
    grey: bool  #: no medium's extinction depends on the channel
    mirrors: bool  #: whether a surface may show area lights and a sky
    start: "mi.MediumPtr"  #: the medium in which camera rays start
    #: the same as numbers, if its extinction differs from place to place
    varying: VaryingMedium | None = None


#: what returns the light of a task's sources along camera rays
Trace: TypeAlias = "Callable[[Task, mi.Sampler, Ray, mi.Bool], Light]"


def source_light(
    trace: Trace, task: Task, source: Source, sampler: "mi.Sampler", ray: Ray, active: "mi.Bool"
) -> Light:
    """Return airlight and lit surface along camera rays, of one light of a source after the
    other.
    """
    if source.count == 1:
        return trace(replace(task, sources=(source,)), sampler, ray, active)

    def add_light(number, sampler, airlight, surface):
        here = replace(task, sources=(source.light(number),))
        sent = trace(here, sampler, ray, active)
        return number + 1, sampler, airlight + sent[0], surface + sent[1]

    # One kernel for any number of lights.
    width, count = dr.width(active), dr.opaque(mi.UInt32, source.count)
    state = (mi.UInt32(0), sampler, dr.zeros(mi.Spectrum, width), dr.zeros(mi.Spectrum, width))
    return dr.while_loop(state, lambda number, *_: number < count, add_light, label="lights")[-2:]


def ray_light(task: Task, sampler: "mi.Sampler", ray: Ray, active: "mi.Bool") -> Light:
    """Return airlight and lit surface along camera rays.

    `task`: the scene; `sampler`: with one stream for each ray; `ray`: the rays; `active`: mask.
    """
    if task.varying is None:
        return _through_media(task, sampler, ray, active)
    hit = next_hit(task, ray, mi.Float(0), active)
    part = varying_part(task.varying, task.around, ray, hit.t)
    airlight, sampler = scattered_light(task, sampler, ray, part, active)
    surface, _ = reflected_light(task, sampler, ray, hit, hit.t, part, active & hit.is_valid())
    return airlight, surface


def next_hit(
    task: Task, ray: Ray, done: "mi.Float", active: "mi.Bool"
) -> "mi.SurfaceInteraction3f":
    """Return the hits of rays from some distance on [m]."""
    if not task.around.surfaces:
        return dr.zeros(mi.SurfaceInteraction3f, dr.width(active))
    return task.around.scene.ray_intersect(
        mi.Ray3f(ray.origin + ray.direction * done, ray.direction), active
    )


def _through_media(task: Task, sampler: "mi.Sampler", ray: Ray, active: "mi.Bool") -> Light:
    """Follow camera rays from boundary to boundary, and add up what each stretch sends."""

    def walk(walking, sampler, done, start, depth, medium, airlight, surface):
        """Add the stretch up to the next shape on the way: `done` is where the ray goes on, `start`
        the last boundary.
        """
        hit = next_hit(task, ray, done, walking)
        met = walking & hit.is_valid()
        end = dr.select(met, done + hit.t, dr.inf)
        sigma_s, sigma_t = coefficients(medium, walking)
        rates = [sigma_t[0]] if task.grey else list(sigma_t)
        ends = mi.Float64(start), mi.Float64(end)
        stretch = Stretch(
            task.around, *ends, medium, dr.max(sigma_s) > 0, depth, sigma_t, rates, at_camera
        )
        # The lights send airlight from this stretch; a surface at its end reflects, a boundary of a
        # medium leads on.
        sent, sampler = scattered_light(prepared, sampler, ray, stretch, walking)
        passed = is_boundary(hit, met)
        reflected, sampler = reflected_light(
            prepared, sampler, ray, hit, end, stretch, met & ~passed
        )
        # Behind a boundary the optical depth has grown by the stretch, and the medium is the one
        # that the boundary names. The ray goes on a little behind it, but the next stretch begins
        # at the boundary itself.
        depth = dr.select(passed, depth + sigma_t * (end - start), depth)
        changes = passed & hit.is_medium_transition()
        medium = dr.select(changes, hit.target_medium(ray.direction), medium)
        done = dr.select(passed, end + step_beyond(hit.p, task.around.metre), done)
        start = dr.select(passed, end, start)
        return passed, sampler, done, start, depth, medium, airlight + sent, surface + reflected

    at_camera, prepared = task.start, task
    width = dr.width(active)
    state = (
        mi.Bool(active),
        sampler,
        dr.zeros(mi.Float, width),
        dr.zeros(mi.Float, width),
        dr.zeros(mi.Spectrum, width),
        dr.select(active, at_camera, dr.zeros(mi.MediumPtr)) if task.around.bounded else at_camera,
        dr.zeros(mi.Spectrum, width),
        dr.zeros(mi.Spectrum, width),
    )
    # Without bounded media one stretch is the whole ray, and needs no loop.
    if not task.around.bounded:
        return walk(*state)[-2:]
    # The medium at a light with one position is looked for once.
    places = (
        replace(
            each,
            medium=medium_at(task.around, mi.Point3f(each.position), ray.origin, at_camera, active),
        )
        if each.position is not None
        else each
        for each in task.sources
    )
    prepared = replace(task, sources=tuple(places))
    return dr.while_loop(
        state, lambda walking, *_: walking, walk, label="camera ray through media"
    )[-2:]


def scattered_light(
    task: Task, sampler: "mi.Sampler", ray: Ray, part: Part, active: "mi.Bool"
) -> Estimate:
    """Estimate the airlight of all lights from a part of the rays: for each light a loop over the
    cells of the unit interval.
    """
    total = dr.zeros(mi.Spectrum, dr.width(active))
    active = active & part.scatters
    for source in task.sources:
        # The grid of cells and the sequence of points on the light start at random places, new for
        # each light.
        shift, start = sampler.next_1d(active), sampler.next_2d(active)

        def add_sample(index, total, sampler, source: Source = source, shift=shift, start=start):
            cell, width = cell_of(index, shift, task.samples)
            u = cell + width * sampler.next_1d(active)
            sample = source.on_ray(u, place_of(index, start), ray, part, active)
            used, point = sample.counts, sample.point
            sigma_s, phase = part.scattering(sample.x, point, sample.towards, used)
            transmittance, sampler = part.transmittance(
                sample.x, point, sample.path, ray, sampler, used
            )
            # One sample stands for its cell of the unit interval: the integrand over the density of
            # x, times the width of the cell.
            value = sigma_s * phase * sample.value * transmittance * width
            return index + 1, total + dr.select(used, value, 0), sampler

        state = (mi.UInt32(0), total, sampler)
        _, total, sampler = dr.while_loop(
            state, lambda i, *_: i < task.samples, add_sample, label="distances"
        )
    return total, sampler


def reflected_light(
    task: Task,
    sampler: "mi.Sampler",
    ray: Ray,
    hit: "mi.SurfaceInteraction3f",
    x: "mi.Float | mi.Float64",
    part: Part,
    active: "mi.Bool",
) -> Estimate:
    """Estimate the light that surfaces reflect at the end of a part of the rays, x [m] from the
    camera.
    """
    total = dr.zeros(mi.Spectrum, dr.width(active))
    if not task.around.surfaces:
        return total, sampler
    # Rays that meet nothing have an infinite x: they ask for the transmittance at the start, and it
    # does not count.
    x = mi.Float64(dr.select(active, x, part.start))
    for source in task.sources:
        start = sampler.next_2d(active)
        count = task.samples if source.varies or part.estimated else 1

        def add_sample(index, total, sampler, source: Source = source, start=start, count=count):
            towards, path, irradiance = source.on_surface(place_of(index, start), hit, active)
            material = hit.bsdf().eval(mi.BSDFContext(), hit, hit.to_local(towards), active)
            transmittance, sampler = part.transmittance(x, hit, path, ray, sampler, active)
            return (
                index + 1,
                total + dr.select(active, material * irradiance * transmittance / count, 0),
                sampler,
            )

        state = (mi.UInt32(0), total, sampler)
        # A light that is the same for all samples needs one, and no loop.
        if count == 1:
            _, total, sampler = add_sample(*state)
        else:
            _, total, sampler = dr.while_loop(
                state, lambda i, *_, n=count: i < n, add_sample, label="surfaces"
            )
        # A sun has one direction, and no extent.
        if task.mirrors and isinstance(source, AreaSource | FarSource) and source.varies:
            shown, sampler = _mirrored(source, sampler, ray, hit, x, part, active)
            total += shown
    return total, sampler


def _mirrored(
    source: AreaSource | FarSource,
    sampler: "mi.Sampler",
    ray: Ray,
    hit: "mi.SurfaceInteraction3f",
    x: "mi.Float64",
    part: Part,
    active: "mi.Bool",
) -> Estimate:
    """Return the light of area lights and skies that mirrors at the ends of rays show."""
    used = active & mi.has_flag(hit.bsdf().flags(), mi.BSDFFlags.DeltaReflection)
    # One direction, which `eval` of the material does not know.
    mirror = mi.BSDFContext()
    mirror.type_mask = int(mi.BSDFFlags.DeltaReflection)
    sample, reflectance = hit.bsdf().sample(mirror, hit, 0.5, mi.Point2f(0.5), used)
    path, radiance = source.in_mirror(hit, hit.to_world(sample.wo), used)
    transmittance, sampler = part.transmittance(x, hit, path, ray, sampler, used)
    return dr.select(used, reflectance * radiance * transmittance, 0), sampler
