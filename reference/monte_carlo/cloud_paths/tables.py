# SPDX-License-Identifier: BSD-3-Clause
"""A scene of clouds as arrays that the walk gathers from: media by number, suns, phase functions.

Medium 0 is vacuum, and as the kind of a shape it means an opaque one; the clouds count from 1.
"""

from dataclasses import dataclass
from typing import TypeVar

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.reference.monte_carlo.cloud_paths.phases import WalkPhase, walk_phase
from airlight.reference.scene.clouds import CloudDensity, CloudScene

Three = tuple[float, float, float]
Value = TypeVar("Value")  #: a vector or a colour in each lane


@dataclass(frozen=True)
class WalkSun:
    """A sun as the walk reads it."""

    towards: Three  #: unit vector to it
    irradiance: Three  #: RGB, over the probability [W/m^2]
    probability: float  #: that it is the one that is drawn


@dataclass(frozen=True)
class WalkScene:
    """The scene as the walk reads it, with one extinction for each medium."""

    scene: "mi.Scene"
    camera_medium: int  #: number of the medium that the camera is in
    kinds: "mi.UInt32"  #: number of the medium within a shape, by Mitsuba's number of the shape
    sigma_t: "mi.Float"  #: by medium [1/m]
    albedo: "mi.Float"  #: by medium, three numbers for each
    phases: tuple[WalkPhase, ...]  #: each once
    phase_of: "mi.UInt32"  #: which of `phases`, by medium
    sky: Three  #: radiance, RGB [W/(m^2 sr)]
    suns: tuple[WalkSun, ...]
    has_surfaces: bool
    beyond: float  #: how far past a crossing the next ray starts [m]
    #: of the media that have a density: the number of the medium, and the density
    densities: tuple[tuple[int, CloudDensity], ...] = ()

    @property
    def has_suns(self) -> bool:
        """Whether there are suns."""
        return bool(self.suns)

    @property
    def has_sky(self) -> bool:
        """Whether the sky shines."""
        return any(value > 0 for value in self.sky)

    def density(self, medium: "mi.UInt32", point: "mi.Point3f", active: "mi.Bool") -> "mi.Float":
        """Return the extinction at places in media over the largest extinction of the medium."""
        rho = mi.Float(1)
        for number, density in self.densities:
            in_medium = active & (medium == number)
            rho = dr.select(in_medium, density.at(point, in_medium), rho)
        return rho

    def uneven(self, medium: "mi.UInt32") -> "mi.Bool":
        """Return which media have a density."""
        has_one = mi.Bool(False)
        for number, _ in self.densities:
            has_one |= medium == number
        return has_one

    def random_sun(self, sampler: "mi.Sampler", active: "mi.Bool") -> "mi.UInt32":
        """Return the number of a sun, drawn by irradiance."""
        if len(self.suns) < 2:
            return mi.UInt32(0)
        # The number of suns whose cumulated probabilities are not above u.
        u, number, below = sampler.next_1d(active), mi.UInt32(0), 0.0
        for sun in self.suns[:-1]:
            below += sun.probability
            number += dr.select(u >= below, mi.UInt32(1), mi.UInt32(0))
        return number

    def to_sun(self, number: "mi.UInt32") -> "mi.Vector3f":
        """Return the direction to a sun, 0 without suns."""
        return _chosen(number, [mi.Vector3f(sun.towards) for sun in self.suns] or [mi.Vector3f(0)])

    def irradiance(self, number: "mi.UInt32") -> "mi.Color3f":
        """Return the irradiance of a sun over its probability [W/m^2], 0 without suns."""
        return _chosen(number, [mi.Color3f(sun.irradiance) for sun in self.suns] or [mi.Color3f(0)])

    def phase_value(
        self,
        medium: "mi.UInt32",
        first: "mi.Vector3f",
        second: "mi.Vector3f",
        active: "mi.Bool",
    ) -> "mi.Float":
        """Return the phase function of a medium between two directions [1/sr]."""
        down, up = 0.25 * dr.squared_norm(first - second), 0.25 * dr.squared_norm(first + second)
        value = self.phases[0].value(down, up)
        if len(self.phases) > 1:
            number = dr.gather(mi.UInt32, self.phase_of, medium, active)
            for place, phase in enumerate(self.phases[1:], 1):
                value = dr.select(number == place, phase.value(down, up), value)
        return value / (4 * np.pi)

    def phase_about_suns(
        self, medium: "mi.UInt32", direction: "mi.Vector3f", active: "mi.Bool"
    ) -> "mi.Float":
        """Return the density of directions drawn about suns [1/sr]."""
        density = mi.Float(0)
        for sun in self.suns:
            density += sun.probability * self.phase_value(
                medium, mi.Vector3f(sun.towards), direction, active
            )
        return density

    def scattered(
        self,
        medium: "mi.UInt32",
        about: "mi.Vector3f",
        sampler: "mi.Sampler",
        active: "mi.Bool",
    ) -> "mi.Vector3f":
        """Return a random direction by the phase function of a medium about a direction."""
        down = self.phases[0].down(sampler, active)
        if len(self.phases) > 1:
            number = dr.gather(mi.UInt32, self.phase_of, medium, active)
            for place, phase in enumerate(self.phases[1:], 1):
                down = dr.select(number == place, phase.down(sampler, active), down)
        # down = sin^2(angle/2): the sine of the angle is 2 sqrt(down (1 - down)), its cosine 1 - 2
        # down.
        sine, azimuth = 2 * dr.sqrt(down * (1 - down)), 2 * dr.pi * sampler.next_1d(active)
        across, along = dr.sincos(azimuth)
        s, t = mi.coordinate_system(about)
        return dr.normalize(
            dr.fma(s, sine * along, dr.fma(t, sine * across, about * (1 - 2 * down)))
        )


