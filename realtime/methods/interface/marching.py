# SPDX-License-Identifier: BSD-3-Clause
"""The airlight integral of one light by the midpoint rule, with one visibility test a step: what marchers sum up.

Where nothing ends uniform steps, they stop at 20 optical depths, where e^-20 = 2e-9 is left.
"""

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.bounded_media.airlight import LitRay
from realtime.methods.interface.view import View
from realtime.rays.ray_light import RayGeometry, distance_to_light, falloff, ray_geometry
from realtime.scene.lights import Light
from realtime.scene.medium import least_extinction, per_extinction

OPTICAL_REACH = 20.0  #: where endless uniform steps stop [1]


def marched_integral(
    view: View, light: Light, media: LitRay | None, *, steps: int, spacing: str, lit: Callable[[Any], Any]
) -> Any:
    """Return the airlight integral of a light along every ray by midpoint steps.

    Parameters
    ----------
    view
        The rays.
    light
        Any light.
    media
        The rays in bounded media; None where there are none.
    steps
        Of every ray.
    spacing
        'equiangular' in the angle at the light, or 'uniform' in the distance; for a light at infinity both are uniform.
    lit
        Says whether the light reaches points [m].

    Returns
    -------
    integral
        J [1/m]; in bounded media albedo sigma_t J [1/m^2].
    """
    x0, x1 = type(view.distance)(0), view.distance
    if media and not light.w:
        return _march_parallel(view, media, within(media, x0, x1), steps=steps, lit=lit)
    geometry = ray_geometry(view.origin, view.direction, light, low=view.direction_low)
    x0, x1 = geometry.lit_segment(x0, x1)
    if spacing == "uniform" and not view.medium.clear:
        x1 = dr.minimum(x1, x0 + OPTICAL_REACH / least_extinction(view.medium))
    if media and view.medium.clear:
        x0, x1 = within(media, x0, x1)
    return _march(view, light, geometry, (x0, x1), steps=steps, spacing=spacing, lit=lit, media=media)


def within(media: LitRay, x0, x1) -> tuple[Any, Any]:
    """Return the part of a segment [m] from the first to the last bounded medium; 0 and 0 where a ray meets none.

    An endless ray that meets none would begin at infinity, where a map has no place and a step no length.
    """
    first, last = x1, x0
    for piece in media.pieces:
        first = dr.minimum(first, piece.begin)
        last = dr.maximum(last, dr.select(dr.isfinite(piece.begin), piece.end, x0))
    begin, end = dr.maximum(first, x0), dr.minimum(last, x1)
    meets = end > begin
    return dr.select(meets, begin, 0), dr.select(meets, end, 0)


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
        if light.varies:
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
    width = (x1 - x0) / steps

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
