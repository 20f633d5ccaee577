# SPDX-License-Identifier: BSD-3-Clause
"""The pieces of camera rays in bounded media, and what their surfaces receive through these media."""

from dataclasses import dataclass, replace
from functools import reduce
from operator import or_
from typing import Any

import drjit as dr

from realtime.bounded_media.light_paths import LightPaths, chord, homogeneous_vector
from realtime.scene.lights import Light
from realtime.scene.medium import Medium


@dataclass(frozen=True)
class Piece:
    """A part of every ray that lies in one medium."""

    medium: Medium
    number: Any  #: of the bounded medium; None between them
    begin: Any  #: distance from the camera [m], infinite or equal to `end` where the ray misses it
    end: Any  #: [m]
    before: tuple[Any, ...]  #: optical depth from the camera to `begin`, by channel [1]


def camera_pieces(medium: Medium, origin, direction) -> tuple[Piece, ...]:
    """Return the pieces of the camera rays in which something scatters.

    `origin` is the camera, one for all lanes [m], `direction` unit vectors.
    """
    Float = type(direction.x)
    passages = [chord(bounded, origin, direction) for bounded in medium.bounded_media]

    def piece(own: Medium, number, begin, end):
        before = []
        for channel, around in enumerate(medium.sigma_t):
            depth = Float(0) if medium.clear else around * begin
            for bounded, (enter, leave) in zip(medium.bounded_media, passages):
                excess = bounded.medium.sigma_t[channel] - around
                depth += dr.select(leave <= begin, excess * (leave - enter), 0)
            before.append(depth)
        return Piece(own, number, begin, end, tuple(before))

    pieces = [
        piece(bounded.medium, number, *ends)
        for number, (bounded, ends) in enumerate(zip(medium.bounded_media, passages, strict=True))
    ]
    if not medium.clear:
        starts = [dr.zeros(Float, dr.width(direction)), *(leave for _, leave in passages)]
        for begin in starts:
            end = Float(dr.inf)
            for enter, _ in passages:
                end = dr.minimum(end, dr.select(enter >= begin, enter, dr.inf))
            # A camera within a bounded medium has no gap before it.
            inside = reduce(or_, [(enter <= begin) & (begin < leave) for enter, leave in passages])
            pieces.append(piece(medium, None, begin, dr.select(inside, begin, end)))
    return tuple(pieces)


def camera_insides(medium: Medium, origin, direction, distance) -> tuple[Any, ...]:
    """Return what of camera rays up to a distance lies in each bounded medium [m]; arguments as in `camera_pieces`.

    `distance` [m] may be infinite.
    """
    insides = []
    for bounded in medium.bounded_media:
        enter, leave = (dr.minimum(end, distance) for end in chord(bounded, origin, direction))
        insides.append(dr.select(leave > enter, leave - enter, 0))
    return tuple(insides)


def optical_depths(medium: Medium, distance, insides) -> tuple[Any, ...]:
    """Return the optical depth up to a distance, by channel; `insides` is what lies in each bounded medium [m]."""
    depths = [type(distance)(0) if medium.clear else sigma * distance for sigma in medium.sigma_t]
    for bounded, inside in zip(medium.bounded_media, insides, strict=True):
        excess = [own - sigma for own, sigma in zip(bounded.medium.sigma_t, medium.sigma_t)]
        depths = [dr.fma(more, inside, depth) for more, depth in zip(excess, depths)]
    return tuple(depths)


def paths_from(
    medium: Medium, light: Light, origin, direction, *, own=None, segment: tuple[Any, Any] | None = None, active=True
) -> list[LightPaths]:
    """Return the paths from a light to the points of rays, by bounded medium.

    `own` is the number of the medium in which the points lie, if it is known; `segment` the ends of what the points
    lie on [m], if they are within one; `active` the lanes to compute.
    """
    paths = []
    for number, bounded in enumerate(medium.bounded_media):
        toward = homogeneous_vector(light, bounded.centre)
        path = LightPaths(bounded, light.w, toward, origin - bounded.centre, direction, active, own=number == own)
        if segment is not None and not path.own:
            path = replace(path, active=active & path.near_segment(*segment))
        paths.append(path)
    return paths


def path_transmittance(medium: Medium, light: Light, *, depths, point, active):
    """Return the transmittance from the light to points and on to the camera, a colour [1].

    `depths` are those of the camera rays, from `optical_depths`, `active` the lanes to compute.
    """
    length = dr.norm(homogeneous_vector(light, point))
    zero = type(point.x)(0)
    if light.w:
        depths = [dr.fma(sigma, length, depth) for depth, sigma in zip(depths, medium.sigma_t)]
    for path in paths_from(medium, light, point, dr.zeros(type(point)), active=active):
        inside = replace(path, active=active & path.near_points()).length_at(zero, length)
        excess = [own - sigma for own, sigma in zip(path.bounded.medium.sigma_t, medium.sigma_t)]
        depths = [dr.fma(more, inside, depth) for more, depth in zip(excess, depths)]
    return type(medium.albedo)(*(dr.exp(-depth) for depth in depths))
