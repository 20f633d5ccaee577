# SPDX-License-Identifier: BSD-3-Clause
r"""Lights for the estimator: the light that one sample on a camera ray, or on a surface, receives.

A light at a place sends the intensity I to a point at the distance r; a sample receives I/(r^2
density), with the density of the distances along the ray
(`reference.monte_carlo.single_scatter.stretches.Part`). An area light has a point y for each
sample, which is such a light: its intensity is Le max(0, n . w) over the density of y, w the unit
vector from y. The plane of y clips the ray: points behind it get no light from y. A model has
another falloff for 1/r^2, and other edges of spots
(`reference.monte_carlo.single_scatter.model_lamps`). A sun and a sky have an irradiance, and a sky
has a direction for each sample. Mitsuba's emitters compute the emission, except for area lights,
whose points are drawn by `reference.monte_carlo.single_scatter.area_sampling`, not by Mitsuba's
`sample_direction`.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self, TypeAlias

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.reference.monte_carlo.single_scatter.area_sampling import (
    Emitting,
    LightSample,
    emitting,
)
from airlight.reference.monte_carlo.single_scatter.boundary_walk import Path, step_beyond
from airlight.reference.monte_carlo.single_scatter.distance_sampling import (
    Approach,
    Span,
    closest_approach,
    cone_ends,
)
from airlight.reference.monte_carlo.single_scatter.model_lamps import (
    Falloff,
    SpotEdge,
    falloff_of,
    spot_edge,
)
from airlight.reference.monte_carlo.single_scatter.stretches import Part, Ray, point_on
from airlight.reference.scene.area_light import is_area
from airlight.reference.scene.directional_light import is_directional
from airlight.reference.scene.model import Model
from airlight.reference.scene.read import ReferenceScene, whole_scene
from airlight.reference.scene.shape_roles import metre_of, scene_from

#: points of the unit square
SquarePoints: TypeAlias = "tuple[mi.Float64, mi.Float64]"
#: distances along a ray from the foot of the perpendicular from the light, may be infinite [m]
Ends: TypeAlias = "tuple[mi.Float64, mi.Float64]"
#: unit vectors from surfaces to the light, paths from it, irradiance across these [W/m^2]
SurfaceLight: TypeAlias = "tuple[mi.Vector3f, Path, mi.Spectrum]"


@dataclass(frozen=True)
class Sample:
    """A distance along camera rays, and the light that arrives there."""

    x: "mi.Float64"  #: [m]
    point: "mi.MediumInteraction3f"  #: the point of the medium
    towards: "mi.Vector3f"  #: unit vectors to the light
    path: Path
    #: irradiance across the path with nothing in its way, over the density of the sample [W/m]
    value: "mi.Spectrum"
    counts: "mi.Bool"  #: whether the light can reach the sample


class _Near(ABC):
    """Lights at places: a subclass has points, says what these send, and what part of a ray they
    could light.
    """

    count = 1  # of lights
    position: "mi.Point3d | None" = None  # of all samples, if it is the same for all [m]
    medium: "mi.MediumPtr | None" = None  # where every path begins, if it is known
    falloff: Falloff | None = None  # with the distance, if it is another than the inverse square

    def light(self, number: "mi.UInt32") -> Self:
        """Return one of several lights; a source of one has one."""
        return self

    @abstractmethod
    def point(self, numbers: SquarePoints, to: "Ray | mi.Point3d") -> LightSample:
        """Return points of the light for rays or for places on surfaces [m]."""

    @abstractmethod
    def sent(
        self, point: LightSample, at: "mi.Interaction3f", from_light: "mi.Vector3f"
    ) -> "mi.Spectrum":
        """Return the intensity towards places in unit directions, over the density of the points
        [W/sr].
        """

    @abstractmethod
    def ends(self, point: LightSample, approach: Approach, ray: Ray) -> Ends:
        """Return the ends of the part of a line that the points could light."""

    def on_ray(
        self, u: "mi.Float", numbers: SquarePoints, ray: Ray, part: Part, active: "mi.Bool"
    ) -> Sample:
        """Return samples on rays, for `u` uniform in [0, 1)."""
        light = self.point(numbers, ray)
        approach = closest_approach(ray.origin_double, ray.direction_double, light.position)
        # The part of the stretch that the light's point could light: in the cone of a spot, before
        # the plane of an area light's point.
        low, high = (approach.foot + end for end in self.ends(light, approach, ray))
        low, high = dr.maximum(part.start, low), dr.minimum(part.end, high)
        height = approach.height
        if self.falloff is not None:
            # The part within the range; the law says the height at which the angles are drawn.
            half = self.falloff.half_chord(height)
            low, high = (
                dr.maximum(approach.foot - half, low),
                dr.minimum(approach.foot + half, high),
            )
            height = self.falloff.sampling_height(height)
        used = active & (high > low) & (light.density > 0)
        low = dr.select(used, low, 0)
        length = dr.select(used, high - low, 1)
        span = Span(height, low - approach.foot, length)
        y, density = part.distances(u, low, length, span)
        s = span.start + y
        square = approach.height * approach.height + s * s
        # All places are relative to the light, so that those close to it keep their digits.
        way = mi.Vector3f(approach.normal * approach.height + ray.direction_double * s)
        from_light = way / mi.Float(dr.sqrt(square))
        point = point_on(ray, mi.Point3f(light.position) + way)
        # Places further than 1e15 m from the light do not count: squares of longer ways overflow in
        # single precision.
        farthest = 1e15
        used &= (density > 0) & (square < farthest * farthest)
        falls = 1 / (square * density)
        if self.falloff is not None:
            falls = self.falloff.in_fog(square) / density
        value = self.sent(light, point, from_light) * mi.Float(dr.select(used, falls, 0))
        return Sample(low + y, point, -from_light, self._path(light, way), value, used)

    def on_surface(
        self, numbers: SquarePoints, hit: "mi.SurfaceInteraction3f", active: "mi.Bool"
    ) -> SurfaceLight:
        """Return the light that arrives at surfaces."""
        light = self.point(numbers, mi.Point3d(hit.p))
        way = hit.p - mi.Point3f(light.position)
        r = dr.norm(way)
        from_light = way / r
        irradiance = self.sent(light, hit, from_light) / (r * r)
        if self.falloff is not None:
            irradiance *= mi.Float(self.falloff.on_surface(dr.square(mi.Float64(r))))
        return -from_light, self._path(light, way), irradiance

    def _path(self, light: LightSample, way: "mi.Vector3f") -> Path:
        """Return the paths along ways from the light [m]."""
        begin = mi.Point3f(light.position)
        # They start a hair before the surface of the light, if it has one, so as not to meet it.
        hair = mi.Vector3f(light.normal) * step_beyond(begin, dr.minimum(dr.norm(way), 1))
        way = way - hair
        length = dr.norm(way)
        return Path(begin + hair, way / length, length, medium=self.medium)


@dataclass(frozen=True, kw_only=True)
class _Placed(_Near):
    """Lights of one place each."""

    position: "mi.Point3d"  #: [m]
    medium: "mi.MediumPtr | None" = None  #: the medium that it is in, if it is known
    falloff: Falloff | None = None  #: that of a model; None for the inverse square
    varies = False

    def point(self, numbers: SquarePoints, to: "Ray | mi.Point3d") -> LightSample:
        """Return its place, for every sample."""
        return LightSample(self.position, mi.Vector3d(0), mi.Float64(1))


@dataclass(frozen=True, kw_only=True)
class PointSource(_Placed):
    """Point lights, one or several."""

    intensity: "mi.Color3f"  #: of each, the same in all directions [W/sr]
    count: int = 1

    def light(self, number: "mi.UInt32") -> Self:
        """Return one of the lights."""
        intensity = dr.gather(mi.Color3f, self.intensity, number)
        position = dr.gather(mi.Point3d, self.position, number)
        return replace(self, intensity=intensity, position=position, count=1)

    def sent(
        self, point: LightSample, at: "mi.Interaction3f", from_light: "mi.Vector3f"
    ) -> "mi.Spectrum":
        """Return the intensity."""
        return self.intensity

    def ends(self, point: LightSample, approach: Approach, ray: Ray) -> Ends:
        """Return the ends of all of a line."""
        return -dr.inf, dr.inf


@dataclass(frozen=True, kw_only=True)
class SpotSource(_Placed):
    """A spot."""

    emitter: "mi.Emitter"
    axis: "mi.Vector3d"  #: unit vector
    cutoff: float  #: half angle of the cone [rad]
    edge: SpotEdge | None = None  #: that of a model; None for the emitter's

    def sent(
        self, point: LightSample, at: "mi.Interaction3f", from_light: "mi.Vector3f"
    ) -> "mi.Spectrum":
        """Return the intensity: the emitter's irradiance times the squared distance, or that of a
        model's edge.
        """
        if self.edge is not None:
            return self.edge.sent(from_light)
        sample, irradiance = self.emitter.sample_direction(at, mi.Point2f(0.5))
        return irradiance * sample.dist * sample.dist

    def ends(self, point: LightSample, approach: Approach, ray: Ray) -> Ends:
        """Return the ends of the part of a line in the cone."""
        return cone_ends(approach, ray.direction_double, axis=self.axis, cutoff=self.cutoff)


@dataclass(frozen=True)
class AreaSource(_Near):
    """An area light."""

    shape: Emitting
    radiance: "mi.Color3f"  #: [W/(m^2 sr)]
    alone: "mi.Scene"  #: the shape of the light by itself
    metre: "mi.Float"  #: 1 m, or the size of a smaller scene [m]
    varies = True

    def point(self, numbers: SquarePoints, to: "Ray | mi.Point3d") -> LightSample:
        """Return points that are spread towards rays, or face places on surfaces."""
        u, v = numbers
        if isinstance(to, Ray):
            return self.shape.towards(u, v, to.origin_double, to.direction_double)
        return self.shape.facing(u, v, to)

    def sent(
        self, point: LightSample, at: "mi.Interaction3f", from_light: "mi.Vector3f"
    ) -> "mi.Spectrum":
        """Return the intensity of points."""
        cosine = dr.maximum(dr.dot(mi.Vector3f(point.normal), from_light), 0)
        density = dr.select(point.density > 0, point.density, 1)
        return self.radiance * (cosine / mi.Float(density))

    def ends(self, point: LightSample, approach: Approach, ray: Ray) -> Ends:
        """Return the ends of the part of a line before the plane of each point."""
        slope = dr.dot(ray.direction_double, point.normal)
        level = dr.dot(ray.origin_double - point.position, point.normal)
        # A ray with a slope below 1e-12 is parallel to the plane of the point: all of it is before
        # the plane, or nothing.
        parallel = dr.abs(slope) < 1e-12
        crossing = -level / dr.select(parallel, 1, slope) - approach.foot
        low = dr.select(~parallel & (slope > 0), crossing, -dr.inf)
        high = dr.select(~parallel & (slope < 0), crossing, dr.inf)
        return low, dr.select(parallel & (level <= 0), -dr.inf, high)

    def in_mirror(
        self, hit: "mi.SurfaceInteraction3f", towards: "mi.Vector3f", active: "mi.Bool"
    ) -> tuple[Path, "mi.Spectrum"]:
        """Return the way from where rays off a mirror first meet the light, and its radiance
        there.
        """
        start = hit.p + towards * _clear(hit, self.metre)
        met = self.alone.ray_intersect(mi.Ray3f(start, towards), active)
        sends = met.is_valid() & (mi.Frame3f.cos_theta(met.wi) > 0)
        place = mi.Point3d(dr.select(sends, met.p, start + towards))
        point = LightSample(place, mi.Vector3d(met.n), mi.Float64(1))
        return self._path(point, hit.p - mi.Point3f(place)), dr.select(sends, self.radiance, 0)


@dataclass(frozen=True)
class FarSource:
    """A sun, or a uniform sky; each sample of a sky has its own direction, even over the sphere."""

    emitter: "mi.Emitter"
    metre: "mi.Float"  #: 1 m, or the size of a smaller scene [m]
    count = 1
    position = None

    @property
    def varies(self) -> bool:
        """Whether samples differ on one surface."""
        return is_sky(self.emitter)

    def light(self, number: "mi.UInt32") -> Self:
        """Return the light."""
        return self

    def on_ray(
        self, u: "mi.Float", numbers: SquarePoints, ray: Ray, part: Part, active: "mi.Bool"
    ) -> Sample:
        """Return samples on rays; see `_Near`."""
        length = part.end - part.start
        used = active & (length > 0) & (length < dr.inf)
        # Lights at infinity have no foot on the ray: no span. An unbounded part draws nothing.
        y, density = part.distances(u, part.start, dr.select(used, length, 1), None)
        x = part.start + y
        point = point_on(ray, ray.origin + ray.direction * mi.Float(x))
        sample, irradiance = self.emitter.sample_direction(point, mi.Point2f(*numbers), used)
        path = Path.to_afar(point.p, sample.d)
        used &= density > 0
        return Sample(
            x, point, sample.d, path, irradiance * mi.Float(dr.select(used, 1 / density, 0)), used
        )

    def on_surface(
        self, numbers: SquarePoints, hit: "mi.SurfaceInteraction3f", active: "mi.Bool"
    ) -> SurfaceLight:
        """Return the light that arrives at surfaces."""
        sample, irradiance = self.emitter.sample_direction(hit, mi.Point2f(*numbers), active)
        return sample.d, Path.to_afar(hit.p, sample.d, _clear(hit, self.metre)), irradiance

    def in_mirror(
        self, hit: "mi.SurfaceInteraction3f", towards: "mi.Vector3f", active: "mi.Bool"
    ) -> tuple[Path, "mi.Spectrum"]:
        """Return the way from a sky along rays off a mirror, and its radiance."""
        seen = dr.zeros(mi.SurfaceInteraction3f, dr.width(active))
        seen.wi = -towards
        path = Path.to_afar(hit.p, towards, _clear(hit, self.metre))
        return path, self.emitter.eval(seen, active)


Source = PointSource | SpotSource | AreaSource | FarSource


def _clear(hit: "mi.SurfaceInteraction3f", metre: "mi.Float") -> "mi.Float":
    """Return how far off surfaces rays start, so as not to meet them again [m]."""
    # Mitsuba's own rays leap as far in scenes of metres, along the normal, and over smaller scenes.
    return mi.math.RayEpsilon * (metre + dr.max(dr.abs(hit.p)))


def is_sky(emitter: "mi.Emitter") -> bool:
    """Return whether an emitter is a uniform sky."""
    return bool(emitter.class_name() == "ConstantBackgroundEmitter")


def sources_of(reference: ReferenceScene) -> tuple[Source, ...]:
    """Return the lights of a scene; all point lights are one source."""
    emitters = [emitter for emitter in whole_scene(reference).emitters() if not is_area(emitter)]
    points = [emitter for emitter in emitters if emitter.class_name() == "PointLight"]
    model = reference.model
    falloff = None if model.is_physical else falloff_of(model)
    metre = dr.opaque(mi.Float, metre_of(reference.scene))
    others = [
        FarSource(emitter, metre)
        if is_sky(emitter) or is_directional(emitter)
        else _spot(emitter, model, falloff)
        for emitter in emitters
        if emitter not in points
    ]
    area = [
        AreaSource(
            emitting(light),
            mi.Color3f(*light.radiance.tolist()),
            scene_from([light.shape]),
            metre,
        )
        for light in reference.area
    ]
    return (*([_point_lights(points, falloff)] if points else []), *others, *area)


def _point_lights(emitters: Sequence["mi.Emitter"], falloff: Falloff | None) -> PointSource:
    # A point light sends the same in all directions: its emitter is asked once, from beside it, since
    # its irradiance is infinite where it is.
    places, intensities = np.empty((2, 3, len(emitters)))
    for number, emitter in enumerate(emitters):
        beside = dr.zeros(mi.Interaction3f)
        place = emitter.sample_direction(beside, mi.Point2f(0.5))[0].p
        size = dr.max(dr.abs(place))
        beside.p = mi.Point3f(place.x + dr.select(size > 0, size, 1), place.y, place.z)
        sample, irradiance = emitter.sample_direction(beside, mi.Point2f(0.5))
        places[:, number] = np.ravel(sample.p)
        intensities[:, number] = np.ravel(irradiance * sample.dist * sample.dist)
    # An array for each coordinate: cut out of one, their kernels would hold how many there are.
    return PointSource(
        position=mi.Point3d(*places),
        intensity=mi.Color3f(*intensities),
        count=len(emitters),
        falloff=falloff,
    )


def _spot(emitter: "mi.Emitter", model: Model, falloff: Falloff | None) -> SpotSource:
    sample, _ = emitter.sample_direction(dr.zeros(mi.Interaction3f), mi.Point2f(0.5))
    axis = dr.normalize(mi.Vector3d(emitter.world_transform() @ mi.Vector3f(0, 0, 1)))
    cutoff = float(np.ravel(mi.traverse(emitter)["cutoff_angle"])[0])
    return SpotSource(
        position=mi.Point3d(sample.p),
        emitter=emitter,
        axis=axis,
        cutoff=math.radians(cutoff),
        falloff=falloff,
        edge=spot_edge(model, emitter, axis),
    )
