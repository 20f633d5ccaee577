# SPDX-License-Identifier: BSD-3-Clause
"""Walking through the boundaries of media: optical depth and visibility between a
light and a point, in Dr.Jit.

A bounded medium is a closed shape with the material `null` that names the media on both sides; it
neither reflects nor refracts. A ray is followed from one such boundary to the next with
`ray_intersect`, and the media are the scene's own pointers. A boundary that rounding makes a ray
meet twice names the same medium both times. A boundary that a segment misses close to its end,
where the point lies in or just beneath it, costs a stretch as short as that: the walk knows the
medium from the light on and never asks in which medium the point may lie.

Stretches are measured along the one straight ray, from the light to the point. A continued ray
starts a little beyond a boundary, so that it does not meet it again; the optical depth counts that
little way too. Visibility rays stop a relative 1e-5 before the point, since a point on a surface
must not be hidden by that surface; the attenuation counts the whole distance (volpath's does not,
DESIGN section 6.1).
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

_SHORT_OF_POINT = 1e-5  # relative: a hundred roundings of single precision


@dataclass(frozen=True)
class Surroundings:
    """The shapes that rays can meet."""

    scene: Any  #: an `mi.Scene`; of opaque shapes alone where nothing bounds a medium
    surfaces: bool  #: there are shapes
    bounded: bool  #: some of them are boundaries of media


@dataclass(frozen=True)
class Segment:
    """The media at the ends of segments from a light to points."""

    start: Any  #: pointer to the medium at the light; what is beyond, the boundaries say
    #: extinction at the points [1/m]; along all of the segment where nothing bounds a medium
    end_sigma_t: Any


def coefficients(medium, active) -> tuple[Any, Any]:
    """Return scattering and extinction of media by pointer [1/m]; 0 for a
    vacuum, the null pointer.
    """
    sigma_s, _, sigma_t = medium.get_scattering_coefficients(
        dr.zeros(mi.MediumInteraction3f), active
    )
    return sigma_s, sigma_t


def is_boundary(interaction, active):
    """Return where surface interactions are with the boundary of a medium rather than a surface."""
    return active & mi.has_flag(interaction.bsdf().flags(), mi.BSDFFlags.Null)


def step_beyond(point):
    """Return how far beyond a boundary at `point` a ray goes on [m]."""
    # 2e-6 of the largest coordinate; media that are thinner are not seen.
    return 2e-6 * (1 + dr.max(dr.abs(point)))


def medium_at(around: Surroundings, position, known_position, known_medium, active):
    """Return the medium at one point, such as a light, given that at another, such as
    the camera, as pointers.

    The walk follows the way to the other point, through surfaces too, to the first boundary, which
    names the medium on its near side. Without a boundary both points lie in the same medium.
    """
    way = known_position - position
    distance = dr.norm(way)
    direction = way / dr.maximum(distance, 1e-30)

    def walk(walking, done, medium):
        ray = mi.Ray3f(position + direction * done, direction, distance - done, 0.0, [])
        hit = around.scene.ray_intersect(ray, walking)
        met = walking & hit.is_valid()
        # A surface on the way is passed; the first boundary names the medium on the side of the
        # point.
        at_boundary = met & hit.is_medium_transition()
        medium = dr.select(at_boundary, hit.target_medium(-direction), medium)
        done = dr.select(met, done + hit.t + step_beyond(hit.p), done)
        return met & ~at_boundary & (done < distance), done, medium

    state = (
        mi.Bool(active),
        dr.zeros(mi.Float, dr.width(distance)),
        dr.select(active, known_medium, dr.zeros(mi.MediumPtr)),
    )
    return dr.while_loop(state, lambda walking, *_: walking, walk, label="medium at a light")[-1]


def unblocked(around: Surroundings, start, direction, distance, active):
    """Return where nothing stands between the start of shadow rays and a
    little before their ends.
    """
    if not around.surfaces:
        return mi.Bool(True)
    return ~around.scene.ray_test(
        mi.Ray3f(start, direction, distance * (1 - _SHORT_OF_POINT), 0.0, []), active
    )


def transmittance(around: Surroundings, start, direction, distance, *, media: Segment, active):
    """Return the transmittance from a light to points at a distance; 0 where
    something is in between.

    `around`: what rays can meet; `start`, `direction`, `distance`: the light, the unit vector to
    the point, and how far it is [m]; `media`: the media at both ends; `active`: mask.
    """
    if not around.bounded:
        lit = unblocked(around, start, direction, distance, active)
        return dr.select(lit, dr.exp(-media.end_sigma_t * distance), 0)
    reach = distance * (1 - _SHORT_OF_POINT)

    def walk(walking, lit, done, boundary, medium, depth):
        """Go to the next thing on the way, `done` being where the ray starts, `boundary`
        the last change of medium.
        """
        ray = mi.Ray3f(start + direction * done, direction, distance - done, 0.0, [])
        hit = around.scene.ray_intersect(ray, walking)
        met = walking & hit.is_valid()
        crossing = done + hit.t
        passed = is_boundary(hit, met)
        # A surface blocks the segment unless it is the one at the end of it.
        lit &= ~met | passed | (crossing > reach)
        changes = passed & hit.is_medium_transition()
        # The stretch from the last change of medium to this one. A boundary that rounding doubles
        # names the same medium again, and adds no error.
        _, sigma_t = coefficients(medium, changes)
        depth = dr.select(changes, depth + sigma_t * (crossing - boundary), depth)
        boundary = dr.select(changes, crossing, boundary)
        medium = dr.select(changes, hit.target_medium(direction), medium)
        done = dr.select(passed, crossing + step_beyond(hit.p), done)
        return passed & (done < distance), lit, done, boundary, medium, depth

    zero = dr.zeros(mi.Float, dr.width(distance))
    medium = dr.select(active, media.start, dr.zeros(mi.MediumPtr))
    state = (
        mi.Bool(active),
        mi.Bool(active),
        zero,
        mi.Float(zero),
        medium,
        dr.zeros(mi.Spectrum, dr.width(distance)),
    )
    final = dr.while_loop(state, lambda walking, *_: walking, walk, label="segment through media")
    _, lit, _, boundary, medium, depth = final
    # The last stretch ends at the point, in whichever medium the walk is there.
    _, sigma_t = coefficients(medium, lit)
    return dr.select(lit, dr.exp(-depth - sigma_t * (distance - boundary)), 0)
