# SPDX-License-Identifier: BSD-3-Clause
"""Ray marching: the airlight integral by the midpoint rule, with one visibility test a step.

Two spacings of the same number of steps:

* `uniform` in the distance x, weight dx exp(-sigma_t (x + r)) p / r^2. What most shaders do; it misses the peak near
  the light. Where nothing ends the ray it stops at 20 optical depths (e^-20 = 2e-9 is left).
* `equiangular` in theta, the angle at the light; for a light at infinity these are equal steps in x. With x = foot + h
  tan theta, dx / r^2 = dtheta / h: the peak is gone and the weight is dtheta/h exp(-sigma_t (x + r)) p.

The order of convergence in the number of steps is 2 on a ray without shadows and 1 where shadow edges fall between
steps.
"""

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from realtime.bounded_media.airlight import LitRay
from realtime.errors import InputError
from realtime.memory import check_memory
from realtime.methods.interface.layers import Layers
from realtime.methods.interface.view import View, bounded_radiance, radiance, rays_in_media
from realtime.parameters import Parameters, parameter
from realtime.rays.ray_light import RayGeometry, distance_to_light, falloff, ray_geometry
from realtime.scene.lights import Light
from realtime.scene.medium import least_extinction, per_extinction
from realtime.scene.read_scene import Scene
from realtime.shadow_maps.shadow_map import ShadowMap, cast_shadow_map, lit_in_map, map_memory, map_size
from realtime.tiles.adaptive_sampling import tolerance

_OPTICAL_REACH = 20.0


@dataclass(frozen=True)
class RayMarchParameters(Parameters):
    """The parameters of ray marching."""

    steps: int = parameter(100, "steps of every ray and light", least=1)
    spacing: str = parameter(
        "equiangular", "in the angle at the light, or in the distance", choices=("equiangular", "uniform")
    )
    shadow: str = parameter(
        "ray", "a shadow ray a step, a look-up in a shadow map, or no shadows", choices=("ray", "map", "none")
    )
    map: int = map_size(512, "texels on a side of a face of the map, with `shadow=map`")
    tolerance: float = tolerance()


def ray_march(view: View, state, lists, *, kernel, parameters: RayMarchParameters) -> Layers:
    """Return the airlight of every ray by marching [W/(m^2 sr)].

    Parameters
    ----------
    view
        The frame.
    state
        From `prepare_maps`.
    lists, kernel
        Not used: each step evaluates the integrand itself.
    parameters
        Values of the parameters.

    Raises
    ------
    InputError
        For uniform steps on an endless ray through a vacuum.

    References
    ----------
    Billeter, Sintorn, Assarsson 2010, section 2 (the marcher that they compare with). Kulla, Fajardo 2012, *Importance
    sampling techniques for path tracing in participating media*, section 4 (the equi-angular variable).
    """
    steps, spacing = parameters.steps, parameters.spacing
    if spacing == "uniform" and view.features.vacuum and not view.medium.clear:
        raise InputError("spacing=uniform: an endless ray through a vacuum has no step length; use spacing=equiangular")
    total = type(view.medium.albedo)(0)
    in_media = rays_in_media(view) if view.features.bounded else ()
    for number, light in enumerate(view.lights):
        x0, x1 = type(view.distance)(0), view.distance
        media = in_media[number] if in_media else None
        if media and not light.w:
            lit = _visibility(view, state, number, parameters.shadow)
            integral = _march_parallel(view, media, _within(media, x0, x1), steps=steps, lit=lit)
            total += bounded_radiance(light, integral)
            continue
        geometry = ray_geometry(view.origin, view.direction, light, low=view.direction_low)
        x0, x1 = geometry.lit_segment(x0, x1)
        if spacing == "uniform" and not view.medium.clear:
            x1 = dr.minimum(x1, x0 + _OPTICAL_REACH / least_extinction(view.medium))
        if media and view.medium.clear:
            x0, x1 = _within(media, x0, x1)
        lit = _visibility(view, state, number, parameters.shadow)
        integral = _march(view, light, geometry, (x0, x1), steps=steps, spacing=spacing, lit=lit, media=media)
        total += bounded_radiance(light, integral) if media else radiance(view.medium, light, integral)
    return Layers(total)


