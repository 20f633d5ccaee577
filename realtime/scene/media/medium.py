# SPDX-License-Identifier: BSD-3-Clause
"""The interface of every medium, which all code that renders in media uses
(see the page of this room).

The plainest medium is here too: homogeneous, without bounds. Its extinction is the same everywhere,
so integrals leave out albedo sigma_t, and integrals of a grey medium are one number. Its airlight
is the business of a kernel, a function ``kernel(geometry, x0, x1, medium, light) -> J [1/m]``
(`realtime.kernels.registry`), which attenuates by exp(-sigma_t (x + r)).
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import drjit as dr

from airlight.errors import InputError
from airlight.realtime.numerics.array_types import is_single
from airlight.realtime.numerics.functions import exp_bounded, opacity
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.integrate import (
    Node,
    Start,
    half_angles,
    integral,
    panel_nodes,
)
from airlight.realtime.scene.phase import Phase
from airlight.realtime.scene.rule_reach import CHANGE

OPTICAL_REACH = 20.0  #: optical depths after which float32 has nothing left of light: e^-20 = 2e-9

#: Returns the value of a phase function at the angle by which light is scattered.
Angle = Callable[[Any], Any]


@dataclass(frozen=True)
class Rays:
    """Rays in a medium, made by `Medium.rays`."""

    origin: Any  #: one for all rays, or one each [m]
    direction: Any  #: unit directions
    aim: Any  #: the same in float64, of about unit length, for what lies near a light
    #: what the medium finds of them once, such as where they enter and leave its parts
    crossed: tuple[Any, ...]

    def at(self, x):
        """Return the points at the distances x [m]."""
        return dr.fma(self.direction, x, self.origin)


class Medium(ABC):
    """The base class of media, which are frozen dataclasses; see the page of this room."""

    albedo: Any  #: single-scattering albedo, RGB [1]; its type is the type of colours
    phase: Any  #: the phase function
    sums_depth = False  #: whether depths are walks, so that a march adds those of its steps up
    clear = False  #: whether nothing scatters or absorbs but bounded media
    bounded_media: tuple[Any, ...] = ()  #: those in it
    #: in vacuum: all bounded media, of any shape, for methods that render clouds
    clouds: Any = None

    @property
    def summary(self) -> str:
        """Say in words for the user which medium it is, and how it is rendered."""
        return "unbounded: every ray lies in it whole"

    @property
    def phases(self) -> Sequence[Any]:
        """The phase functions in it."""
        return (self.phase,)

    @property
    @abstractmethod
    def channels(self) -> int:
        """1 for a grey medium, 3 for a coloured one."""

    @property
    @abstractmethod
    def vacuum(self) -> bool:
        """Whether a ray can be without extinction from some place on, in a channel."""

    @abstractmethod
    def extinction(self, rays: Rays, x) -> tuple[Any, ...]:
        """Return the extinction at distances x of rays [1/m], by channel."""

    @abstractmethod
    def optical_depth(self, rays: Rays, x0, x1) -> tuple[Any, ...]:
        """Return the optical depth of segments [m] of rays, by channel
        [1]; `x1` may be infinite.
        """

    @abstractmethod
    def longest(self, rays: Rays, light: Light, x, change: float) -> Any:
        """Return the longest panel that may begin at distances x [m]; it may be infinite.

        In it the depth to the camera, the depth to the light and the logarithm of the extinction
        together change by no more than `change`.
        """

    def bends(self, rays: Rays, light: Light) -> tuple[Any, ...]:
        """Return the distances along rays at which the extinction or a depth has a
        kink [m]; by default none.
        """
        return ()

    @abstractmethod
    def length_of(self, depth: float) -> Any:
        """Return a length in which the optical depth grows by `depth` in every
        channel, wherever it lies [m].
        """

    def rays(self, origin, direction, aim=None) -> Rays:
        """Return rays with what the medium finds of them once.

        Parameters
        ----------
        origin
            Where they start, one for all rays or one each [m].
        direction
            Unit directions.
        aim
            The directions in float64; None: the unit directions.
        """
        return Rays(origin, direction, direction if aim is None else aim, ())

    def depth_to_light(self, light: Any, point, r, active: Any = True) -> tuple[Any, ...]:
        """Return the optical depth from points [m] to a light, by channel; `r` is its
        distance [m], if it has a place.

        Parameters
        ----------
        light
            A light, or what else has a `position` [m].
        active
            The lanes to compute.
        """
        # A light at infinity: the ray from the point against its direction, without end.
        if not getattr(light, "w", 1):
            return self.optical_depth(
                self.rays(point, -light.axis), 0, dr.full(type(point.x), dr.inf)
            )
        return self.optical_depth(self.rays(point, (light.position - point) / r), 0, r)

    def source(self, rays: Rays, x, angle: Angle) -> Any:
        """Return albedo sigma_t p at distances x of rays, in parts of `unit`: a
        colour [1/m], or a number.
        """
        return self.albedo * self.colour(self.extinction(rays, x)) * angle(self.phase)

    def mean_source(self, rays: Rays, x0, x1, angle: Angle) -> Any:
        """Return the mean of `source` over segments: froxels hold one value. By default
        it is that in the middle.
        """
        return self.source(rays, 0.5 * (x0 + x1), angle)

    @property
    def unit(self) -> Any:
        """The factor that is the same everywhere, which `source` and all integrals of it leave out:
        by default 1.
        """
        return 1

    def part(self, rays: Rays, x0, x1, *, uniform: bool) -> tuple[Any, Any]:
        """Return the part of segments [m] in which steps are worth while, 0
        and 0 where there is none.

        `uniform` steps, as those of any light at infinity, need an end; steps in the angle at a
        light have it at infinity.
        """
        # Behind the optical reach nothing is left, and uniform steps would be wasted.
        return x0, dr.minimum(x1, x0 + self.length_of(OPTICAL_REACH)) if uniform else x1

    def last_depth(self, origin, forward) -> Any:
        """Return the depth from a camera behind which nothing scatters [m], None
        for media that do not say.
        """
        return None

    def ambient(self, rays: Rays, distance) -> Any:
        """Return the light of a constant field of radiance 1 in the medium up to a distance
        [m], RGB: 1 - exp(-tau).
        """
        depths = self.optical_depth(rays, 0, distance)
        return self.albedo * self.colour([opacity(depth) for depth in depths])

    def check_beam(self, axis, name: str) -> None:
        """Refuse a light at infinity along a unit vector, on the host, that
        the medium does not let in.

        Raises InputError, with the `name` of the light: by default for any.
        """
        raise InputError(
            "the scene has a directional light and a medium without bounds, which lets nothing of "
            "it through from "
            "infinity: needs media with bounds in vacuum; give the medium bounds, or use a 'point' "
            "or 'spot' light"
        )

    @abstractmethod
    def thicker(self, factor: float) -> "Medium":
        """Return it with the extinction times a factor; the albedo stays."""

    def lit(self, rays: Rays, light: Light, geometry, kernel: Any = None) -> "LitRays":
        """Return rays with one light.

        Parameters
        ----------
        rays, light
            From `rays`, and any light.
        geometry
            Where they pass the light, a `realtime.rays.RayGeometry`.
        kernel
            An airlight kernel, for media that ask one.
        """
        return LitRays(self, light, rays, geometry, kernel)

    def colour(self, channels: Sequence[Any]) -> Any:
        """Return values by channel as one: the number itself of a grey
        medium, otherwise a colour.
        """
        return channels[0] if len(channels) == 1 else type(self.albedo)(*channels)

    def transmittance(self, depths: Sequence[Any]) -> Any:
        """Return exp(-tau) of optical depths by channel, see `colour`."""
        return self.colour([exp_bounded(-depth) for depth in depths])

    def both_ways(self, rays: Rays, x, light: Any, r, camera: Sequence[Any] | None = None) -> Any:
        """Return the transmittance from a light to the points at x and on to the camera;
        `r` is their distance [m].

        `camera`: the optical depths from the camera by channel, where they are known.
        """
        # The depths of both paths add up before the one exponential.
        depths = (
            self.optical_depth(rays, 0, x) if camera is None else camera,
            self.depth_to_light(light, rays.at(x), r),
        )
        return self.transmittance([before + after for before, after in zip(*depths, strict=True)])

    def radiance(self, light: Light, integral) -> Any:
        """Return the radiance of an integral of `source` exp(-tau)/r^2 dx [W/(m^2
        sr)] (DESIGN section 2).
        """
        # Phase functions have the mean 1: 1/(4 pi) makes them densities over the sphere.
        return light.intensity * (self.unit * (integral * (0.25 * dr.inv_pi)))


class VaryingMedium(Medium):
    """A grey medium whose extinction is another at each place, and which ends somewhere."""

    @property
    def channels(self) -> int:
        """One."""
        return 1

    @property
    def vacuum(self) -> bool:
        """No: rays leave the medium, but `part` says where steps end."""
        return False

    def check_beam(self, axis, name: str) -> None:
        """Let all light in."""

    def length_of(self, depth: float) -> Any:
        """Return infinity: outside the medium it has any length."""
        return type(self.albedo.x)(dr.inf)


@dataclass(frozen=True)
class LitRays:
    """Rays with one light: what methods ask of the medium. Integrals are
    in parts of `Medium.unit`.
    """

    medium: Any
    light: Light
    rays: Any  #: `Rays`; of methods the `realtime.methods.interface.method.View`
    geometry: Any  #: foot, height and cone, `realtime.rays.RayGeometry`
    kernel: Any = None  #: an airlight kernel, for media that ask it

    def nothing(self, width: int) -> Any:
        """Return the integral of nothing for some rays."""
        return dr.zeros(type(self.medium.albedo), width)

    def segment(self, distance) -> tuple[Any, Any]:
        """Return the part of the rays that the light could reach, in the cone of a spot [m].

        Parameters
        ----------
        distance
            How far the rays go [m]; it may be infinite.
        """
        return self.geometry.lit_segment(type(distance)(0), distance)

    def airlight(self, x0, x1):
        """Return the integral over lit segments, in parts of `Medium.unit`.

        Parameters
        ----------
        x0, x1
            Ends of segments without shadow [m]; `x1` may be infinite. The part that the light could
            not reach is left out.
        """
        medium, rays = self.medium, self.rays
        # The part of the segment that is lit and in the medium. Depths of its panels count from
        # where it begins; the transmittance up to there is a factor.
        x0, x1 = self.within(*self.geometry.lit_segment(x0, x1))
        return medium.transmittance(medium.optical_depth(rays, 0, x0)) * self.sum(
            integral(self, x0, x1)
        )

    # The integrand, in the words of `realtime.scene.media.integrate`. A state is the optical depth,
    # by channel, from where the segment begins to where a panel does.

    @property
    def most_panels(self) -> int:
        """The number of panels of a segment that a frame does not refuse."""
        return 200

    def within(self, x0, x1) -> tuple[Any, Any]:
        """Return the part of segments in which the medium scatters [m]."""
        return self.medium.part(self.rays, x0, x1, uniform=False)

    @property
    def phase(self) -> Phase:
        """The phase function whose lobe says how wide panels are."""
        return self.medium.phase

    def nodes(self, Float) -> int:
        """Return how many nodes a panel has."""
        return panel_nodes(Float)

    def panel_width(self, Float) -> Any:
        """Return how wide panels may be in ln E."""
        return self.phase.width(Float)

    def sum(self, totals: list[Any]) -> Any:
        """Return the integral from the sums of `values`."""
        return totals[0]

    def bends(self) -> tuple[Any, ...]:
        """Return the distances at which panels end [m]."""
        return self.medium.bends(self.rays, self.light)

    def zeros(self, width: int) -> list[Any]:
        """Return the sums of nothing of some rays."""
        return [self.nothing(width)]

    def begin(self, x) -> Any:
        """Return the state at the beginning of segments, x [m]."""
        return [0 * x for _ in range(self.medium.channels)]

    def shines(self, depths) -> Any:
        """Return whether something is left of the light behind panels.

        The reach is twice the usual one: on the way out of thick fog the depth to the light may
        fall by more than the depth to the camera grows.
        """
        # The least of the channels: panels go on as long as one channel has light.
        return reduce(dr.minimum, depths) < 2 * optical_reach(type(depths[0]))

    def panel(self, start: Start, depths) -> tuple[Any, Callable[[Node], list[Any]], Any]:
        """Return the end of panels as s [m], the values at a node, and the state behind them."""
        medium, rays, light = self.medium, self.rays, self.light

        def after(x):
            # Only the depth from the beginning of the panel is computed again, not that from the
            # camera.
            return [
                depth + more
                for depth, more in zip(depths, medium.optical_depth(rays, start.x, x), strict=True)
            ]

        def values(node: Node) -> list[Any]:
            # sigma_s p exp(-tau_camera - tau_light); the weight of the node holds 1/r^2.
            source = medium.source(
                rays, node.x, lambda phase: phase.evaluate_half(node.down, node.up)
            )
            return [source * medium.both_ways(rays, node.x, light, node.r, after(node.x))]

        # The medium limits the change of depths and extinction, `start` the width for the lobe.
        end = start.end(1 / medium.longest(rays, light, start.x, CHANGE))
        return end, values, after(start.foot + end)

    def gamma(self, x):
        """Return Gamma(x), the airlight from the camera to a distance [m] (Biri 2006, section 4.2).

        A difference of two Gammas carries the rounding of both: `airlight` of a segment is
        better where it can be had.
        """
        return self.airlight(type(x)(0), x)

    def source(self, x, camera: Sequence[Any] | None = None):
        """Return the integrand where the light is visible, in parts of `Medium.unit`.

        It is exp(-tau)/r^2 times `Medium.source`, times the profile of a spot or a light sample.

        Parameters
        ----------
        x
            Distances along the rays [m].
        camera
            The optical depths from the camera by channel, where they are known.
        """
        light, medium = self.light, self.medium
        # 1/r^2, or 1 for a light at infinity, whose source is not divided by r^2.
        s = x - self.geometry.foot
        square = dr.fma(s, s, dr.square(self.geometry.height)) if light.w else type(x)(1)
        inverse = dr.rsqrt(square)
        r, strength = square * inverse, dr.square(inverse)
        value = medium.source(self.rays, x, self.angle(s, r)) * medium.both_ways(
            self.rays, x, light, r, camera
        )
        # The profile of a spot or a light sample; other lights have none.
        return value * (strength * self.geometry.falloff(light, x) if light.varies else strength)

    def angle(self, s, r) -> Angle:
        """Return the angle by which light is scattered at s = x - foot and r from the light [m]."""
        # Narrow lobes need both halves of the angle: 1 - cos has lost them.
        if self.light.w:
            down, up = half_angle(s, r, dr.rcp(r), dr.square(self.geometry.height))
        else:
            # The angle between ray and light is one for a ray.
            down, up = half_angles(-self.light.axis, self.rays.direction)
        return lambda phase: phase.evaluate_half(down, up)

    def radiance(self, integral):
        """Return the radiance of an integral, as `airlight` returns it, RGB [W/(m^2 sr)]."""
        return self.medium.radiance(self.light, integral)


@dataclass(frozen=True)
class Homogeneous(Medium):
    """A homogeneous medium. One extinction for a grey medium, three for a coloured one:
    code runs once for each.
    """

    sigma_t: tuple[Any, ...]  #: extinction [1/m], one or three values
    albedo: Any
    phase: Phase

    @property
    def channels(self):
        """One, or three."""
        return len(self.sigma_t)

    @property
    def vacuum(self):
        """Whether an extinction is 0."""
        return any(float(sigma[0]) == 0 for sigma in self.sigma_t)

    def extinction(self, rays, x):
        """Return sigma_t [1/m]."""
        return self.sigma_t

    def optical_depth(self, rays, x0, x1):
        """Return sigma_t (x1 - x0) [1]."""
        return tuple(sigma_t * (x1 - x0) for sigma_t in self.sigma_t)

    def length_of(self, depth):
        """Return `depth` over the smallest extinction [m]."""
        return depth / self.least_extinction()

    def longest(self, rays, light, x, change):
        """Return `change` over twice the largest extinction [m]: the way to the light may grow as
        fast as the way to the camera.
        """
        # r grows by 1 m a metre at most, as x does.
        return change / (2 * reduce(dr.maximum, self.sigma_t))

    def depth_to_light(self, light, point, r, active=True):
        """Return sigma_t r [1]."""
        return tuple(sigma_t * r for sigma_t in self.sigma_t)

    def source(self, rays, x, angle):
        """Return the phase function [1]: the rest is the same everywhere."""
        return angle(self.phase)

    @property
    def unit(self):
        """Albedo sigma_t [1/m]."""
        return self.albedo * self.colour(self.sigma_t)

    def lit(self, rays, light, geometry, kernel=None):
        """Return rays with one light, whose integral is the kernel's."""
        return HomogeneousRays(self, light, rays, geometry, kernel)

    def thicker(self, factor):
        """Return it with the extinction times a factor."""
        # Opaque again: a frame with the other extinction runs the code that was recorded.
        return replace(
            self,
            sigma_t=tuple(dr.opaque(type(each), factor * float(each[0])) for each in self.sigma_t),
        )

    def per_extinction(self, function: Callable[[Any], Any]):
        """Return `function(sigma_t)` for a grey medium, and its three values as a
        colour for a coloured one.
        """
        return self.colour([function(sigma_t) for sigma_t in self.sigma_t])

    def least_extinction(self):
        """Return the smallest extinction of the channels [1/m]."""
        return reduce(dr.minimum, self.sigma_t)


