# SPDX-License-Identifier: BSD-3-Clause
"""The midpoint rule along rays, which marchers share, and the airlight integral of one light by it.

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
from realtime.methods.interface.light_airlight import RayAirlight
from realtime.rays.ray_light import distance_to_light, falloff
from realtime.scene.medium import OPTICAL_REACH, Medium, least_extinction, per_extinction

_LEAST_HEIGHT = 2.0**-10  # h over g, of the docstring


@dataclass(frozen=True)
class Steps:
    """Equal steps of a variable u along every ray: the distance itself, or the angle at a light."""

    x0: Any  #: where the first begins [m]
    x1: Any  #: where the last ends [m]
    begin: Any  #: u where the first begins
    width: Any  #: of a step, 0 where a ray has none
    foot: Any = None  #: of the light over the ray [m]; None: u is the distance
    height: Any = None  #: h [m]

    def place(self, u: Any) -> Any:
        """Return x [m]."""
        return u if self.foot is None else dr.fma(self.height, dr.tan(u), self.foot)

    def stretch(self, x: Any) -> Any:
        """Return dx/du [m]."""
        if self.foot is None:
            return 1
        return dr.fma(self.height, self.height, dr.square(x - self.foot)) / self.height


def steps_between(x0: Any, x1: Any, steps: int, light: tuple[Any, Any] | None = None, asked: Any = True) -> Steps:
    """Return equal steps from `x0` to `x1` [m].

    `light` is the foot [m] and the height [m] of one at whose angle the steps are to be equal; then `x1` may be
    infinite. Rays that are not `asked` stay on the spot.
    """
    if light is None:
        begin, end, place = x0, x1, (None, None)
    else:
        foot, height = light
        gap = dr.maximum(dr.maximum(x0 - foot, foot - x1), 0)
        height = dr.maximum(height, _LEAST_HEIGHT * gap)
        end = dr.select(dr.isfinite(x1), dr.atan2(x1 - foot, height), 0.5 * dr.pi)
        begin, place = dr.atan2(x0 - foot, height), (foot, height)
    walks = asked & (x1 > x0)
    return Steps(x0, x1, dr.select(walks, begin, 0), dr.select(walks, (end - begin) / steps, 0), *place)


def midpoint_sum(steps: Steps, count: int, zero: Any, sample: Callable[[Any], Any], shift: Any = 0.5) -> Any:
    """Return the sum of `sample(x)` dx over the steps of every ray, in one loop: the kernel does not grow with them.

    Parameters
    ----------
    steps, count
        The steps, and how many.
    zero
        The sum of nothing, one for each ray.
    sample
        The integrand at distances [m].
    shift
        Where in a step it is asked, from 0 to 1.
    """
    Float = type(steps.width)

    def step(index, total):
        x = steps.place(dr.fma(Float(index) + shift, steps.width, steps.begin))
        return index + 1, total + sample(x) * steps.stretch(x)

    _, total = dr.while_loop(
        state=(mi.UInt32(0), zero + dr.zeros(Float, dr.width(steps.width))),
        cond=lambda index, total: index < count,
        body=step,
        labels=("index", "total"),
    )
    return total * steps.width


def optical_end(medium: Medium, x0: Any, x1: Any) -> Any:
    """Return where uniform steps from `x0` to `x1` [m] stop."""
    return dr.minimum(x1, x0 + OPTICAL_REACH / least_extinction(medium))


def marched_integral(airlight: RayAirlight, *, steps: int, spacing: str, lit: Callable[[Any], Any]) -> Any:
    """Return the airlight integral of a light along every ray by midpoint steps.

    Parameters
    ----------
    airlight
        The rays and the light.
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
    view, light, geometry, media = airlight.view, airlight.light, airlight.geometry, airlight.media
    medium = view.medium
    between = marched_steps(airlight, steps, spacing)

    def sample(x):
        reached = (between.width > 0) & lit(view.origin + view.direction * x)
        if media and not light.w:
            return dr.select(reached, media.source(x), 0)
        r = distance_to_light(geometry, x)
        weight = dr.rcp(dr.square(r))
        if media:
            return dr.select(reached, weight * media.source(x), 0)
        weight *= medium.phase.evaluate((geometry.foot - x) / r)
        if light.varies:
            weight *= falloff(geometry, light, x)
        return dr.select(reached, per_extinction(medium, lambda sigma_t: weight * dr.exp(-sigma_t * (x + r))), 0)

    zero = type(view.distance)(0) if len(medium.sigma_t) == 1 and not media else type(medium.albedo)(0)
    return midpoint_sum(between, steps, zero, sample)


def marched_steps(airlight: RayAirlight, steps: int, spacing: str) -> Steps:
    """Return the steps of rays where a light could reach them and something scatters."""
    view, media = airlight.view, airlight.media
    x0, x1 = airlight.segment if airlight.light.w else (type(view.distance)(0), view.distance)
    if spacing == "uniform" and not view.medium.clear:
        x1 = optical_end(view.medium, x0, x1)
    if media and view.medium.clear:
        x0, x1 = within(media, x0, x1)
    at_light = None
    if spacing == "equiangular" and airlight.light.w:
        at_light = airlight.geometry.foot, airlight.geometry.height
    return steps_between(x0, x1, steps, at_light)


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