def prepare_maps(scene: Scene, parameters: RayMarchParameters) -> Callable[[Scene], tuple[ShadowMap, ...]]:
    """Return the function that casts a shadow map for every light of a frame, if they are asked for.

    Raises
    ------
    InputError
        If the maps need more memory than the machine has.
    """
    map = parameters.map
    if parameters.shadow != "map":
        return lambda scene: ()
    needed = sum(map_memory(light, map) for light in scene.lights)
    check_memory(f"map: {map} texels for {len(scene.lights)} light(s)", needed, "use a smaller map")
    return lambda scene: tuple(cast_shadow_map(scene.geometry, light, map) for light in scene.lights)


def _visibility(view: View, maps, number: int, shadow: str):
    """Return the function that says whether the light of a number reaches a point."""
    light = view.lights[number]
    if shadow == "none" or not view.features.shadows:
        return lambda point: True
    if shadow == "map":
        return lambda point: lit_in_map(maps[number], light, point)
    return lambda point: view.visible(point, light)


def _within(media: LitRay, x0, x1):
    """Return the part of a segment from the first to the last bounded medium."""
    first, last = x1, x0
    for piece in media.pieces:
        first = dr.minimum(first, piece.begin)
        last = dr.maximum(last, dr.select(dr.isfinite(piece.begin), piece.end, x0))
    return dr.maximum(first, x0), dr.minimum(last, x1)


def _march(
    view: View, light: Light, geometry: RayGeometry, segment, *, steps: int, spacing: str, lit, media: LitRay | None
):
    """Sum the steps of every ray in one loop, so that the kernel does not grow with their number."""
    x0, x1 = segment
    Float = type(geometry.height)
    foot, height, medium = geometry.foot, geometry.height, view.medium
    theta0 = dr.atan2(x0 - foot, height)
    theta1 = dr.select(dr.isfinite(x1), dr.atan2(x1 - foot, height), 0.5 * dr.pi)
    begin, end = (x0, x1) if spacing == "uniform" else (theta0, theta1)
    width = (end - begin) / steps

    def step(index, total):
        u = dr.fma(Float(index) + 0.5, width, begin)
        x = u if spacing == "uniform" else dr.fma(height, dr.tan(u), foot)
        r = distance_to_light(geometry, x)
        weight = dr.rcp(dr.square(r)) if spacing == "uniform" else dr.rcp(height)
        point = view.origin + view.direction * x
        if media:
            term = weight * media.source(x)
            return index + 1, total + dr.select((width > 0) & lit(point), term, 0)
        weight *= medium.phase.evaluate((foot - x) / r)
        if light.soft:
            weight *= falloff(geometry, light, x)
        term = per_extinction(medium, lambda sigma_t: weight * dr.exp(-sigma_t * (x + r)))
        return index + 1, total + dr.select((width > 0) & lit(point), term, 0)

    total = Float(0) if len(medium.sigma_t) == 1 and not media else type(medium.albedo)(0)
    _, total = dr.while_loop(
        state=(mi.UInt32(0), total + dr.zeros(Float, dr.width(width))),
        cond=lambda index, total: index < steps,
        body=step,
        labels=("index", "total"),
    )
    return total * width


def _march_parallel(view: View, media: LitRay, segment, *, steps: int, lit):
    """Sum equal steps of every ray under a directional light; see `_march`."""
    x0, x1 = segment
    Float = type(view.distance)
    # Rays that miss all bounded media take steps of length 0: a map has no place for points at infinity.
    meets = x1 > x0
    x0, width = dr.select(meets, x0, 0), dr.select(meets, (x1 - x0) / steps, 0)

    def step(index, total):
        x = dr.fma(Float(index) + 0.5, width, x0)
        reached = (width > 0) & lit(view.origin + view.direction * x)
        return index + 1, total + dr.select(reached, media.source(x), 0)

    _, total = dr.while_loop(
        state=(mi.UInt32(0), type(view.medium.albedo)(0) + dr.zeros(Float, dr.width(width))),
        cond=lambda index, total: index < steps,
        body=step,
        labels=("index", "total"),
    )
    return total * width
