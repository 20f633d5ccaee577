# SPDX-License-Identifier: BSD-3-Clause
"""Ray marching: the airlight integral by the midpoint rule, with one visibility test a step.

Two spacings of the same number of steps:

* `uniform` in the distance x, weight dx exp(-sigma_t (x + r)) p / r^2. What most shaders do; it misses the peak near
  the light. Where nothing ends the ray it stops at 20 optical depths (e^-20 = 2e-9 is left).
* `equiangular` in theta, the angle at the light; for a light at infinity these are equal steps in x. With x = foot + h
  tan theta, dx / r^2 = dtheta / h: the peak is gone and the weight is dtheta/h exp(-sigma_t (x + r)) p.

The order of convergence in the number of steps is 2 on a ray without shadows and 1 where shadow edges fall between
steps.

``sum=transitions`` is the marcher with which Billeter, Sintorn and Assarsson 2010 compare (their section 6): N samples
of the visibility alone, and the airlight "only calculated when a transition between a lit and an unlit region is
detected", as the integral up to there (their eq. 3). The paper does not say where between two samples the transition
is. With the cells [u_k, u_k+1] about the samples, u the variable of the spacing and V_k the visibility in the middle of
a cell, it is here at their border:

    J = sum_k V_k J(x_k, x_k+1) = sum over the runs of lit cells of J(x_i, x_j),     x_k = x(u_k),

for neighbouring cells that are lit add up to one integral, by the kernel. Nothing is left of the error of the
integrand, so on a ray without shadows the sum is that of the kernel with any N. A shadow edge is wrong by half a cell
at most: the order is 1. The paper starts at the farthest sample; the sum is the same from either end.
"""

from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from realtime.errors import InputError
from realtime.intervals.lit_intervals import add_waiting, close_interval, no_intervals, sum_at_end
from realtime.memory import check_memory
from realtime.methods.interface.layers import Layers
from realtime.methods.interface.light_airlight import RayAirlight, integral_type, ray_airlight
from realtime.methods.interface.marching import OPTICAL_REACH, equal_angles, marched_integral, within
from realtime.methods.interface.method import ErrorCause
from realtime.methods.interface.view import View, bounded_radiance, radiance, rays_in_media
from realtime.parameters import Parameters, parameter
from realtime.scene.medium import least_extinction
from realtime.scene.read_scene import Scene
from realtime.shadow_maps.shadow_map import ShadowMap, cast_shadow_map, lit_in_map, map_memory, map_size
from realtime.tiles.adaptive_sampling import tolerance

_DUE = 3  # in the last bits of a step's number: there an interval that has ended is integrated


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
    sum: str = parameter(
        "steps",
        "the integrand at every step, or an integral by the kernel for each run of lit steps, as Billeter 2010 marches",
        choices=("steps", "transitions"),
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
    lists
        Not used.
    kernel
        An airlight kernel for `sum=transitions`, see `realtime.kernels`; otherwise each step evaluates the integrand.
    parameters
        Values of the parameters.

    Raises
    ------
    InputError
        For uniform steps on an endless ray through a vacuum.

    References
    ----------
    Billeter, Sintorn, Assarsson 2010, section 6 (the marcher that they compare with). Kulla, Fajardo 2012, *Importance
    sampling techniques for path tracing in participating media*, section 4 (the equi-angular variable).
    """
    steps, spacing = parameters.steps, parameters.spacing
    if spacing == "uniform" and view.features.vacuum and not view.medium.clear:
        raise InputError("spacing=uniform: an endless ray through a vacuum has no step length; use spacing=equiangular")
    total = type(view.medium.albedo)(0)
    asked = kernel if parameters.sum == "transitions" else None
    in_media = rays_in_media(view, kernel=asked) if view.features.bounded else ()
    for number, light in enumerate(view.lights):
        media = in_media[number] if in_media else None
        lit = _visibility(view, state, number, parameters.shadow)
        if parameters.sum == "transitions":
            airlight = ray_airlight(view, light, kernel, media)
            total += airlight.radiance(_lit_runs(airlight, steps=steps, spacing=spacing, lit=lit))
            continue
        integral = marched_integral(view, light, media, steps=steps, spacing=spacing, lit=lit)
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
    if parameters.shadow != "map" or not scene.features.shadows:
        return lambda scene: ()
    needed = sum(map_memory(light, map) for light in scene.lights)
    check_memory(f"map: {map} texels for {len(scene.lights)} light(s)", needed, "use a smaller map")
    return lambda scene: tuple(cast_shadow_map(scene.geometry, light, map) for light in scene.lights)


def marching_errors(parameters: RayMarchParameters, size: tuple[int, int]) -> tuple[ErrorCause, ...]:
    """Return the causes of its errors, as `realtime.methods.interface.method.Method.error_causes` has them."""
    without = "shadows" if parameters.shadow == "none" else "map"
    return ("resolution", {"tolerance": 0.0}), (without, {"shadow": "ray"}), ("steps", None)


def _visibility(view: View, maps, number: int, shadow: str):
    """Return the function that says whether the light of a number reaches a point."""
    light = view.lights[number]
    if shadow == "none" or not view.features.shadows:
        return lambda point: True
    if shadow == "map":
        return lambda point: lit_in_map(maps[number], light, point)
    return lambda point: view.visible(point, light)


def _lit_runs(airlight: RayAirlight, *, steps: int, spacing: str, lit):
    """Integrate the runs of cells whose middles are lit."""
    view, light, geometry, media = airlight.view, airlight.light, airlight.geometry, airlight.media
    Float, lanes = type(view.distance), dr.width(view.distance)
    x0, x1 = airlight.segment
    if media and view.medium.clear:
        x0, x1 = within(media, x0, x1)
    elif spacing == "uniform":
        x1 = dr.minimum(x1, x0 + OPTICAL_REACH / least_extinction(view.medium))
    uniform = spacing == "uniform" or not light.w
    angles = None if uniform else equal_angles(geometry.foot, geometry.height, x0, x1)
    meets = x1 > x0  # rays that miss all bodies march on the spot, where a map can be asked
    begin = dr.select(meets, angles.begin if angles else x0, 0)
    width = dr.select(meets, ((angles.end if angles else x1) - begin) / steps, 0)

    def place(u):
        return angles.place(u) if angles else u

    def step(index, was_lit, opened, intervals):
        border = dr.select(index == 0, x0, dr.maximum(place(dr.fma(Float(index), width, begin)), x0))
        x = place(dr.fma(Float(index) + 0.5, width, begin))
        now = meets & lit(view.origin + view.direction * x)
        closes = was_lit & ~now
        intervals = add_waiting(intervals, airlight.integral, closes | ((index & _DUE) == _DUE))
        intervals = close_interval(intervals, border, closes, begin=opened)
        return index + 1, now, dr.select(now & ~was_lit, border, opened), intervals

    start = x0 + dr.zeros(Float, lanes)
    intervals = no_intervals(dr.zeros(integral_type(view), lanes), start)
    _, was_lit, opened, intervals = dr.while_loop(
        state=(mi.UInt32(0), dr.full(mi.Bool, False, lanes), +start, intervals),
        cond=lambda index, was_lit, opened, intervals: index < steps,
        body=step,
        labels=("index", "was_lit", "opened", "intervals"),
    )
    return sum_at_end(intervals, airlight.integral, x1, opened=opened, lit=was_lit, active=meets)
