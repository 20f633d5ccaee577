# SPDX-License-Identifier: BSD-3-Clause
"""Camera rays, their parts in media, ways from lights to points on them, and cells of samples.

`Part` is the interface of a medium on its part of the rays. A new medium is another
`Part`, in its own file.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, TypeAlias

import drjit as dr
import mitsuba as mi

from airlight.reference.monte_carlo.single_scatter.boundary_walk import (
    Path,
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

#: distances from the beginning of a part of rays [m], and their density [1/m]
Distances: TypeAlias = "tuple[mi.Float64, mi.Float64]"
#: transmittances of lanes, 0 to 1, and the sampler after the numbers that they took
Transmittance: TypeAlias = "tuple[mi.Spectrum, mi.Sampler]"


@dataclass(frozen=True)
class Ray:
    """Camera rays in both precisions."""

    origin: "mi.Point3f"  #: [m]
    direction: "mi.Vector3f"  #: unit
    origin_double: "mi.Point3d"  #: [m]
    direction_double: "mi.Vector3d"  #: unit


@dataclass(frozen=True)
class Part(ABC):
    """The part of camera rays in one medium."""

    around: Surroundings
    start: "mi.Float64"  #: distance from the camera [m]
    end: "mi.Float64"  #: may be infinite [m]
    medium: "mi.MediumPtr"
    scatters: "mi.Bool"
    estimated: ClassVar[bool] = False  #: whether `transmittance` is an estimate, from samples

    @abstractmethod
    def distances(
        self,
        u: "mi.Float | mi.Float64",
        low: "mi.Float64",
        length: "mi.Float64",
        span: Span | None,
    ) -> Distances:
        """Sample distances from `low`, a distance along the rays, within a length [m].

        `u` is uniform in [0, 1); `span`: the same part as a light at a place sees it, None for a
        light infinitely far away.
        """

    def scattering(
        self,
        x: "mi.Float64",
        point: "mi.MediumInteraction3f",
        towards: "mi.Vector3f",
        active: "mi.Bool",
    ) -> "tuple[mi.Spectrum, mi.Spectrum | mi.Float]":
        """Return scattering coefficients [1/m] at points, x [m] from the camera, and phase
        functions [1/sr] from light of unit directions to the camera.
        """
        sigma_s, _, _ = self.medium.get_scattering_coefficients(point, active)
        phase, _ = self.medium.phase_function().eval_pdf(
            mi.PhaseFunctionContext(), point, towards, active
        )
        return sigma_s, phase

    @abstractmethod
    def transmittance(
        self,
        x: "mi.Float64",
        point: "mi.Interaction3f",
        path: Path,
        ray: Ray,
        sampler: "mi.Sampler",
        active: "mi.Bool",
    ) -> Transmittance:
        """Return the transmittance from the light along the paths to points, and from there to the
        camera, x [m] away; 0 where a surface stands in a path.
        """


@dataclass(frozen=True)
class Stretch(Part):
    """The part of camera rays in one homogeneous medium."""

    depth: "mi.Spectrum"  #: optical depth from the camera to its start
    sigma_t: "mi.Spectrum"  #: [1/m]
    rates: "Sequence[mi.Float]"  #: the values of `sigma_t`, a common one once [1/m]
    at_camera: "mi.MediumPtr"  #: the medium in which the camera is

    def distances(
        self,
        u: "mi.Float | mi.Float64",
        low: "mi.Float64",
        length: "mi.Float64",
        span: Span | None,
    ) -> Distances:
        """Sample distances by the mixture of techniques; see `Part`."""
        if span is None:
            return sample_stretch(u, length, self.rates)
        return sample_distance(u, mixture_of(span, self.rates))

    def transmittance(
        self,
        x: "mi.Float64",
        point: "mi.Interaction3f",
        path: Path,
        ray: Ray,
        sampler: "mi.Sampler",
        active: "mi.Bool",
    ) -> Transmittance:
        """Return the transmittance of both ways; see `Part`."""
        segment = self.on_path(path, ray, active)
        return segment * dr.exp(-self.depth - self.sigma_t * mi.Float(x - self.start)), sampler

    def on_path(
        self, path: Path, ray: Ray, active: "mi.Bool", fraction: "mi.Float | float" = 1.0
    ) -> "mi.Spectrum":
        """Return the transmittance along paths through a fraction of the optical depth; 0 where a
        surface stands in one.
        """
        media = Segment(self._medium_at_light(path, ray, active), self.sigma_t)
        return transmittance(self.around, path, media=media, active=active, fraction=fraction)

    def _medium_at_light(self, path: Path, ray: Ray, active: "mi.Bool") -> "mi.MediumPtr":
        """Return the media at lights: vacuum beyond all shapes, the one that the path names, or the
        one that is looked for now.
        """
        if path.far or not self.around.bounded:
            return dr.zeros(mi.MediumPtr)
        if path.medium is not None:
            return path.medium
        return medium_at(self.around, path.begin, ray.origin, self.at_camera, active)


def double_ray(origin: "mi.Point3d", direction: "mi.Vector3d") -> Ray:
    """Return rays given in double precision; their directions need not have unit length."""
    direction = dr.normalize(direction)
    return Ray(mi.Point3f(origin), dr.normalize(mi.Vector3f(direction)), origin, direction)


def cell_of(number: "mi.UInt32", shift: "mi.Float", count: int) -> "tuple[mi.Float, mi.Float]":
    """Return where a cell of the unit interval begins, and its width.

    All cells are 1/(count - 1) wide but the first and the last, which share that width as `shift`
    in [0, 1) says. The edge of a shadow therefore lies anywhere in its cell from batch to batch. In
    cells that stay, few batches would have a sample beyond an edge close to the end of its cell,
    and the spread between the others would not show it.
    """
    if count == 1:
        return mi.Float(0), mi.Float(1)
    place = mi.Float(number) + shift
    low, high = dr.maximum(place - 1, 0), dr.minimum(place, count - 1)
    return low / (count - 1), (high - low) / (count - 1)


def place_of(index: "mi.UInt32", start: "mi.Point2f") -> "tuple[mi.Float64, mi.Float64]":
    """Return a point of Kronecker's sequence in the unit square, given its number and the start of
    the sequence.
    """
    number = mi.Float64(index)
    # 1/x and 1/x^2 with x^3 = x + 1: they fill a square evenly.
    steps = (0.7548776662466927, 0.5698402909980532)
    u, v = (mi.Float64(begin) + number * step for begin, step in zip(start, steps))
    return u - dr.floor(u), v - dr.floor(v)


def point_on(ray: Ray, position: "mi.Point3f") -> "mi.MediumInteraction3f":
    """Return points of a medium on camera rays, given their positions [m]."""
    point = dr.zeros(mi.MediumInteraction3f)
    point.p = position
    point.wi = -ray.direction
    point.sh_frame = mi.Frame3f(ray.direction)
    return point