@dataclass(frozen=True)
class HomogeneousRays(LitRays):
    """Rays in a homogeneous medium with one light: integrals are J [1/m], by the kernel."""

    def nothing(self, width):
        """Return 0 for a grey medium and otherwise black, for some rays."""
        grey = self.medium.channels == 1
        return dr.zeros(type(self.medium.sigma_t[0]) if grey else type(self.medium.albedo), width)

    def airlight(self, x0, x1):
        """Return J over the part of [x0, x1] [m] that the light's cone reaches [1/m];
        valid where the kernel is.
        """
        return self.kernel(
            self.geometry, *self.geometry.lit_segment(x0, x1), self.medium, self.light
        )


def half_angle(s, r, inverse, height_squared):
    """Return sin^2 and cos^2 of half the scattering angle, (r +- s)/(2 r), the smaller
    one without cancellation; `inverse` is 1/r.
    """
    # (r - |s|)/(2 r) with h^2 = (r - |s|) (r + |s|): no difference is taken.
    small = 0.5 * height_squared * inverse * dr.rcp(r + dr.abs(s))
    large = 1 - small
    # Behind the foot the light turns by more than a right angle: there sin^2 is the larger one.
    behind = s > 0
    return dr.select(behind, large, small), dr.select(behind, small, large)


def optical_reach(Float) -> float:
    """Return the optical depths after which a number type has nothing left of light;
    float64 takes twice as many.
    """
    return OPTICAL_REACH if is_single(Float) else 2 * OPTICAL_REACH
