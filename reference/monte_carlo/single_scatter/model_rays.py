# SPDX-License-Identifier: BSD-3-Clause
"""Camera rays whose light follows the terms of a model.

`reference.monte_carlo.single_scatter.model_terms` has the derivation. The surface of a ray is found
first, since the fog may end before or behind it; then the media are followed up to the end of the
fog, through surfaces too. A surface is attenuated by all fog that its ray went through.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import drjit as dr
import mitsuba as mi

from airlight.reference.monte_carlo.single_scatter.boundary_walk import (
    coefficients,
    medium_at,
    step_beyond,
)
from airlight.reference.monte_carlo.single_scatter.estimator import (
    Estimate,
    Light,
    Task,
    next_hit,
    reflected_light,
    scattered_light,
)
from airlight.reference.monte_carlo.single_scatter.model_parts import (
    ModelPart,
    ModelStretch,
    modelled,
)
from airlight.reference.monte_carlo.single_scatter.model_terms import (
    FogEnds,
    ModelTerms,
    RayTerms,
)
from airlight.reference.monte_carlo.single_scatter.sources import FarSource
from airlight.reference.monte_carlo.single_scatter.stretches import Ray, cell_of, point_on
from airlight.reference.monte_carlo.single_scatter.varying_media import varying_part
from airlight.reference.scene.varying import VaryingMedium

#: what returns the light that a part of the rays sends
Send: TypeAlias = "Callable[[ModelPart, mi.Sampler, mi.Bool], Estimate]"


def model_light(
    terms: ModelTerms, task: Task, sampler: "mi.Sampler", ray: Ray, active: "mi.Bool"
) -> Light:
    """Return airlight and lit surface along camera rays from the only source of a task.

    `terms`: of the model; the others: see
    `reference.monte_carlo.single_scatter.estimator.ray_light`.
    """
    (source,) = task.sources
    far = isinstance(source, FarSource)
    # The medium at a light with one position is looked for once.
    if task.around.bounded and source.position is not None:
        place = mi.Point3f(source.position)
        medium = medium_at(task.around, place, ray.origin, task.start, active)
        task = replace(task, sources=(replace(source, medium=medium),))
    hit, ends = _surface_and_ends(terms, task, ray, active)

    # The airlight, up to where a fade may end it.
    def send(part: ModelPart, sampler: "mi.Sampler", walking: "mi.Bool") -> Estimate:
        return scattered_light(task, sampler, ray, part.cut() if far else part, walking)

    airlight = dr.zeros(mi.Spectrum, dr.width(active))
    if terms.counts(lamp=not far):
        along = terms.along(ends.cosine, lamp=not far)
        airlight, sampler = _sent(
            task, sampler, ray, terms.ends_of_lights(ends), along, send, active
        )
    # The surface, behind all fog up to its end.
    part = _whole_fog(task, sampler, ray, ends, terms.behind(ends.cosine), active)
    met = active & hit.is_valid()
    surface, _ = reflected_light(task, sampler, ray, hit, part.end, part, met)
    return airlight, surface * mi.Float(terms.factors[2])


def fog_glow(
    terms: ModelTerms, task: Task, sampler: "mi.Sampler", ray: Ray, active: "mi.Bool"
) -> "mi.Spectrum":
    """Return what camera rays receive from ambient light and a constant source."""
    _, ends = _surface_and_ends(terms, task, ray, active)
    along = terms.along(ends.cosine, lamp=False)
    total = dr.zeros(mi.Spectrum, dr.width(active))
    if terms.ambient is not None:
        step = terms.step(ends.cosine)

        def send(part: ModelPart, sampler: "mi.Sampler", walking: "mi.Bool") -> Estimate:
            return _scattered_from_around(task, sampler, ray, part.cut(), step, walking)

        sent, sampler = _sent(task, sampler, ray, ends, along, send, active)
        total += terms.ambient * sent
    if terms.constant is None:
        return total

    def covered(ends: FogEnds) -> "list[mi.Float64]":
        """Return 1 - exp(-A tau) of all fog up to its end, one for each channel."""
        part = _whole_fog(task, sampler, ray, ends, along, active)
        return [1 - dr.exp(-along.camera * mi.Float64(tau)) for tau in part.depth_to(part.end)]

    # The source itself, and the lobes of suns, for which the fog begins elsewhere.
    total += terms.constant * mi.Spectrum(
        *(mi.Float(dr.minimum(each, terms.most)) for each in covered(ends))
    )
    if terms.lobe is not None:
        reached = ends.end > ends.near
        later = replace(ends, near=dr.select(reached, terms.lobe.start, ends.near))
        here = point_on(ray, ray.origin)
        lobes = dr.zeros(mi.Spectrum, dr.width(active))
        for source in task.sources:
            if isinstance(source, FarSource):
                sun, irradiance = source.emitter.sample_direction(here, mi.Point2f(0.5), active)
                lobes += irradiance * terms.lobe.at(dr.dot(ray.direction, sun.d))
        total += lobes * mi.Spectrum(*(mi.Float(each) for each in covered(later)))
    return dr.select(active, total, 0)


def _surface_and_ends(
    terms: ModelTerms, task: Task, ray: Ray, active: "mi.Bool"
) -> "tuple[mi.SurfaceInteraction3f, FogEnds]":
    """Return the surfaces that rays meet, and where the fog begins and ends along them."""
    hit = next_hit(replace(task, around=terms.opaque), ray, mi.Float(0), active)
    distance = mi.Float64(dr.select(hit.is_valid(), hit.t, dr.inf))
    return hit, terms.ends(dr.dot(ray.direction_double, terms.axis), distance)


def _sent(
    task: Task,
    sampler: "mi.Sampler",
    ray: Ray,
    ends: FogEnds,
    along: RayTerms,
    send: Send,
    active: "mi.Bool",
) -> Estimate:
    """Return what all parts of the rays in the fog send."""
    if task.varying is not None:
        return send(_varying(task.varying, task, ray, ends, along), sampler, active)
    total, _, sampler = _through_media(task, sampler, ray, ends, along, send, active)
    return total, sampler


def _whole_fog(
    task: Task,
    sampler: "mi.Sampler",
    ray: Ray,
    ends: FogEnds,
    along: RayTerms,
    active: "mi.Bool",
) -> ModelPart:
    """Return a part whose end has all fog of the rays before it."""
    if task.varying is not None:
        return _varying(task.varying, task, ray, ends, along)

    def nothing(part: ModelPart, sampler: "mi.Sampler", walking: "mi.Bool") -> Estimate:
        return dr.zeros(mi.Spectrum, dr.width(walking)), sampler

    _, depth, _ = _through_media(task, sampler, ray, ends, along, nothing, active)
    # A part without a length, behind the depth of all media.
    zero = dr.zeros(mi.Float64, dr.width(active))
    return replace(
        _stretch(task, ends, along, (zero, zero), depth, task.start, active), start=zero, end=zero
    )


def _varying(
    medium: VaryingMedium, task: Task, ray: Ray, ends: FogEnds, along: RayTerms
) -> ModelPart:
    """Return the part of rays in height fog or in a density grid."""
    part = varying_part(medium, task.around, ray, ends.end)
    return modelled(part, along, ends.near)


def _stretch(
    task: Task,
    ends: FogEnds,
    along: RayTerms,
    between: "tuple[mi.Float | mi.Float64, mi.Float | mi.Float64]",
    depth: "mi.Spectrum",
    medium: "mi.MediumPtr",
    active: "mi.Bool",
) -> ModelStretch:
    """Return what the fog's ends leave of a stretch between two distances [m], behind an optical
    depth.
    """
    sigma_s, sigma_t = coefficients(medium, active)
    start, end = between
    first = dr.maximum(mi.Float64(start), ends.near)
    last = dr.minimum(mi.Float64(end), ends.end)
    return ModelStretch(
        task.around,
        first,
        last,
        medium,
        (dr.max(sigma_s) > 0) & (last > first),
        terms=along,
        depth=depth,
        sigma_t=sigma_t,
        rates=[sigma_t[0]] if task.grey else list(sigma_t),
        at_camera=task.start,
    )


def _through_media(
    task: Task,
    sampler: "mi.Sampler",
    ray: Ray,
    ends: FogEnds,
    along: RayTerms,
    send: Send,
    active: "mi.Bool",
) -> "tuple[mi.Spectrum, mi.Spectrum, mi.Sampler]":
    """Follow camera rays from boundary to boundary up to the end of the fog, through surfaces too;
    return what their stretches send, their optical depth, and the sampler.
    """
    zero, none = dr.zeros(mi.Float, dr.width(active)), dr.zeros(mi.Spectrum, dr.width(active))
    if not task.around.bounded:
        whole = _stretch(task, ends, along, (zero, zero + dr.inf), none, task.start, active)
        sent, sampler = send(whole, sampler, active)
        return sent, whole.depth_to(whole.end), sampler

    def walk(walking, sampler, done, start, depth, medium, total):
        """Add the stretch up to the next shape on the way: `done` is where the ray goes on, `start`
        the last shape.
        """
        hit = next_hit(task, ray, done, walking)
        met = walking & hit.is_valid()
        end = dr.select(met, done + hit.t, dr.inf)
        stretch = _stretch(task, ends, along, (start, end), depth, medium, walking)
        sent, sampler = send(stretch, sampler, walking)
        # Behind a shape the depth has grown by the stretch, and a boundary names the next medium.
        depth = dr.select(walking, stretch.depth_to(stretch.end), depth)
        passed = met & (mi.Float64(end) < ends.end)
        changes = passed & hit.is_medium_transition()
        medium = dr.select(changes, hit.target_medium(ray.direction), medium)
        done = dr.select(passed, end + step_beyond(hit.p, task.around.metre), done)
        start = dr.select(passed, end, start)
        return passed, sampler, done, start, depth, medium, total + sent

    medium = dr.select(active, task.start, dr.zeros(mi.MediumPtr))
    state = mi.Bool(active), sampler, zero, mi.Float(zero), none, medium, mi.Spectrum(none)
    final = dr.while_loop(
        state, lambda walking, *_: walking, walk, label="camera ray through a model's fog"
    )
    return final[-1], final[4], final[1]


def _scattered_from_around(
    task: Task,
    sampler: "mi.Sampler",
    ray: Ray,
    part: ModelPart,
    step: "mi.Float64",
    active: "mi.Bool",
) -> Estimate:
    """Estimate int sigma_s exp(-A tau) s dx over a part of the rays, from one distance in each
    cell of the unit interval.
    """
    length = part.end - part.start
    used = active & part.scatters & (length < dr.inf)
    length = dr.select(used, length, 1)
    shift = sampler.next_1d(active)

    def add_sample(index, total, sampler):
        cell, width = cell_of(index, shift, task.samples)
        u = cell + width * sampler.next_1d(active)
        y, density = part.distances(u, part.start, length, None)
        x = part.start + y
        point = point_on(ray, ray.origin + ray.direction * mi.Float(x))
        sigma_s, _, _ = part.medium.get_scattering_coefficients(point, used)
        passed, sampler = part.to_camera(x, ray, sampler, used)
        weight = dr.select(density > 0, step * mi.Float64(width) / density, 0)
        value = sigma_s * passed * mi.Float(weight)
        return index + 1, total + dr.select(used, value, 0), sampler

    state = mi.UInt32(0), dr.zeros(mi.Spectrum, dr.width(active)), sampler
    _, total, sampler = dr.while_loop(
        state, lambda i, *_: i < task.samples, add_sample, label="ambient light"
    )
    return total, sampler
