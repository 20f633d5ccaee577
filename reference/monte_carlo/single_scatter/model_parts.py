# SPDX-License-Identifier: BSD-3-Clause
"""Parts of camera rays whose light follows the terms of a model.

`reference.monte_carlo.single_scatter.model_terms` has the derivation. Each part draws its distances
from free flights of the rate that the camera path has, and attenuates both ways by their fractions
of the optical depth. The depth to the camera begins where the fog does.
"""

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Self

import drjit as dr
import mitsuba as mi

from airlight.reference.monte_carlo.single_scatter.boundary_walk import Path, unblocked
from airlight.reference.monte_carlo.single_scatter.distance_sampling import (
    Span,
    mixture_of,
    sample_distance,
    sample_stretch,
)
from airlight.reference.monte_carlo.single_scatter.model_terms import RayTerms
from airlight.reference.monte_carlo.single_scatter.stretches import (
    Distances,
    Part,
    Ray,
    Stretch,
    Transmittance,
)
from airlight.reference.monte_carlo.single_scatter.varying_media import FogPart, GridPart

# Places further than this from the camera do not count: no depth is infinite [m].
_FARTHEST = 1e15
_FREE_PATHS = 40.0  # up to where a sun lights an unbounded part


@dataclass(frozen=True)
class ModelPart(Part):
    """A part of camera rays in a medium, and the terms of its light."""

    terms: RayTerms

    @abstractmethod
    def to_camera(
        self, x: "mi.Float64", ray: Ray, sampler: "mi.Sampler", active: "mi.Bool"
    ) -> Transmittance:
        """Return the transmittance from points, x [m] along the rays, to the camera."""

    @abstractmethod
    def from_light(
        self,
        point: "mi.Interaction3f",
        path: Path,
        ray: Ray,
        sampler: "mi.Sampler",
        active: "mi.Bool",
    ) -> Transmittance:
        """Return the transmittance from the light along paths to points."""

    def depth_to(self, x: "mi.Float64") -> "mi.Spectrum":
        """Return the optical depth along the rays from the beginning of the fog to x [m].

        Grids have none in closed form; terms that need it are refused there.
        """
        raise NotImplementedError

    def cut(self) -> Self:
        """Return the part without an end so far away that no light of a sun arrives from there."""
        return self

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
        camera, sampler = self.to_camera(x, ray, sampler, active)
        if self.terms.least is not None:
            camera = dr.maximum(camera, self.terms.least)
        light, sampler = self.from_light(point, path, ray, sampler, active)
        return camera * light, sampler

    def scattering(
        self,
        x: "mi.Float64",
        point: "mi.MediumInteraction3f",
        towards: "mi.Vector3f",
        active: "mi.Bool",
    ) -> "tuple[mi.Spectrum, mi.Spectrum | mi.Float]":
        """Return scattering coefficients, with all factors of the terms, and phase functions; see
        `Part`.
        """
        sigma_s, _, sigma_t = self.medium.get_scattering_coefficients(point, active)
        terms = self.terms
        phase = terms.scattering.per_steradian(self.medium, point, towards, active, lamp=terms.lamp)
        sigma_s = sigma_s * mi.Float(terms.weight_at(x))
        if terms.length is not None:
            sigma_s *= dr.exp(-sigma_t * mi.Float(terms.length))
        return sigma_s, phase

    def seen(self, path: Path, active: "mi.Bool") -> "mi.Bool":
        """Return where no surface stands in a path."""
        return unblocked(self.terms.opaque, *path.ray, active)


@dataclass(frozen=True)
class ModelStretch(ModelPart, Stretch):
    """The part of camera rays in one homogeneous medium."""

    def distances(
        self,
        u: "mi.Float | mi.Float64",
        low: "mi.Float64",
        length: "mi.Float64",
        span: Span | None,
    ) -> Distances:
        """Sample distances by the mixture of techniques; see `Part`."""
        rates = [self.terms.camera * mi.Float64(rate) for rate in self.rates]
        if span is None:
            return sample_stretch(u, length, rates)
        # Flights of the rate 0 are even over a finite part, and take another rate on an unbounded
        # one.
        largest = mi.Float64(dr.max(self.sigma_t))
        legal = [dr.select((rate > 0) | (length < dr.inf), rate, largest) for rate in rates]
        return sample_distance(u, mixture_of(span, legal))

    def cut(self) -> Self:
        """Return the part without what is beyond all free paths."""
        rates = [self.terms.camera * mi.Float64(rate) for rate in self.rates]
        # A channel that the medium does not attenuate does not scatter either.
        longest = dr.select(rates[0] > 0, _FREE_PATHS / rates[0], 0)
        for rate in rates[1:]:
            longest = dr.maximum(longest, dr.select(rate > 0, _FREE_PATHS / rate, 0))
        longest = dr.select(longest > 0, longest, dr.inf)
        return replace(self, end=dr.minimum(self.end, self.start + longest))

    def depth_to(self, x: "mi.Float64") -> "mi.Spectrum":
        """Return the optical depth from the beginning of the fog to x [m]."""
        return self.depth + self.sigma_t * mi.Float(dr.clip(x - self.start, 0, _FARTHEST))

    def to_camera(
        self, x: "mi.Float64", ray: Ray, sampler: "mi.Sampler", active: "mi.Bool"
    ) -> Transmittance:
        """Return the transmittance to the camera."""
        return dr.exp(-mi.Float(self.terms.camera) * self.depth_to(x)), sampler

    def from_light(
        self,
        point: "mi.Interaction3f",
        path: Path,
        ray: Ray,
        sampler: "mi.Sampler",
        active: "mi.Bool",
    ) -> Transmittance:
        """Return the transmittance from the light."""
        if self.terms.light is None:
            return dr.select(self.seen(path, active), mi.Spectrum(1), 0), sampler
        segment = self.on_path(path, ray, active, mi.Float(self.terms.light))
        # A medium without sides is infinitely deep for a light infinitely far away.
        if path.far and self.terms.arriving is not None:
            segment *= self.terms.arriving
        return segment, sampler


