# SPDX-License-Identifier: BSD-3-Clause
"""Media: an endless one, bounded ones in clear air, or bounded ones within an endless one.

Bounds are convex bodies within a ball. Of each the radius of a ball inside of it is known: where the camera shall be
in a medium it is in that ball. The balls around bounds are disjoint.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validation.random_scenes.design import Draws
from validation.random_scenes.ranges import Ranges

Array = NDArray[np.float64]

#: By kind, the radius of a ball that holds the body of half sizes 1, and of one within it.
_BALLS = {"sphere": (1.0, 1.0), "ellipsoid": (1.0, 0.93), "gem": (1.0, 0.91), "box": (math.sqrt(3), 1.0)}
_TRIES = 12


@dataclass(frozen=True)
class PlacedMedium:
    """A medium in radii of the stage."""

    bounds: str
    sigma_t: Array  #: RGB, one over a radius of the stage
    grey: bool
    albedo: Array
    phase: str
    optical_depth: float
    centre: Array
    half: Array
    axis: Array
    angle: float  #: [degrees]
    holds_camera: bool

    @property
    def ball(self) -> float:
        """The radius of a ball of about the same size as bounds."""
        around, within = _BALLS[self.bounds]
        return 0.5 * (around * float(self.half.max()) + within * float(self.half.min()))


def draw_media(draws: Draws, ranges: Ranges, camera: Array) -> list[PlacedMedium]:
    """Return the media around a camera, an endless one first."""
    kind = draws.pick(ranges.media, "media")
    inside = draws.pick(ranges.camera_inside, "camera_inside") == "yes"
    media = []
    if kind != "bounded":
        media.append(_endless(draws, ranges, camera))
    if kind != "endless":
        count = round(draws.between(ranges.bounded_media[0] - 0.49, ranges.bounded_media[1] + 0.49, "bounded_media"))
        media += _bounded(draws, ranges, camera, count=count, inside=inside, first=not media)
    return media


def _endless(draws: Draws, ranges: Ranges, camera: Array) -> PlacedMedium:
    depth = draws.logarithmic(*ranges.optical_depth, "optical_depth")
    zero = np.zeros(3)
    filling = _filling(draws, draws.of("endless"), ranges, depth / (float(np.linalg.norm(camera)) + 1))
    return PlacedMedium("endless", *filling, depth, zero, zero, np.array([0.0, 0.0, 1.0]), 0.0, True)


def _filling(draws: Draws, stream: Draws, ranges: Ranges, mean: float) -> tuple[Array, bool, Array, str]:
    """Return extinction, whether it is one, albedo and phase function; `draws` is the point, or the stream again."""
    grey = draws.pick(ranges.extinctions, "extinctions") == "one"
    spread = stream.between(*ranges.colour_spread)
    offsets = np.array([stream.between(-1, 1) for _ in range(3)])
    sigma = np.full(3, mean) if grey else mean * (1 + spread * (offsets - offsets.mean()))
    middle = draws.between(*ranges.albedo, "albedo")
    reach = 0.5 * min(middle - ranges.albedo[0], ranges.albedo[1] - middle)
    albedo = np.array([middle + reach * stream.between(-1, 1) for _ in range(3)])
    kind = draws.pick(ranges.phases, "phase")
    phase = {
        "hg": f"hg:{draws.between(*ranges.g, 'g')!r}",
        "hg-draine": f"hg-draine:{draws.between(*ranges.droplets, 'droplets')!r}",
    }.get(kind, kind)
    return sigma, grey, albedo, phase


def _bounded(
    draws: Draws, ranges: Ranges, camera: Array, *, count: int, inside: bool, first: bool
) -> list[PlacedMedium]:
    media: list[PlacedMedium] = []
    balls: list[tuple[Array, float]] = []
    for number in range(count):
        stream = draws.of(f"medium-{number}")
        # The point speaks for the first medium of the scene; others are of the stream.
        own = draws if first and number == 0 else stream
        for _ in range(_TRIES):
            kind = (draws if number == 0 else stream).pick(ranges.bounds_kinds, "bounds_kind" if number == 0 else "")
            around, within = _BALLS[kind]
            size = (draws if number == 0 else stream).logarithmic(*ranges.bounds, "bounds" if number == 0 else "")
            holds_camera = inside and number == 0
            if holds_camera:
                centre = (1 - stream.between(0.23, 0.67)) * camera + 0.31 * stream.in_ball()
                size = max(size, float(np.linalg.norm(centre - camera)) * stream.between(1.17, 2.1) / within)
            elif number == 0:
                centre = 0.37 * stream.in_ball()
            else:
                centre, size = 1.9 * stream.in_ball(), 0.47 * size
            stretch = np.array([stream.between(1.0, 1.37) for _ in range(3)]) if kind != "sphere" else np.ones(3)
            half = size * stretch
            if not holds_camera:
                # The camera stays outside of the ball around it.
                most = (float(np.linalg.norm(camera - centre)) - 0.11) / (around * float(half.max()))
                half = half * min(1.0, most)
            ball = around * float(half.max())
            if ball > 0.05 and all(np.linalg.norm(centre - other) > ball + radius + 0.01 for other, radius in balls):
                break
        else:
            continue
        balls.append((centre, ball))
        depth = own.logarithmic(*ranges.optical_depth, "optical_depth")
        filling = _filling(own, stream, ranges, depth / (2 * float(half.mean())))
        media.append(
            PlacedMedium(kind, *filling, depth, centre, half, stream.vector(), stream.between(3.0, 177.0), holds_camera)
        )
    return media


def optical_depths(media: list[PlacedMedium], start: Array, end: Array) -> Array:
    """Return the optical depths of segments, with balls in place of the bounds.

    Parameters
    ----------
    media
        As `draw_media` returned them.
    start, end
        Ends of the segments, (..., 3).

    Returns
    -------
    array
        By channel, (..., 3).
    """
    way = end - start
    length = np.linalg.norm(way, axis=-1)
    depth = np.zeros((*length.shape, 3))
    outside = length.copy()
    for medium in media:
        if medium.bounds != "endless":
            chord = _chord(medium, start, way, length)
            outside -= chord
            depth += chord[..., None] * medium.sigma_t
    for medium in media:
        if medium.bounds == "endless":
            depth += np.maximum(outside, 0)[..., None] * medium.sigma_t
    return depth


def _chord(medium: PlacedMedium, start: Array, way: Array, length: Array) -> Array:
    """Return how much of segments lies in the ball of a medium."""
    square = np.maximum(length**2, 1e-30)
    from_centre = start - medium.centre
    middle = -np.sum(from_centre * way, axis=-1) / square
    closest = np.sum((from_centre + middle[..., None] * way) ** 2, axis=-1)
    reach = np.sqrt(np.maximum(medium.ball**2 - closest, 0) / square)
    return length * np.maximum(np.minimum(middle + reach, 1) - np.maximum(middle - reach, 0), 0)
