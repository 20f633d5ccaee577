# SPDX-License-Identifier: BSD-3-Clause
"""Point, spot and directional lights as Dr.Jit values.

A light is a homogeneous position (l, w): a place l with w = 1, or with w = 0 the direction l
towards a light at infinity. The vector from a point P towards it is l - w P, in metres for w = 1
and of unit length for w = 0. All that follows from this vector alone holds for both kinds: the foot
and the height of a ray (`realtime.rays`), the projection of its shadow map
(`realtime.shadow_maps.projection`), silhouettes and shadow planes, epipolar slices.

A directional light lights media with bounds; its place is the middle of a rectangle across it where
the media end (`realtime.scene.directional_extent`).

A light sample stands for a part of an area light (`realtime.area_lights`). In the direction w it
has the intensity I0 max(0, n . w), n its normal: it lights the half space before its plane.

**A new kind of light** is an optional field of `Light`, and lights that have it are tables of their
own by themselves (`realtime.scene.light_table`). `replace(scene, lights=(light,))` of a scene that
was read tries it. Three files know it:

1. This one: `Light.kind` names it, and `Light.varies` says that it has a profile.
2. `realtime.rays`: its profile by `RayGeometry.falloff` and `falloff_beside`, the places of its
   kinks by `smooth_subsegments`, and `profile`, the same for points. Every method and kernel asks
   these.
3. `realtime.scene.read_scene` makes it of an emitter. Mitsuba refuses parameters that its plugin
   does not have, so that a new one needs a plugin, or a word in the emitter's name.

A profile is r^2 times the irradiance of a plane across the light, over the intensity. It may depend
on the direction, as that of a spot, and on the distance. A ball of the radius R, whose light
engines let fall as 1/max(r, R)^2, has min(1, r^2/R^2), with kinks where the ray meets the ball.

Nodes lie densely where 1/r^2 is large, and a profile that takes this peak away needs more than its
kinks. Over the angle at the light the integrand of a ball piles up at the ends of the chord: a ray
at a thousandth of R from the centre loses half of its airlight, without any message. Cut such
pieces geometrically, from the height to R (each piece compiles the kernel once more), and let
`methods.interface.marching` step with max(height, R) for the height. Then the kernels `exact` and
`quadrature` are right to 5e-6, and to 1e-3 on the ray through the centre.

Two more files are asked by some: `realtime.shadow_maps.projection` has maps of the directions into
which a light shines, all of them unless it says otherwise, and `methods.shader.scene_arrays` tells
users' shaders of lights.
"""

import math
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.realtime.numerics.array_types import ArrayTypes, host_numbers

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Cone:
    """A cone about the axis of a spot, by its half angle."""

    cos: Any  #: in float64
    square_sin: Any  #: in float64


@dataclass(frozen=True)
class DirectionalExtent:
    """A rectangle across a directional light, and the media before it, which end there, or the
    shapes before it in a medium without sides.
    """

    across: Any  #: half of one side, a three-vector [m]
    up: Any  #: half of the other [m]
    depth: Any  #: how far before it there are no shapes any more [m]
    #: how far before it media end, 0; or a number below 0, where they have no sides [m]
    lowest: Any
    media: Any  #: middles of spheres whose hull holds the media, several entries [m]
    radii: Any  #: their radii [m]
    back: Any  #: how far from the middle of the media there are none, in any direction [m]


@dataclass(frozen=True)
class Facing:
    """The direction in which the part of a shape faces that a light sample stands for."""

    exact_normal: Any  #: unit normal of the shape, on the side that shines, in float64
    lift: Any  #: how far before the shape rays start, so that they do not meet it [m]
    #: how long a ray is in the shape that goes along the normal, from behind:
    #: twice a sphere's radius [m]
    chord: Any