def _chosen(number: "mi.UInt32", values: list[Value]) -> Value:
    """Return the value of a number in each lane."""
    chosen = values[0]
    for place, value in enumerate(values[1:], 1):
        chosen = dr.select(number == place, value, chosen)
    return chosen


def _numbers(values: NDArray[np.float64]) -> Three:
    first, second, third = values.tolist()
    return first, second, third


def walk_scene(clouds: CloudScene, channel: int) -> WalkScene:
    """Return the scene for the walk, with the extinctions of one channel."""
    # Mitsuba numbers all shapes of a program. A table by that number has the number of the cloud
    # that a shape bounds, from 1 on, or 0 for an opaque shape.
    numbers = {
        int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(each.shape))[0]): n
        for n, each in enumerate(clouds.clouds, 1)
    }
    last = max(
        int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0])
        for shape in clouds.bodies.shapes()
    )
    kinds = np.zeros(last + 1, dtype=np.uint32)
    kinds[list(numbers)] = list(numbers.values())
    functions = list(dict.fromkeys(each.phase for each in clouds.clouds))
    # Suns are drawn by irradiance, and count with irradiance over probability.
    power = np.array([sun.irradiance.sum() for sun in clouds.suns])
    suns = []
    for sun, fraction in zip(clouds.suns, power / power.sum() if len(power) else [], strict=True):
        if fraction > 0:
            irradiance = _numbers(sun.irradiance / fraction)
            suns.append(WalkSun(_numbers(-sun.direction), irradiance, float(fraction)))
    # The next ray starts 4e-7 of the largest coordinate past a crossing, a few roundings of
    # float32.
    reach = max(
        np.abs(np.array(clouds.bodies.bbox().min)).max(),
        np.abs(np.array(clouds.bodies.bbox().max)).max(),
    )
    return WalkScene(
        scene=clouds.bodies,
        camera_medium=clouds.camera_cloud + 1,
        kinds=mi.UInt32(kinds),
        sigma_t=mi.Float([0.0, *(float(each.sigma_t[channel]) for each in clouds.clouds)]),
        albedo=mi.Float(np.concatenate([np.ones(3), *(each.albedo for each in clouds.clouds)])),
        phases=tuple(walk_phase(function) for function in functions),
        phase_of=mi.UInt32([0, *(functions.index(each.phase) for each in clouds.clouds)]),
        sky=_numbers(clouds.sky),
        suns=tuple(suns),
        has_surfaces=bool(clouds.occluders.shapes()),
        beyond=4e-7 * max(float(reach), float(np.abs(clouds.origin).max())),
        densities=tuple(
            (n, each.density) for n, each in enumerate(clouds.clouds, 1) if each.density is not None
        ),
    )
