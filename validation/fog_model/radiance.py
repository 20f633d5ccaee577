# SPDX-License-Identifier: BSD-3-Clause
"""The radiance of every pixel from its paths, in Dr.Jit: derivatives by all that describes the fog in forward mode.

With the lengths c_k to the camera and l_k to the light in the medium k, a node in the medium m adds

    albedo_m sigma_m I p_m(cos) / (4 pi)  weight / r^2  exp(-sum_k sigma_k (a c_k + b l_k)),

a and b the shares of the extinction that dim either leg, 1 by right. A surface point adds its radiance times the same
exponential. Visibility is held: no derivative moves an edge of a shadow. Where a light is moved by d from where the
paths begin, a node at r v from it (v of unit length, w along the ray) has

    r' = |r v - d|,    cos = -(r v - d) . w / r',

and the lengths of its leg change as r'/r, which is right where the medium has no bounds.
"""

from dataclasses import dataclass, fields, replace
from functools import reduce
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from validation.fog_model.fog import Colour, Fog
from validation.fog_model.paths import LightPaths, Nodes, ScatteringPaths, SurfacePoints

Array = NDArray[np.float64]

Columns = tuple[Any, Any, Any]  # red, green, blue of all pixels


@dataclass(frozen=True)
class _Legs:
    """The legs of nodes or surface points of a light, on the device."""

    pixel: Any
    r: Any
    camera: tuple[Any, ...]
    leg: tuple[Any, ...]
    towards: Any
    direction: Any  # of the rays
    slant: Any  # length of a ray over that along the camera's axis


@dataclass(frozen=True)
class _DeviceLight:
    intensity: Colour
    nodes: _Legs
    surface: _Legs
    medium: Any
    cosine: Any
    strength: Any  # weight/(4 pi)
    phases: tuple[Any, ...]  # by medium, the values of the scene's own phase function at all nodes
    reflected: Columns


@dataclass(frozen=True)
class DevicePaths:
    """The paths of an image on the device."""

    pixels: int
    share: float  #: of a pixel that a ray stands for
    lights: tuple[_DeviceLight, ...]

    @property
    def nodes(self) -> int:
        """How many nodes and surface points there are."""
        return sum(dr.width(part.pixel) for light in self.lights for part in (light.nodes, light.surface))


def on_device(paths: ScatteringPaths) -> DevicePaths:
    """Return paths as Dr.Jit arrays in float64."""
    lights = tuple(_device_light(paths, light) for light in paths.lights)
    return DevicePaths(len(paths.pixels), 1 / paths.rays_per_pixel, lights)


def _device_light(paths: ScatteringPaths, light: LightPaths) -> _DeviceLight:
    nodes, surface = light.nodes, light.surface
    red, green, blue = (float(value) for value in light.intensity)
    phases = tuple(
        mi.Float64(1.0) if medium.phase.is_constant else mi.Float64(medium.phase(np.clip(nodes.cosine, -1, 1)))
        for medium in paths.media
    )
    device = _DeviceLight(
        (red, green, blue),
        _legs(paths, nodes),
        _legs(paths, surface),
        mi.UInt32(nodes.medium.astype(np.uint32)),
        mi.Float64(nodes.cosine),
        mi.Float64(nodes.weight / (4 * np.pi)),
        phases,
        tuple(mi.Float64(np.ascontiguousarray(column)) for column in surface.radiance.T),
    )
    dr.eval(device.medium, device.cosine, device.strength, device.phases, device.reflected)
    return device


def _legs(paths: ScatteringPaths, points: Nodes | SurfacePoints) -> _Legs:
    camera, leg = (
        tuple(mi.Float64(np.ascontiguousarray(column)) for column in part.T) for part in (points.camera, points.leg)
    )
    legs = _Legs(
        mi.UInt32(paths.ray_pixel[points.ray].astype(np.uint32)),
        mi.Float64(points.r),
        camera,
        leg,
        mi.Vector3d(points.towards.T),
        mi.Vector3d(paths.direction[points.ray].T),
        mi.Float64(1 / (paths.direction[points.ray] @ paths.axis)),
    )
    dr.eval(legs.pixel, legs.r, legs.camera, legs.leg, legs.towards, legs.direction, legs.slant)
    return legs


def fog_airlight(paths: DevicePaths, fog: Fog) -> Columns:
    """Return the in-scattered radiance of every pixel by channel [W/(m^2 sr)]."""
    return _sums(paths, fog, lambda light: light.nodes, _airlight)


def fog_surface(paths: DevicePaths, fog: Fog) -> Columns:
    """Return the radiance of the lit surfaces of every pixel by channel [W/(m^2 sr)]."""
    return _sums(paths, fog, lambda light: light.surface, _surface)


def fog_total(paths: DevicePaths, fog: Fog) -> Columns:
    """Return the sum of both."""
    airlight, surface = fog_airlight(paths, fog), fog_surface(paths, fog)
    red, green, blue = (a + s for a, s in zip(airlight, surface, strict=True))
    return red, green, blue


