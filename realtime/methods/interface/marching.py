# SPDX-License-Identifier: BSD-3-Clause
"""The midpoint rule along rays, which marchers share, and the airlight integral of one light by it.

Where nothing ends uniform steps, they stop at 20 optical depths, where e^-20 = 2e-9 is left.

Equi-angular steps are a change of variables, for any h > 0:

    x = foot + h tan theta,    dx/r^2 = (h^2 + (x - foot)^2) / (h r^2) dtheta,    r^2 = height^2 + (x - foot)^2.

With h = height the weight is 1/h, and the peak is gone. A ray that leads straight away from the
light has height 0, and all its angles are pi/2; next to it the angles differ by less than their
rounding. But where the light stands before or behind the whole segment, at the distance g, there is
no peak that h = height must take away: h is then at least g/1024. The angles of the segment differ
by about h/g, which float32 resolves to 1e-4. As h/g goes to 0 the steps are equal in 1/r, the limit
of equal angles.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.scene.media.medium import LitRays


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


def steps_between(x0: Any, x1: Any, steps: int, light: tuple[Any, Any] | None = None) -> Steps:
    """Return equal steps from `x0` to `x1` [m].

    `light` is the foot [m] and the height [m] of one at whose angle the steps are to be equal;
    then `x1` may be infinite.
    """
    if light is None:
        begin, end, place = x0, x1, (None, None)
    else:
        foot, height = light
        # g is 0 where the light stands beside the segment; where it stands before or behind the
        # segment, h is at least g/1024, so that float32 tells the angles of the steps apart.
        gap = dr.maximum(dr.maximum(x0 - foot, foot - x1), 0)
        height = dr.maximum(height, 2.0**-10 * gap)
        end = dr.select(dr.isfinite(x1), dr.atan2(x1 - foot, height), 0.5 * dr.pi)
        begin, place = dr.atan2(x0 - foot, height), (foot, height)
    walks = x1 > x0
    return Steps(
        x0, x1, dr.select(walks, begin, 0), dr.select(walks, (end - begin) / steps, 0), *place
    )


def marched_integral(
    airlight: LitRays,
    distance: Any,
    *,
    steps: int,
    spacing: str,
    lit: Callable[[Any], Any],
    running: bool = False,
    shift: Any = 0.5,
) -> Any:
    """Return the airlight integral of a light along every ray by midpoint steps.

    Parameters
    ----------
    airlight, distance
        The rays and the light, and where the rays end [m].
    steps
        The number of steps on every ray.
    spacing
        'equiangular' in the angle at the light, or 'uniform' in the distance; for a light at
        infinity both are uniform.
    lit
        Says whether the light reaches the rays at distances [m].
    running
        Whether the camera's optical depth is the midpoint sum over the steps, as in engines,
        instead of the medium's exact depth. Where densities vary, the sum is wrong by a term in the
        square of the step.
    shift
        The place of the sample in a step, from 0 to 1: with a uniform random number
        the mean is the integral.

    Returns
    -------
    integral
        In parts of the medium's `unit`.
    """
    between = marched_steps(airlight, distance, steps, spacing)
    lanes = dr.width(distance)

    Float = type(between.width)

    # A medium that sums its depth along the ray is asked for the depth between samples only, one
    # after another; other media find the depth of each sample by themselves.
    summed = airlight.medium.sums_depth and not running

    def step(index, before, depths, total):
        x = between.place(dr.fma(Float(index) + shift, between.width, between.begin))
        length = between.width * between.stretch(x)
        camera = None
        if summed:
            # The medium's exact depth, from the sample before this one: no part of
            # the ray is walked twice.
            added = airlight.medium.optical_depth(airlight.rays, before, x)
            camera = depths = [depth + more for depth, more in zip(depths, added, strict=True)]
            before = x
        # As engines do: the extinction at the sample stands for the whole step, and the sample has
        # the part of it before its own place.
        if running:
            added = [sigma * length for sigma in airlight.medium.extinction(airlight.rays, x)]
            camera = [depth + shift * more for depth, more in zip(depths, added, strict=True)]
            depths = [depth + more for depth, more in zip(depths, added, strict=True)]
        # dx = dx/du du: `length` is the stretch at the sample times the width in u. Rays without
        # steps have the width 0, and `lit` may be anything there.
        reached = (between.width > 0) & lit(x)
        return (
            index + 1,
            before,
            depths,
            total + dr.select(reached, airlight.source(x, camera) * length, 0),
        )

    # The depth from the camera to the first step, which a light's cone or the medium may put far
    # ahead.
    first = airlight.medium.optical_depth(airlight.rays, 0, between.x0) if running or summed else ()
    depths = [depth + dr.zeros(Float, lanes) for depth in first]
    *_, total = dr.while_loop(
        state=(mi.UInt32(0), between.x0 + dr.zeros(Float, lanes), depths, airlight.nothing(lanes)),
        cond=lambda index, before, depths, total: index < steps,
        body=step,
        labels=("index", "before", "depths", "total"),
    )
    return total


def marched_steps(airlight: LitRays, distance: Any, steps: int, spacing: str) -> Steps:
    """Return the steps of rays where a light could reach them and something scatters.

    Parameters
    ----------
    airlight
        The rays and the light.
    distance
        Where each ray ends, may be infinite [m].
    steps
        The number of steps on every ray.
    spacing
        'equiangular' in the angle at the light, or 'uniform' in the distance; for a light at
        infinity both are uniform.

    Returns
    -------
    steps
        The steps; their width is 0 on a ray that has none.
    """
    light, geometry = airlight.light, airlight.geometry
    # The part of the ray in which the medium scatters, and in it the part in the light's cone or on
    # its side; a light at infinity reaches all of it.
    uniform = spacing == "uniform" or not light.w
    x0, x1 = airlight.medium.part(airlight.rays, type(distance)(0), distance, uniform=uniform)
    x0, x1 = geometry.lit_segment(x0, x1) if light.w else (x0, x1)
    at_light = None if uniform else (geometry.foot, geometry.height)
    return steps_between(x0, x1, steps, at_light)
