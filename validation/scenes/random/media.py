# SPDX-License-Identifier: BSD-3-Clause
"""Media of random scenes, an unbounded one, bounded ones or both, and how bright a light
makes them without shadows.

Bounds are convex bodies within a ball. The radius of a ball inside each body is known: a camera
that is to be in a medium is put into this ball. The balls around bounds are disjoint.

The brightness of a light is drawn for any optical depth and distance: its intensity follows from
the effect of a unit intensity. Shadows and bounds are approximated there; only the exposure of the
image depends on them.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from airlight.analytic.phase import phase_from_words
from airlight.validation.arrays import Array
from airlight.validation.properties.view import optical_depths
from airlight.validation.scenes.random.design import Draws, Ranges

#: By kind, the radius of a ball that holds the body of half sizes 1, and of one within it.
_BALLS = {
    "sphere": (1.0, 1.0),
    "ellipsoid": (1.0, 0.93),
    "gem": (1.0, 0.91),
    "box": (math.sqrt(3), 1.0),
}


@dataclass(frozen=True)
class Medium:
    """A medium, first in radii of the stage, then in metres."""

    name: str
    bounds: str  #: 'unbounded', 'sphere', 'box', 'gem' or 'ellipsoid'
    sigma_t: Array  #: RGB, one over a length
    grey: bool  #: whether the three are one
    albedo: Array
    phase: str  #: words of the phase function, such as 'isotropic', 'hg:0.31' and 'hazy'
    #: of the way from the camera to behind the stage, or through the middle of the bounds
    optical_depth: float
    holds_camera: bool
    centre: Array = field(default_factory=lambda: np.zeros(3))
    half: Array = field(default_factory=lambda: np.zeros(3))  #: of its sizes along its own axes
    turn: tuple[Array, float] = (np.array([0.0, 0.0, 1.0]), 0.0)  #: axis and angle [degrees]

    @property
    def ball(self) -> float:
        """The radius of a ball of about the same size as bounds."""
        around, within = _BALLS[self.bounds]
        return 0.5 * (around * float(self.half.max()) + within * float(self.half.min()))

    def placed(self, scale: float, centre: Array) -> "Medium":
        """Return the medium in a stage of a radius and a centre [m]."""
        place = centre + scale * self.centre
        return replace(self, sigma_t=self.sigma_t / scale, centre=place, half=scale * self.half)


def draw_media(draws: Draws, ranges: Ranges, camera: Array) -> list[Medium]:
    """Return the media around a camera, an unbounded one first."""
    kind = draws.pick(ranges["media"], "media")
    inside = draws.pick(ranges["camera_inside"], "camera_inside") == "yes"
    media = []
    if kind != "bounded":
        depth = draws.logarithmic(*ranges["optical_depth"], name="optical_depth")
        # The optical depth is that from the camera to behind the stage, of radius 1: extinction is
        # depth over this length.
        filling = _filling(
            draws, draws.of("endless"), ranges, depth / (float(np.linalg.norm(camera)) + 1)
        )
        media.append(Medium("unbounded", "unbounded", *filling, depth, True))
    if kind != "unbounded":
        fewest, most = ranges["bounded_media"]
        count = round(draws.between(fewest - 0.49, most + 0.49, name="bounded_media"))
        media += _bounded(draws, ranges, camera, count=count, inside=inside, first=not media)
    return media


def _filling(
    draws: Draws, stream: Draws, ranges: Ranges, mean: float
) -> tuple[Array, bool, Array, str]:
    """Return extinction, whether it is one, albedo and phase function; `draws` is the
    point, or the stream again.
    """
    grey = draws.pick(ranges["extinctions"], "extinctions") == "one"
    spread = stream.between(*ranges["colour_spread"])
    offsets = np.array([stream.between(-1, 1) for _ in range(3)])
    # Offsets have the mean 0: the mean of the three channels stays as drawn.
    sigma = np.full(3, mean) if grey else mean * (1 + spread * (offsets - offsets.mean()))
    middle = draws.between(*ranges["albedo"], name="albedo")
    # Channels differ by half of the distance to the nearer end of the range, and stay within it.
    reach = 0.5 * min(middle - ranges["albedo"][0], ranges["albedo"][1] - middle)
    albedo = np.array([middle + reach * stream.between(-1, 1) for _ in range(3)])
    kind = draws.pick(ranges["phases"], "phase")
    phase = {
        "hg": f"hg:{draws.between(*ranges['g'], name='g')!r}",
        "hg-draine": f"hg-draine:{draws.between(*ranges['droplets'], name='droplets')!r}",
    }.get(kind, kind)
    return sigma, grey, albedo, phase


def _bounded(
    draws: Draws, ranges: Ranges, camera: Array, *, count: int, inside: bool, first: bool
) -> list[Medium]:
    media: list[Medium] = []
    balls: list[tuple[Array, float]] = []
    for number in range(count):
        stream = draws.of(f"medium-{number}")
        # The numbers of the first medium of the scene are coordinates of the point; those of others
        # come from the stream.
        source = draws if first and number == 0 else stream
        for _ in range(12):
            # Kind and size of the first bounded medium are coordinates of the point too.
            kind = (draws if number == 0 else stream).pick(ranges["bounds_kinds"], "bounds_kind")
            around, within = _BALLS[kind]
            size = (draws if number == 0 else stream).logarithmic(*ranges["bounds"], name="bounds")
            holds_camera = inside and number == 0
            # The ball within the body holds the camera: the size is at least 1.17 times what that
            # needs.
            if holds_camera:
                centre = (1 - stream.between(0.23, 0.67)) * camera + 0.31 * stream.in_ball()
                size = max(
                    size,
                    float(np.linalg.norm(centre - camera)) * stream.between(1.17, 2.1) / within,
                )
            elif number == 0:
                centre = 0.37 * stream.in_ball()
            else:
                centre, size = 1.9 * stream.in_ball(), 0.47 * size
            stretch = (
                np.array([stream.between(1.0, 1.37) for _ in range(3)])
                if kind != "sphere"
                else np.ones(3)
            )
            half = size * stretch
            if not holds_camera:
                # The camera stays outside of the ball around it.
                most = (float(np.linalg.norm(camera - centre)) - 0.11) / (
                    around * float(half.max())
                )
                half = half * min(1.0, most)
            # The balls around all bounds are disjoint, with a gap, or the body is drawn again.
            ball = around * float(half.max())
            if ball > 0.05 and all(
                np.linalg.norm(centre - other) > ball + radius + 0.01 for other, radius in balls
            ):
                break
        else:
            continue
        balls.append((centre, ball))
        depth = source.logarithmic(*ranges["optical_depth"], name="optical_depth")
        filling = _filling(source, stream, ranges, depth / (2 * float(half.mean())))
        turn = stream.vector(), stream.between(3.0, 177.0)
        name = f"medium-{len(media) + 1 + (not first)}"
        media.append(Medium(name, kind, *filling, depth, holds_camera, centre, half, turn))
    return media


def depths(media: list[Medium], start: Array, end: Array) -> Array:
    """Return the optical depths of segments by channel, (..., 3), with
    balls in place of the bounds.
    """
    balls = [
        (medium.centre, medium.ball, medium.sigma_t)
        for medium in media
        if medium.bounds != "unbounded"
    ]
    around = [medium.sigma_t for medium in media if medium.bounds == "unbounded"]
    return optical_depths(balls, around[0] if around else 0.0, start, end)


def view_rays(camera: Array, target: Array) -> Array:
    """Return the directions of five rays about the middle of the image,
    which is the first, (5, 3).
    """
    forward = (target - camera) / np.linalg.norm(target - camera)
    left = np.cross(forward, [0.0, 0.0, 1.0])
    left /= np.linalg.norm(left)
    up = np.cross(left, forward)
    directions = np.stack([forward, *(forward + 0.13 * side for side in (left, -left, up, -up))])
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))


def unit_airlight(
    media: list[Medium], camera: Array, directions: Array, light: Array, *, directional: bool
) -> float:
    """Return the largest airlight of a light of unit intensity over rays of
    the camera and channels.

    A directional light, of unit irradiance, does not spread; it comes from a point very far away.
    """
    # Midpoint rule along each ray, with steps that grow with the distance from the camera.
    steps = 96
    edges = (float(np.linalg.norm(camera)) + 1.0) * (np.arange(steps + 1) / steps) ** 2
    middle, lengths = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    points = camera + middle[:, None] * directions[:, None]
    # Attenuation from camera to point, later from point to light; inverse square in between.
    transmittance = np.exp(-depths(media, np.broadcast_to(camera, points.shape), points))
    toward = light - points
    distance = np.linalg.norm(toward, axis=-1)
    depth = depths(media, points, np.broadcast_to(light, points.shape))
    # Light spreads from a ball of this radius at least, in radii of the stage: points at the light
    # would have no limit.
    near = 0.07
    spread = np.ones_like(distance) if directional else 1 / np.maximum(distance, near) ** 2
    cosine = -np.sum(toward * directions[:, None], axis=-1) / np.maximum(distance, 1e-12)
    total = np.zeros(points.shape)
    taken = np.zeros(distance.shape, dtype=bool)
    # Bounded media first: a point in one of them does not belong to the unbounded medium.
    for medium in sorted(media, key=lambda each: each.bounds == "unbounded"):
        inside = (
            np.linalg.norm(points - medium.centre, axis=-1) < medium.ball
            if medium.bounds != "unbounded"
            else ~taken
        )
        inside &= ~taken
        taken |= inside
        # Values of phase functions have the mean 1; over 4 pi they are per steradian.
        phase = phase_from_words(medium.phase)(np.clip(cosine, -1, 1)) / (4 * np.pi)
        total += (inside * phase * spread)[..., None] * (medium.sigma_t * medium.albedo)
    return float((total * np.exp(-depth) * lengths[:, None] * transmittance).sum(axis=1).max())