def as_array(columns: Columns) -> Array:
    """Return the channels as an array, (pixels, 3)."""
    return np.stack([np.array(column, dtype=np.float64) for column in columns], axis=1)


def opaque_fog(fog: Fog) -> Fog:
    """Return a fog whose numbers are no constants of the kernels, which then need not be compiled again for others."""

    def opaque(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(opaque(each) for each in value)
        return dr.opaque(mi.Float64, value) if isinstance(value, (int, float)) else value

    kept: dict[str, Any] = {"near": fog.near} if _begins(fog) else {}
    if _is_right(fog):
        kept["distance_power"] = fog.distance_power
    moved = tuple(each if _stands(each) else opaque(each) for each in fog.moved)
    numbers = {field.name: opaque(getattr(fog, field.name)) for field in fields(fog) if field.name not in kept}
    return replace(fog, **{**numbers, **kept, "moved": moved})


def _sums(paths: DevicePaths, fog: Fog, pick: Any, term: Any) -> Columns:
    totals = []
    for channel in range(3):
        total = dr.zeros(mi.Float64, paths.pixels)
        for number, light in enumerate(paths.lights):
            legs = pick(light)
            if dr.width(legs.pixel):
                factor = light.intensity[channel] * paths.share * fog.intensity[number] * fog.exposure[channel]
                dr.scatter_reduce(dr.ReduceOp.Add, total, term(light, fog, number, channel) * factor, legs.pixel)
        totals.append(total)
    red, green, blue = totals
    return red, green, blue


def _airlight(light: _DeviceLight, fog: Fog, number: int, channel: int) -> Any:
    place = _moved(light.nodes, fog.moved[number])
    cosine = light.cosine if place is None else -dr.dot(place.away, light.nodes.direction) / place.r
    values = []
    for sigma_t, albedo, g, own in zip(fog.sigma_t, fog.albedo, fog.g, light.phases, strict=True):
        phase = own if g is None else _henyey_greenstein(g, cosine)
        values.append(albedo[channel] * sigma_t[channel] * phase)
    source = values[0]
    for medium, value in enumerate(values[1:], start=1):
        source = dr.select(light.medium == medium, value, source)
    r = light.nodes.r if place is None else place.r
    falls = dr.rcp(dr.square(r)) if _is_right(fog) else dr.exp(-fog.distance_power * dr.log(r))
    strength = light.strength if _begins(fog) else light.strength * _behind_near(light.nodes, fog)
    return source * strength * falls * _dimmed(light.nodes, fog, channel, place)


def _behind_near(nodes: _Legs, fog: Fog) -> Any:
    return dr.select(nodes.camera[0] >= fog.near * nodes.slant, 1.0, 0.0)


def _surface(light: _DeviceLight, fog: Fog, number: int, channel: int) -> Any:
    place = _moved(light.surface, fog.moved[number])
    value = light.reflected[channel] * _dimmed(light.surface, fog, channel, place)
    if place is not None:
        value = value * dr.square(light.surface.r / place.r)
    return value if _is_right(fog) else value * dr.exp((2.0 - fog.distance_power) * dr.log(light.surface.r))


@dataclass(frozen=True)
class _Place:
    away: Any  # from the moved light
    r: Any


def _moved(legs: _Legs, moved: Colour) -> _Place | None:
    if _stands(moved):
        return None
    away = legs.towards * legs.r - mi.Vector3d(*moved)
    return _Place(away, dr.norm(away))


def _stands(moved: Colour) -> bool:
    """Return whether a light is where its paths begin."""
    return all(isinstance(each, float) and each == 0 for each in moved)


def _begins(fog: Fog) -> bool:
    """Return whether the medium begins at the camera."""
    return isinstance(fog.near, float) and fog.near == 0


def _is_right(fog: Fog) -> bool:
    return isinstance(fog.distance_power, float) and fog.distance_power == 2.0


def _dimmed(legs: _Legs, fog: Fog, channel: int, place: _Place | None) -> Any:
    """Return the share of the light that both legs leave."""
    longer = 1.0 if place is None else place.r / legs.r
    camera_legs = list(legs.camera)
    if not _begins(fog):
        camera_legs[0] = dr.maximum(camera_legs[0] - fog.near * legs.slant, 0)
    parts = [
        sigma_t[channel] * (fog.camera_leg * camera + fog.light_leg * leg * longer)
        for sigma_t, camera, leg in zip(fog.sigma_t, camera_legs, legs.leg, strict=True)
    ]
    return dr.exp(-reduce(lambda a, b: a + b, parts))


def _henyey_greenstein(g: Any, cosine: Any) -> Any:
    base = 1 + g * g - 2 * g * cosine
    return (1 - g * g) / (base * dr.sqrt(base))