@dataclass(frozen=True)
class ModelFog(ModelPart, FogPart):
    """Camera rays in height fog."""

    scale: "mi.Float64 | float" = 1.0  #: on the density, for free flights of another rate

    def distances(
        self,
        u: "mi.Float | mi.Float64",
        low: "mi.Float64",
        length: "mi.Float64",
        span: Span | None,
    ) -> Distances:
        """Sample free flights of the camera's rate, and angles at a light; see `Part`."""
        # Flights through 1e-6 of a depth are even over the depth, which stands for a rate of 0.
        depth = self._depth_to(low + length) - self._depth_to(low)
        scale = dr.maximum(self.terms.camera, 1e-6 / dr.maximum(depth, 1e-30))
        return FogPart.distances(replace(self, scale=scale), u, low, length, span)

    def depth_to(self, x: "mi.Float64") -> "mi.Spectrum":
        """Return the optical depth from the beginning of the fog to x [m]."""
        return mi.Spectrum(mi.Float(self._from_start(x)))

    def to_camera(
        self, x: "mi.Float64", ray: Ray, sampler: "mi.Sampler", active: "mi.Bool"
    ) -> Transmittance:
        """Return the transmittance to the camera."""
        return mi.Spectrum(mi.Float(dr.exp(-self.terms.camera * self._from_start(x)))), sampler

    def from_light(
        self,
        point: "mi.Interaction3f",
        path: Path,
        ray: Ray,
        sampler: "mi.Sampler",
        active: "mi.Bool",
    ) -> Transmittance:
        """Return the transmittance from the light."""
        passed = mi.Float(1)
        if self.terms.light is not None:
            passed = mi.Float(dr.exp(-self.terms.light * self._light_depth(point, path)))
        return dr.select(self.seen(path, active), mi.Spectrum(passed), 0), sampler

    def _from_start(self, x: "mi.Float64") -> "mi.Float64":
        way = dr.maximum(x - self.start, 0)
        first = self.height + self.rise * self.start
        return self._depth(first, first + self.rise * way, way)

    def _antiderivative(self, z: "mi.Float64") -> "mi.Float64":
        return self.scale * super()._antiderivative(z)

    def _density(self, z: "mi.Float64") -> "mi.Float64":
        return self.scale * super()._density(z)


@dataclass(frozen=True)
class ModelGrid(ModelPart, GridPart):
    """Camera rays in the box of a grid."""

    def to_camera(
        self, x: "mi.Float64", ray: Ray, sampler: "mi.Sampler", active: "mi.Bool"
    ) -> Transmittance:
        """Return estimates of the transmittance to the camera."""
        start = mi.Float(self.start)
        line = ray.origin + ray.direction * start, ray.direction, mi.Float(x) - start
        passed, sampler = self._tracked(line, sampler, active, fraction=mi.Float(self.terms.camera))
        return mi.Spectrum(passed), sampler

    def from_light(
        self,
        point: "mi.Interaction3f",
        path: Path,
        ray: Ray,
        sampler: "mi.Sampler",
        active: "mi.Bool",
    ) -> Transmittance:
        """Return estimates of the transmittance from the light."""
        passed = mi.Float(1)
        if self.terms.light is not None:
            passed, sampler = self._tracked(
                path.ray, sampler, active, fraction=mi.Float(self.terms.light)
            )
        return dr.select(self.seen(path, active), mi.Spectrum(passed), 0), sampler


def modelled(part: FogPart | GridPart, terms: RayTerms, near: "mi.Float64") -> ModelPart:
    """Return a part in height fog or a grid with the terms of its light, from `near` on [m]."""
    start = dr.maximum(part.start, near)
    fields = vars(part) | {
        "terms": terms,
        "start": start,
        "scatters": part.scatters & (part.end > start),
    }
    return ModelFog(**fields) if isinstance(part, FogPart) else ModelGrid(**fields)