@dataclass(frozen=True)
class Light:
    """A light. The arrays hold one entry and are opaque, so a light that moves recompiles nothing.

    Which fields are there says what it can be asked: a `cone` clips rays, a `beam` within it makes
    the intensity vary along them, `facing` does both, and a light with an `extent` is at infinity.
    """

    position: Any  #: three-vector; directional: the middle of `extent` [m]
    #: radiant intensity on the axis [W/sr], RGB; directional: irradiance of
    #: a plane across it [W/m^2]
    intensity: Any
    exact_axis: Any = None  #: `axis` in float64
    cutoff: Any = None  #: spot: half angle beyond which there is no light [rad]
    cone: Any = None  #: spot: the `Cone` of the cut-off
    beam: Any = None  #: soft spot: the `Cone` in which the intensity is full
    inverse_transition: Any = None  #: soft spot: 1 / (cutoff - beam) [1/rad]
    #: directional: the `DirectionalExtent` through which all light of the media comes
    extent: Any = None
    facing: Facing | None = None  #: light sample: how its shape faces
    source: int | None = None  #: light sample: the number of its light in `Scene.area_lights`
    #: the radiance of a uniform sky, for which this light stands as a beam from above [W/(m^2 sr)]
    sky: Any = None

    @property
    def w(self) -> int:
        """The last coordinate of its homogeneous position: 1 for a place, 0 for a direction."""
        return 0 if self.extent is not None else 1

    @property
    def kind(self) -> str:
        """Its name in messages and counts: 'point', 'spot', 'directional', or
        'area' for a light sample.
        """
        if self.facing is not None:
            return "area"
        return "spot" if self.cone is not None else "point" if self.w else "directional"

    @property
    def axis(self) -> Any:
        """Spot: unit vector from the light along its axis; directional: in which the
        light travels; others: None.
        """
        return None if self.exact_axis is None else type(self.position)(self.exact_axis)

    @property
    def normal(self) -> Any:
        """The normal of a light sample, a unit vector; None for other lights."""
        return None if self.facing is None else type(self.position)(self.facing.exact_normal)

    @property
    def varies(self) -> bool:
        """Whether it has a profile that varies along a ray, as a soft spot has; else the
        intensity is constant on the lit part.
        """
        return self.beam is not None or self.facing is not None

    @property
    def cos_cutoff(self) -> Any:
        """Cosine of the half angle beyond which there is no light; None without a cone."""
        return None if self.cone is None else type(self.position.x)(self.cone.cos)

    def toward(self, point) -> Any:
        """Return l - w P: the vector to the light [m], or the unit direction to one at infinity.

        Parameters
        ----------
        point
            Points P, a three-vector [m].
        """
        return self.position - point if self.w else -self.axis

    def shadow_ray(self, point) -> Any:
        """Return the Mitsuba ray that is blocked where the light does not reach a point; a
        surface there blocks none.

        Parameters
        ----------
        point
            Points, a three-vector [m].
        """
        if not self.w:
            # From the point on, where a ray is exact, though not from the
            # surface that it may lie on.
            away = 2e-6 * self.extent.depth
            return mi.Ray3f(mi.Point3f(point - self.axis * away), mi.Vector3f(-self.axis))
        start = mi.Point3f(self.position)
        if self.facing is not None:
            start += mi.Vector3f(self.normal * self.facing.lift)
        direction = mi.Vector3f(point) - mi.Vector3f(start)
        length = dr.norm(direction)
        # Twenty units in the last place before the point: on a surface the point itself
        # must not block the light.
        return mi.Ray3f(start, direction / length, length * (1 - 2e-6), 0.0, [])

    def shadow_ray_from(self, interaction, size: float) -> Any:
        """Return the Mitsuba ray from a surface interaction that is blocked where the
        light does not reach it.

        Parameters
        ----------
        interaction
            Where camera rays meet surfaces.
        size
            The size of the scene [m].
        """
        if size >= 1:
            if self.w:
                return interaction.spawn_ray_to(mi.Point3f(self.position))
            return interaction.spawn_ray(mi.Vector3f(-self.axis))
        # Mitsuba starts a ray RayEpsilon (1 + the largest coordinate) off its surface, which is
        # far beyond the walls of a scene of a millimetre: in a small scene its size stands for
        # the 1 m.
        away = mi.math.RayEpsilon * (size + dr.max(dr.abs(interaction.p)))
        way = mi.Vector3f(self.toward(type(self.position)(interaction.p)))
        start = interaction.p + interaction.n * dr.mulsign(away, dr.dot(interaction.n, way))
        if not self.w:
            return mi.Ray3f(start, way)
        way = mi.Point3f(self.position) - start
        length = dr.norm(way)
        return mi.Ray3f(start, way / length, length * (1 - mi.math.ShadowEpsilon), 0.0, [])

    def rays_from(self, unit) -> tuple[Any, Any]:
        """Return the origins of rays from a light at a place, and how far they are from it [m].

        Rays from a light sample start beyond the shape on which it lies: they do not meet it.

        Parameters
        ----------
        unit
            Unit directions, in any precision.
        """
        if self.facing is None:
            return self.position, 0
        # A ray to the side that shines starts `lift` before the shape. A ray to the other side
        # starts behind the shape, at the end of its chord through it.
        cosine = dr.dot(unit, self.normal)
        skipped = dr.maximum(-self.facing.chord * cosine, 0)
        return self.position + self.normal * dr.mulsign(
            self.facing.lift, cosine
        ) + unit * skipped, skipped

    def without_cone(self) -> "Light":
        """Return the light without its cone: a point light."""
        return Light(self.position, self.intensity)


def host_position(light: Light) -> Array:
    """Return the homogeneous position of a light on the host: l [m for w = 1]
    and w, (4,), in float64.
    """
    if light.w:
        return np.append(host_numbers(light.position)[0], 1.0)
    return np.append(-host_numbers(light.exact_axis)[0], 0.0)


def place_and_weight(position: Array) -> tuple[Array, int]:
    """Return l and w of a homogeneous position (4,), or of a place (3,), whose w is 1."""
    return position[:3], int(position[3]) if len(position) == 4 else 1


def spot_fields(axis, cutoff: float, beam: float, types: ArrayTypes) -> dict[str, Any]:
    """Return the fields of a `Light` that only a spot has.

    Parameters
    ----------
    axis
        Unit vector from the light along its axis, in float64.
    cutoff
        Half angle beyond which there is no light [rad].
    beam
        Half angle up to which the intensity is full [rad].
    types
        Types of the arrays.
    """
    fields = {
        "exact_axis": mi.Vector3d(*(float(component) for component in axis)),
        "cutoff": types.scalar(cutoff),
        "cone": _cone(cutoff),
    }
    # A spot whose beam fills its cone has an edge, and no transition to divide by.
    if beam < cutoff:
        fields |= {"beam": _cone(beam), "inverse_transition": types.scalar(1 / (cutoff - beam))}
    return fields


def _cone(angle: float) -> Cone:
    return Cone(mi.Float64(math.cos(angle)), mi.Float64(math.sin(angle) ** 2))
