# SPDX-License-Identifier: BSD-3-Clause
"""Camera rays, their parts in media, ways from lights to points on them, and cells of samples.

`Part` is the interface of a medium on its part of the rays. A new medium is another
`Part`, in its own file.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi

from airlight.reference.monte_carlo.single_scatter.boundary_walk import (
    Segment,
    Surroundings,
    medium_at,
    transmittance,
)
from airlight.reference.monte_carlo.single_scatter.distance_sampling import (
    Span,
    mixture_of,
    sample_distance,
    sample_stretch,
)


@dataclass(frozen=True)
class Ray:
    """Camera rays in both precisions."""

    origin: Any
    direction: Any
    origin_double: Any
    direction_double: Any


@dataclass(frozen=True)
class Path:
    """Straight ways from a light to points of camera rays or surfaces."""

    begin: Any  #: on the light, or where it is infinitely far beyond all shapes [m]
    away: Any  #: unit vectors from there
    length: Any  #: [m]
    end: Any = None  #: the points, where the light is infinitely far [m]
    medium: Any = None  #: pointer to what they begin in; None: not known

    def shadow_ray(self) -> tuple[Any, Any, Any]:
        """Return from where rays look for what stands in the way, in which unit
        direction, and how far [m].

        Rays from afar lose digits: a ball of 1 m, met from 200 m away, would
        shadow a third of itself.
        """
        if self.end is None:
            return self.begin, self.away, self.length
        return self.end, -self.away, self.length


@dataclass(frozen=True)
class Part(ABC):
    """The part of camera rays in one medium."""

    around: Surroundings
    start: Any  #: distance from the camera, of double precision [m]
    end: Any  #: may be infinite [m]
    medium: Any  #: pointer
    scatters: Any  #: mask
    estimated: ClassVar[bool] = False  #: whether `kept` is an estimate, from samples

    @abstractmethod
    def distances(self, u, low, length, span: Span | None) -> tuple[Any, Any]:
        """Sample distances from `low`, a distance along the rays, up to a length from there
        [m], in double precision.

        `u` is uniform in [0, 1); `span`: the same part as a light at a place sees it, None for one
        that is infinitely far. Returns distances [m] and their density [1/m].
        """

    @abstractmethod
    def kept(self, x, point, path: Path, ray: Ray, sampler, active) -> tuple[Any, Any]:
        """Return the transmittance of paths to points, and from there to the camera, x [m] away.

        Nothing is where something stands in a path. Returns the sampler, too.
        """


@dataclass(frozen=True)
class Stretch(Part):
    """The part of camera rays in one homogeneous medium."""

    depth: Any  #: optical depth from the camera to its start
    sigma_t: Any  #: [1/m]
    rates: Sequence[Any]  #: the same, each once [1/m]
    at_camera: Any  #: pointer to the medium in which the camera is

    def distances(self, u, low, length, span: Span | None) -> tuple[Any, Any]:
        """Sample distances by the mixture of techniques; see `Part`."""
        if span is None:
            return sample_stretch(u, length, self.rates)
        return sample_distance(u, mixture_of(span, self.rates))

    def kept(self, x, point, path: Path, ray: Ray, sampler, active) -> tuple[Any, Any]:
        """Return the transmittance of both ways; see `Part`."""
        # The walk from the light on must know the medium there: vacuum beyond all shapes, the
        # medium of a light that stays, or the one that is looked for now.
        at_light = path.medium
        if path.end is not None or not self.around.bounded:
            at_light = dr.zeros(mi.MediumPtr)  # beyond all shapes is vacuum
        elif at_light is None:
            at_light = medium_at(self.around, path.begin, ray.origin, self.at_camera, active)
        media = Segment(at_light, self.sigma_t)
        segment = transmittance(
            self.around, path.begin, path.away, path.length, media=media, active=active
        )
        return segment * dr.exp(-self.depth - self.sigma_t * mi.Float(x - self.start)), sampler


def double_ray(origin, direction) -> Ray:
    """Return rays given in double precision; their directions need not have unit length."""
    direction = dr.normalize(direction)
    return Ray(mi.Point3f(origin), dr.normalize(mi.Vector3f(direction)), origin, direction)


def cell_of(number, shift, count: int) -> tuple[Any, Any]:
    """Return where a cell of the unit interval begins, and its width.

    All cells are 1/(count - 1) wide but the first and the last, which share that width as `shift`
    in [0, 1) says. The edge of a shadow therefore lies anywhere in its cell from batch to batch; in
    cells that stay, an edge close to the end of one would be felt so rarely that no spread between
    batches could tell.
    """
    if count == 1:
        return mi.Float(0), mi.Float(1)
    place = mi.Float(number) + shift
    low, high = dr.maximum(place - 1, 0), dr.minimum(place, count - 1)
    return low / (count - 1), (high - low) / (count - 1)


def place_of(index, start) -> tuple[Any, Any]:
    """Return a point of the unit square, given its number and where the
    sequence, Kronecker's, starts.
    """
    number = mi.Float64(index)
    # 1/x and 1/x^2 with x^3 = x + 1: they fill a square evenly.
    steps = (0.7548776662466927, 0.5698402909980532)
    u, v = (mi.Float64(begin) + number * step for begin, step in zip(start, steps))
    return u - dr.floor(u), v - dr.floor(v)


def point_on(ray: Ray, position):
    """Return a point of a medium on camera rays."""
    point = dr.zeros(mi.MediumInteraction3f)
    point.p = position
    point.wi = -ray.direction
    point.sh_frame = mi.Frame3f(ray.direction)
    return point
