# SPDX-License-Identifier: BSD-3-Clause
"""The airlight integral of one light by the midpoint rule, with one visibility test a step: what marchers sum up.

Where nothing ends uniform steps, they stop at 20 optical depths, where e^-20 = 2e-9 is left.

Equi-angular steps are a change of variables, for any h > 0:

    x = foot + h tan theta,    dx/r^2 = (h^2 + (x - foot)^2) / (h r^2) dtheta,    r^2 = height^2 + (x - foot)^2.

With h = height the weight is 1/h, and the peak is gone. A ray that leads straight away from the light has height 0, and
all its angles are pi/2; next to it the angles differ by less than their rounding. But where the light stands before or
behind the whole segment, at the distance g, there is no peak that h = height must take away: h is then at least g/1024.
The angles of the segment differ by about h/g, which float32 resolves to 1e-4. As h/g goes to 0 the steps are equal in
1/r, the limit of equal angles.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.bounded_media.airlight import MediaRay
from realtime.methods.interface.view import View
from realtime.rays.ray_light import RayGeometry, distance_to_light, falloff, ray_geometry
from realtime.scene.lights import Light
from realtime.scene.medium import OPTICAL_REACH, least_extinction, per_extinction

_LEAST_HEIGHT = 2.0**-10  # h over g, of the docstring


@dataclass(frozen=True)
class EqualAngles:
    """A segment of every ray in the angle at a light."""

    foot: Any  #: of the light over the ray [m]
    height: Any  #: h [m]
    begin: Any  #: theta where the segment begins
    end: Any  #: theta where it ends

    def place(self, theta: Any) -> Any:
        """Return x [m]."""
        return dr.fma(self.height, dr.tan(theta), self.foot)

    def stretch(self, x: Any) -> Any:
        """Return dx/dtheta [m]."""
        return dr.fma(self.height, self.height, dr.square(x - self.foot)) / self.height


def equal_angles(foot: Any, height: Any, x0: Any, x1: Any) -> EqualAngles:
    """Return segments from `x0` to `x1` [m], which may be infinite, in the angle at a light."""
    gap = dr.maximum(dr.maximum(x0 - foot, foot - x1), 0)
    height = dr.maximum(height, _LEAST_HEIGHT * gap)
    end = dr.select(dr.isfinite(x1), dr.atan2(x1 - foot, height), 0.5 * dr.pi)
    return EqualAngles(foot, height, dr.atan2(x0 - foot, height), end)


def marched_integral(
    view: View, light: Light, media: MediaRay | None, *, steps: int, spacing: str, lit: Callable[[Any], Any]
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


def within(media: MediaRay, x0, x1) -> tuple[Any, Any]:
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
    view: View, light: Light, geometry: RayGeometry, segment, *, steps: int, spacing: str, lit, media: MediaRay | None
):
    """Sum the steps of every ray in one loop, so that the kernel does not grow with their number."""
    x0, x1 = segment
    Float = type(geometry.height)
    foot, medium = geometry.foot, view.medium
    angles = None if spacing == "uniform" else equal_angles(foot, geometry.height, x0, x1)
    begin, end = (angles.begin, angles.end) if angles else (x0, x1)
    width = (end - begin) / steps

    def step(index, total):
        u = dr.fma(Float(index) + 0.5, width, begin)
        x = angles.place(u) if angles else u
        r = distance_to_light(geometry, x)
        weight = dr.rcp(dr.square(r))
        if angles:
            weight *= angles.stretch(x)
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


def _march_parallel(view: View, media: MediaRay, segment, *, steps: int, lit):
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
