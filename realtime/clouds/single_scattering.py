# SPDX-License-Identifier: BSD-3-Clause
"""Opacity and the light of one scattering along rays through clouds.

**Nodes along a ray, exponentially spaced in optical depth.**

N steps of a ray of the depth T in clouds end at

    tau_k = -s log(1 - (k/N) (1 - exp(-T/s))),        k = 1 .. N,        tau_N = T:

equal fractions of the integral of exp(-tau/s). With s = 1 each step would take the same part of the
ray's extinction. Light that is attenuated less on its way in than on its way out comes from further
in and needs nodes there, so that s is larger. From a node at the depth tau the next is -s log(1 -
exp(tau/s) (1 - exp(-T/s))/N) away.

In a grid of densities T is the depth that the ray would have with the density 1 everywhere, and the
distance to the next node is the distance at full density. No step is longer than the steps of
`realtime.clouds.march`, which see the voxels.

**The opacity of clouds along a ray.**

With the extinctions kappa_i and the lengths of the stretches in clouds, light from behind
passes with the transmittance

    T = prod exp(-kappa_i (x_{i+1} - x_i)),        opacity = 1 - T.

**Single scattering in clouds, by steps on which the segments of the light are linear.**

Light of the irradiance E that comes from a direction reaches the point at x after the depth l(x),
and the eye after tau(x) more; with the phase function P/4 pi and the albedo w,

    L = w E P/(4 pi) int kappa exp(-tau(x) - l(x)) dx.

On a step u = tau + l is linear between two nodes, du = kappa dx + dl, so that with e = exp(-u)

    int kappa exp(-u) dx = kappa dx/(kappa dx + dl) (e_i - e_{i+1}),

and kappa dx e where dl = -kappa dx. In a polyhedron l is linear between kinks and jumps, where rays
and segments cross edges: only steps that hold a kink or a jump have an error.

Octaves of a light (`realtime.methods.cloud_octaves`) have the segment a l with a factor a each, and
a phase function each: the same sum with u = tau + a l.

**The background of clouds:** surfaces that light reaches through clouds, and a sky.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.clouds.march import (
    OPAQUE,
    SPREAD,
    CloudSurfaces,
    Crossing,
    depths_along,
    least,
    march,
    middle_density,
    next_crossing,
    voxel,
)
from airlight.realtime.numerics.array_types import PerRay, chosen_value
from airlight.realtime.numerics.functions import exp_bounded, opacity
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.bounded import Clouds


def opacity_of(depths: tuple[Any, ...], Color) -> Any:
    """Return 1 - exp(-depth) as a colour, from optical `depths` by channel
    [1]; `Color` is its type.
    """
    return Color(*map(opacity, depths))


#: Returns the light of a step, of its depth, and of the depths to the eye and of
#: the segment at its ends.
StepIntegral = Callable[[Any, tuple[Any, Any], tuple[Any, Any]], Any]


@dataclass(frozen=True)
class CloudRays:
    """Rays through clouds."""

    surfaces: CloudSurfaces
    clouds: Clouds
    origin: Any  #: [m]
    direction: Any  #: unit directions
    end: Any  #: distance to the visible surface, infinite where there is none [m]
    depths: tuple[Any, ...]  #: optical depth up to there, by channel [1]
    first: Crossing


@dataclass(frozen=True)
class Beam:
    """A light from infinity as points in clouds see it."""

    irradiance: Any  #: across the beam, RGB [W/m^2]
    scales: tuple[Any, ...]  #: by octave, of the depths of its segments [1]
    #: by octave and by phase function of the clouds, its value on the rays, mean 1
    phases: tuple[tuple[Any, ...], ...]
    #: (point [m], active) -> the depth of the segment to a point, by channel [1]
    segment: Callable[[Any, Any], tuple[Any, ...]]
    #: (point [m], active) -> whether no surface is in the way; None where nothing casts a shadow
    lit: Callable[[Any, Any], Any] | None


def cloud_rays(
    surfaces: CloudSurfaces, clouds: Clouds, origin, direction, end, *, stride: Any
) -> CloudRays:
    """Return rays with their depths.

    `surfaces` and `clouds` are the boundaries and what fills them, `origin` [m] and unit
    `direction` the rays, `end` may be infinite [m]; `stride` is the longest step in a grid where a
    ray enters [voxels].
    """
    first = next_crossing(
        surfaces, origin, direction, dr.zeros(type(direction.x), dr.width(direction))
    )
    depths = depths_along(
        surfaces, clouds, origin, direction, end, stride=stride, seen=True, first=first
    )
    return CloudRays(surfaces, clouds, origin, direction, end, depths, first)


def light_once(
    rays: CloudRays,
    beams: Sequence[Beam],
    *,
    steps: int,
    stride: Any,
    integral: StepIntegral | None = None,
) -> tuple[tuple[Any, ...], ...]:
    """Return the radiance that clouds scatter once into rays, by beam and octave, RGB [W/(m^2 sr)].

    `rays`: rays through clouds; `beams`: the lights; `steps`: N of
    `realtime.clouds.single_scattering`, in a ray; a stretch in a cloud has one more; `stride`: the
    longest step in a grid where a ray enters [voxels]; `integral`: over a step, `step_integral` by
    default.

    Valid for any extinction and thickness; `steps` is at least 1.

    Bouthors, Neyret, Max, Bruneton, Crassin 2008, sections 6.2 and 8.
    """
    clouds, Float, Color = rays.clouds, type(rays.direction.x), type(rays.clouds.albedo)
    channels, lanes = len(clouds.sigma_t), dr.width(rays.direction)
    # T of the nodes: at the density 1 everywhere in a grid, otherwise the depth of the ray.
    way, full = (rays.surfaces, rays.origin, rays.direction, rays.end), rays.depths
    if clouds.density is not None:
        even = replace(clouds, density=None)
        full = depths_along(way[0], even, *way[1:], stride=stride, seen=False, first=rays.first)
    mean = sum(full) / (channels * SPREAD)
    # (1 - exp(-T/s))/N, and a little more, so that rounding leaves no step behind the last. In thin
    # clouds the difference is lost in rounding; the first two terms of its series, which it
    # exceeds, are not.
    fraction = dr.maximum(1 - dr.exp(-mean), mean * dr.fma(-0.5, mean, 1)) * (1.0001 / steps)

    def step(total, x, cloud):
        depths, *_ = total
        kappa = sum(dr.gather(Float, sigma_t, cloud) for sigma_t in clouds.sigma_t) / channels
        # exp(tau/s), and the depth of the step to the next node. For small p rounding takes
        # -log(1 - p) away, and p stands for it, its limit from below.
        growth = exp_bounded(dr.minimum(sum(depths) / channels, OPAQUE) / SPREAD)
        part = fraction * growth
        ahead = SPREAD * dr.maximum(part, -dr.log(dr.maximum(1 - part, 1e-30)))
        # From depth to distance; behind the last node a step takes the rest of the stretch.
        node = dr.select((part < 1) & (kappa > 0), ahead / kappa, dr.inf)
        return (
            node
            if clouds.density is None
            else dr.minimum(node, stride * voxel(clouds, cloud) * growth)
        )

    def add(total, begin, end, inside, cloud):
        depths, segments, lit, sums = total
        # l and the visibility of the light at the end of the step; at its beginning the step before
        # had them.
        next_segments, next_lit = reaching(rays, beams, inside)
        length = (end - begin) * middle_density(
            clouds, rays.origin, rays.direction, begin, end, cloud
        )
        step_depths = tuple(dr.gather(Float, sigma_t, cloud) * length for sigma_t in clouds.sigma_t)
        after = tuple(depth + part for depth, part in zip(depths, step_depths))
        visibility = tuple(0.5 * (old + new) for old, new in zip(lit, next_lit))
        ends = (depths, after), (segments, next_segments)
        # Where a stretch begins, so do the segments: its first step has no length.
        sums = with_step(
            clouds,
            beams,
            sums,
            step_depths,
            *ends,
            visibility,
            cloud,
            end > begin,
            integral or step_integral,
        )
        return (after, next_segments, next_lit, sums), least(after) < OPAQUE

    def zeros(count: int):
        return tuple(dr.zeros(Float, lanes) for _ in range(count))

    nothing = tuple(tuple(dr.zeros(Color, lanes) for _ in beam.scales) for beam in beams)
    total = zeros(channels), tuple(zeros(channels) for _ in beams), zeros(len(beams)), nothing
    way = rays.surfaces, rays.origin, rays.direction, rays.end
    *_, sums = march(*way, total, step=step, add=add, first=rays.first)
    return finished(clouds, beams, sums)


def reaching(rays: CloudRays, beams: Sequence[Beam], x) -> tuple[Any, Any]:
    """Return by beam the depths of the segments to rays at a distance [m], and 1 where
    no surface is in the way.
    """
    Float, point = type(x), rays.origin + rays.direction * x
    segments = tuple(beam.segment(point, True) for beam in beams)
    return segments, tuple(
        Float(1) if beam.lit is None else dr.select(beam.lit(point, True), Float(1), 0)
        for beam in beams
    )


def with_step(
    clouds: Clouds,
    beams: Sequence[Beam],
    sums,
    step_depths,
    depths,
    segments,
    lit,
    cloud,
    long,
    integral: StepIntegral,
) -> tuple[tuple[Any, ...], ...]:
    """Return sums by beam and octave with the light of a step in a cloud of some
    number, where it has a length.

    `step_depths`, `depths`: as of `step_light`; `segments`: at both ends, by beam and channel [1];
    `lit`: by beam, the fraction that no surface hides [1].
    """
    # One phase function for all clouds is a factor of the ray (`finished`); several differ from
    # step to step.
    albedo = dr.gather(type(clouds.albedo), clouds.albedo, cloud)
    several = len(clouds.phases) > 1
    phase = dr.gather(mi.UInt32, clouds.phase, cloud) if several else None
    return tuple(
        tuple(
            total
            + dr.select(
                long,
                term * (albedo * visibility * (chosen_value(values, phase) if several else 1)),
                0,
            )
            for total, term, values in zip(
                totals,
                step_light(beam, step_depths, depths, (was, now), integral),
                beam.phases,
                strict=True,
            )
        )
        for beam, totals, was, now, visibility in zip(beams, sums, *segments, lit, strict=True)
    )


def finished(clouds: Clouds, beams: Sequence[Beam], sums) -> tuple[tuple[Any, ...], ...]:
    """Return the radiance of sums over all steps, by beam and octave [W/(m^2 sr)]."""
    several = len(clouds.phases) > 1
    return tuple(
        tuple(
            total * beam.irradiance * (0.25 * dr.inv_pi * (1 if several else values[0]))
            for total, values in zip(totals, beam.phases, strict=True)
        )
        for totals, beam in zip(sums, beams, strict=True)
    )


def step_light(beam: Beam, step_depths, depths, segments, integral: StepIntegral) -> list[Any]:
    """Return the integrals of exp(-tau - a l) dtau over a step by octave, colours [1].

    `beam`: the light; `step_depths`: the depth of the step, by channel [1]; `depths`, `segments`:
    tau and l at its two ends, by channel [1].
    """
    Color = type(beam.irradiance)
    by_octave = []
    for scale in beam.scales:
        parts = [
            integral(part, (before, then), (scale * segment, scale * next_segment))
            for part, before, then, segment, next_segment in zip(
                step_depths, *depths, *segments, strict=True
            )
        ]
        # One channel stands for all three where media are grey.
        by_octave.append(Color(*(parts * (3 // len(parts)))))
    return by_octave


def step_integral(depth, eye, segment):
    """Return the integral over a step of a `depth`, from the depths to the `eye` and of
    the `segment` at the ends.
    """
    # kappa dx (e_i - e_{i+1})/(u_{i+1} - u_i), from the end where exp(-u) is larger, so that the
    # other factor, (1 - exp(-|du|))/|du|, is at most 1; it is 1 where u does not change.
    first, second = eye[0] + segment[0], eye[1] + segment[1]
    change = dr.abs(depth + (segment[1] - segment[0]))
    mean = dr.select(change > 0, opacity(change) / change, 1)
    return depth * exp_bounded(-dr.minimum(first, second)) * mean


def light_on_surfaces(rays: CloudRays, segment: Callable[[Any, Any], tuple[Any, ...]]) -> PerRay:
    """Return the fraction of a light that clouds let through to visible surfaces, a colour
    [1]; 1 where there is none.

    `rays`: rays up to the surfaces; `segment`: (point [m], active) -> the depth of the segment to
    a point, by channel [1].
    """
    Color = type(rays.clouds.albedo)
    # Rays that meet no surface end at infinity: their place is the origin, and counts for nothing.
    mask = dr.isfinite(rays.end)
    place = rays.origin + rays.direction * dr.select(mask, rays.end, 0)
    return dr.select(mask, Color(*(dr.exp(-depth) for depth in segment(place, mask))), 1)


def sky_behind(lights: Sequence[Light], distance, Color) -> PerRay | None:
    """Return the radiance of the sky where there is no surface, a `Color` [W/(m^2
    sr)]; None without a sky.

    `lights`: of the scene, the beam of the sky among them; `distance`: to the visible surface,
    infinite where there is none [m].
    """
    for light in lights:
        if light.sky is not None:
            return dr.select(dr.isfinite(distance), Color(0), light.sky)
    return None
