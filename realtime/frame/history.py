# SPDX-License-Identifier: BSD-3-Clause
"""The mean of the airlight of a frame and of those before it, of any method.

With alpha the weight of the newest frame L_n, a pixel shows

    H_n = (1 - alpha) C(H_{n-1}(P)) + alpha L_n,        H_0 = L_0.

At rest this divides the variance of independent frames by (2 - alpha)/alpha; what changed is late
by (1 - alpha)/alpha frames, and its ghost fades as (1 - alpha)^n.

P is the same pixel, or with `reproject=surface` where the last camera saw the surface of the pixel,
the sky as a point at infinity. There the four pixels about P count by bilinear weights, those only
whose surface is as far from the last camera to 5 %; where there is none, the pixel starts again.
Airlight lies before the surface: under a camera that moves its parallax is another one. Surfaces
are taken to stand still.

C leaves what the frames before showed as it is, or brings each channel into a range about the nine
pixels around in L_n: from their least to their largest value, or one standard deviation about their
mean.

References
----------
Karis 2014, *High-quality temporal supersampling* (the range). Salvi 2016, *An excursion in temporal
supersampling* (the deviation). Yang, Liu, Salvi 2020, *A survey of temporal antialiasing
techniques* (CGF 39:2).
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.numerics.array_types import Metres, PerRay
from airlight.realtime.numerics.recorded import Frozen
from airlight.realtime.scene.camera import Camera, ray_directions, row_and_column

_ALIKE = 0.05  # relative difference of depths up to which a pixel shows the same surface


@dataclass(frozen=True)
class PastFrames:
    """The averaged image that frames leave to the next one, row by row."""

    image: PerRay  #: H, a colour [W/(m^2 sr)]
    distance: Metres  #: to the visible surface [m]
    camera: Camera


class HistoryPass:
    """The mean with the frames before, recorded once for the first frame
    and once for all others.
    """

    def __init__(self, alpha: float, reproject: str, clamp: str, Float: Any):
        self._alpha = dr.opaque(Float, alpha)

        def run(
            airlight: PerRay,
            pixel: PerRay,
            distance: Metres,
            camera: Camera,
            alpha: Any,
            past: PastFrames | None,
        ):
            place = row_and_column(camera, pixel)
            mean = airlight
            if past is not None:
                before, known = (
                    _same_pixel(past, pixel)
                    if reproject == "none"
                    else _same_surface(past, camera, pixel, distance)
                )
                if clamp != "none":
                    least, most = _bounds(
                        _by_pixel(airlight, pixel), airlight, camera, place, clamp
                    )
                    before = dr.clip(before, least, most)
                # With alpha = 1 this is the newest frame, bit by bit.
                mean = dr.select(known, dr.fma(1 - alpha, before - airlight, airlight), airlight)
            return mean, PastFrames(_by_pixel(mean, pixel), _by_pixel(distance, pixel), camera)

        self._run = Frozen(run)

    def __call__(
        self,
        airlight: PerRay,
        pixel: PerRay,
        distance: Metres,
        camera: Camera,
        past: PastFrames | None,
    ) -> tuple[PerRay, PastFrames]:
        """Return the mean [W/(m^2 sr)], and what to hand on.

        `airlight`: of this frame [W/(m^2 sr)]; `pixel`, `distance`: the number of the pixel of each
        ray, and how far its surface is [m]; `camera`: of this frame; `past`: from the last frame;
        None for the first.
        """
        dr.eval(airlight)
        return self._run(airlight, pixel, distance, camera, self._alpha, past)


def _by_pixel(values: PerRay, pixel: PerRay) -> PerRay:
    """Return values by ray as an image, row by row."""
    image = dr.zeros(type(values), dr.width(pixel))
    dr.scatter(image, values, pixel)
    return image


def _same_pixel(past: PastFrames, pixel: PerRay) -> tuple[PerRay, Any]:
    return dr.gather(type(past.image), past.image, pixel), mi.Bool(True)


def _same_surface(
    past: PastFrames, camera: Camera, pixel: PerRay, distance: Metres
) -> tuple[PerRay, Any]:
    """Return the last frame's values on the surface of each pixel, and
    whether it saw the surface.
    """
    Color, Float, last = type(past.image), type(distance), past.camera
    _, aim = ray_directions(camera, pixel)
    there = dr.isfinite(distance)
    aim = aim * dr.rcp(dr.norm(aim))
    moved = mi.Vector3d(camera.origin) - mi.Vector3d(last.origin)
    away = dr.select(there, dr.fma(aim, mi.Float64(dr.select(there, distance, 0)), moved), aim)
    i, j, depth = last.project(away)
    x, y = last.grid.half_width - i, last.grid.half_height - j
    # A place outside the image may be too large for a whole number.
    known = (depth > 0) & (x > -1) & (x < camera.width) & (y > -1) & (y < camera.height)
    x, y = dr.select(known, x, 0), dr.select(known, y, 0)
    column, row = mi.Int32(dr.floor(x)), mi.Int32(dr.floor(y))
    right, down = Float(x - dr.floor(x)), Float(y - dr.floor(y))
    far = Float(dr.norm(away))
    total, shown = Float(0), Color(0)
    for i, across in enumerate((1 - right, right)):
        for j, along in enumerate((1 - down, down)):
            inside = (
                (column + i >= 0)
                & (column + i < camera.width)
                & (row + j >= 0)
                & (row + j < camera.height)
            )
            index = mi.UInt32(dr.select(inside, (row + j) * camera.width + column + i, 0))
            seen = dr.gather(Float, past.distance, index)
            alike = dr.select(there, dr.abs(seen - far) <= _ALIKE * far, ~dr.isfinite(seen))
            weight = dr.select(known & inside & alike, across * along, 0)
            total, shown = (
                total + weight,
                dr.fma(Color(weight), dr.gather(Color, past.image, index), shown),
            )
    return shown / dr.select(total > 0, total, 1), total > 0


def _bounds(
    image: PerRay, here: PerRay, camera: Camera, place: tuple[Any, Any], clamp: str
) -> tuple[PerRay, PerRay]:
    """Return the least and the most that the nine pixels about each allow; at the
    border those that are there.
    """
    Color = type(image)
    row, column = (mi.Int32(each) for each in place)
    least, most, total, squares = Color(here), Color(here), Color(0), Color(0)
    for i in (-1, 0, 1):
        for j in (-1, 0, 1):
            x, y = dr.clip(column + i, 0, camera.width - 1), dr.clip(row + j, 0, camera.height - 1)
            tap = dr.gather(Color, image, mi.UInt32(y * camera.width + x))
            least, most = dr.minimum(least, tap), dr.maximum(most, tap)
            total, squares = total + (tap - here), squares + dr.square(tap - here)
    if clamp == "range":
        return least, most
    mean = total / 9
    deviation = dr.sqrt(dr.maximum(squares / 9 - dr.square(mean), 0))
    return here + mean - deviation, here + mean + deviation
