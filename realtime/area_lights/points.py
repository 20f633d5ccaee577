# SPDX-License-Identifier: BSD-3-Clause
"""Light samples, and the patterns in which they lie.

**Patterns of points, each for an equal part of the area.**

* `ring`: the few points of Ali 2016, whose layout the source does not print; reconstructed from
  captions. On a disk of the radius R they lie on a circle of R/sqrt(2), on a rectangle on the
  ellipse that is sqrt(2/3) as large as it. There the points have the same mean square distances
  from the middle as the whole light,

      int r^2 dA / A = R^2/2,      int x^2 dx / (2 a) = a^2/3 = (1/2) (2/3) a^2,

  so that they are right to second order for whatever is smooth. One point is the middle. A sphere
  has no ring: its points lie on a spiral, at equal steps of height and golden angles. A mesh has
  none either: its points follow its area in equal steps.
* `sobol`: the first points of Sobol's sequence, scrambled as Owen proposed, with one fixed seed
  (Laine and Karras 2011; Burley 2020 has the hash).

**Light samples:** an area light as N point lights of equal power.

Each stands for the part A/N of the area: a point light with the intensity I(w) = I0 max(0, n . w),
I0 = Le A/N [W/sr], n the normal of the shape there. Its power, pi I0, is an N-th of the power of
the light.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airlight.realtime.area_lights.shape import AreaLight
from airlight.realtime.parameters import Parameters, parameter

Array = NDArray[np.float64]

PATTERNS = ("ring", "sobol")
#: where a ring begins [rad]: not on an axis of the light, along which occluders often run
_TURN = 0.37
_GOLDEN = math.pi * (3 - math.sqrt(5))  #: [rad]


def ring(points: int) -> Array:
    """Return directions from the middle of a ring, (points, 2) of length 1; one
    point is the middle, (0, 0).
    """
    if points == 1:
        return np.zeros((1, 2))
    angle = _TURN + 2 * math.pi * np.arange(points) / points
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def spiral(points: int) -> Array:
    """Return unit vectors along a spiral over the sphere, (points, 3)."""
    z = 1 - (2 * np.arange(points) + 1) / points
    angle = _TURN + _GOLDEN * np.arange(points)
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)


def sobol(points: int) -> Array:
    """Return the first points of Sobol's sequence in the unit square, (points, 2) in [0, 1].

    `scipy.stats.qmc` has the sequence too; its import takes a second or more, and its scrambling,
    by random matrices, makes the error of penumbrae by 16 points 6 % larger (median of 12 seeds, 20
    000 edges across a square).
    """
    # The first coordinate is van der Corput's sequence: the bits of the index behind the point.
    index = np.arange(points, dtype=np.uint32)
    first = bit_reversed(index)
    # The second one adds, modulo 2, a direction number for each bit of the index that is set; each
    # follows from the one before it.
    second, direction = np.zeros_like(index), 1 << 31
    for bit in range(32):
        second ^= np.where(
            index >> np.uint32(bit) & np.uint32(1), np.uint32(direction), np.uint32(0)
        )
        direction ^= direction >> 1
    # Seeds are fixed: every run has the same points. Half a unit moves them off the lower edge.
    seeds = (0x1A2B3C4D, 0x9D5F37E1)
    columns = [_scrambled(column, seed) for column, seed in zip((first, second), seeds)]
    return (np.stack(columns, axis=1).astype(np.float64) + 0.5) / 2.0**32


def _scrambled(number, seed: int):
    """Return numbers after a nested uniform scrambling: each bit is flipped by a
    hash of the bits above it.
    """
    # With the bits reversed, a product with an even number carries only from lower bits, the upper
    # ones of the number, into higher ones (Laine and Karras 2011). Overflow is meant.
    with np.errstate(over="ignore"):
        x = bit_reversed(number) + np.uint32(seed)
        for factor in (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6):
            x ^= x * np.uint32(factor)
    return bit_reversed(x)


def bit_reversed(number):
    """Return 32-bit numbers with their bits in reverse order."""
    x = number
    # Halves change places, then quarters, and so on down to neighbouring bits.
    for shift, mask in (
        (16, 0x0000FFFF),
        (8, 0x00FF00FF),
        (4, 0x0F0F0F0F),
        (2, 0x33333333),
        (1, 0x55555555),
    ):
        x = (x >> np.uint32(shift)) & np.uint32(mask) | (x & np.uint32(mask)) << np.uint32(shift)
    return x


@dataclass(frozen=True)
class LightSamples(Parameters):
    """How a method renders area lights; without effect where there are none."""

    points: int = parameter(
        16, "light samples of equal power for each area light", least=1, most=4096
    )
    pattern: str = parameter(
        "sobol",
        "where they lie: on a ring, as in Ali 2016, or by Sobol's sequence",
        choices=PATTERNS,
    )


@dataclass(frozen=True)
class PlacedPoints:
    """The light samples of one light, on the host."""

    positions: Array  #: (points, 3) [m]
    normals: Array  #: unit vectors, (points, 3)
    intensity: Array  #: of each sample along its normal, RGB (3,) [W/sr]
    lift: float  #: how far before the shape rays start [m]
    chord: float  #: way through the shape of a ray that comes from behind along the normal [m]


def place_points(light: AreaLight, points: int, pattern: str) -> PlacedPoints:
    """Return the light samples of a light.

    Valid for all lights. One point of a sphere lights a half space alone; a few
    points are needed there.

    Parameters
    ----------
    light
        The area light.
    points
        How many, 1 to 4096.
    pattern
        One of `PATTERNS`.

    Raises
    ------
    InputError
        For another number or pattern.
    """
    # The record checks both.
    LightSamples(points, pattern)
    if light.kind == "mesh":
        positions, normals = _on_mesh(light, points, pattern)
    elif light.kind == "sphere":
        positions, normals = _on_sphere(light, points, pattern)
    else:
        u, v = _on_disk(points, pattern) if light.kind == "disk" else _on_rectangle(points, pattern)
        positions = light.middle + u[:, None] * light.across + v[:, None] * light.up
        normals = np.broadcast_to(light.normal, (points, 3))
    # Rays start off the shape by some dozen units in the last place of the largest coordinate.
    lift = 4e-6 * float(
        np.abs(light.middle).max() + np.linalg.norm(light.across) + np.linalg.norm(light.up)
    )
    # A ray that comes from behind along the normal passes through a whole sphere.
    chord = 2 * light.radius if light.kind == "sphere" else 0.0
    # The shape of such a light stays in the light of its points, which must lie before it.
    if light.folded:
        positions = positions + lift * normals
    return PlacedPoints(positions, normals, light.radiance * (light.area / points), lift, chord)


def _on_mesh(light: AreaLight, points: int, pattern: str) -> tuple[Array, Array]:
    """Return points and normals: the first coordinate of the pattern chooses the
    triangle and a place along it.
    """
    if pattern == "ring":
        # Equal steps of area along the mesh; across a triangle golden angles, as parts of a turn.
        number = np.arange(points)
        u, v = (number + 0.5) / points, number * _GOLDEN / (2 * math.pi) % 1
    else:
        u, v = sobol(points).T
    # u, in [0, 1], runs over the area of all triangles in turn: it chooses the triangle, and the
    # fraction of it that lies before u.
    twice = np.linalg.norm(light.normals, axis=1)
    ends = np.cumsum(twice) / twice.sum()
    chosen = np.minimum(np.searchsorted(ends, u, side="right"), len(ends) - 1)
    # The distance from the first corner goes with the root of that fraction, v along the opposite
    # side: equal parts of the unit square are equal areas.
    root = np.sqrt(np.clip(1 - (ends[chosen] - u) / (twice[chosen] / twice.sum()), 0, 1))
    first, second, third = (light.vertices[light.triangles[chosen, corner]] for corner in range(3))
    places = (
        first + (root * (1 - v))[:, None] * (second - first) + (root * v)[:, None] * (third - first)
    )
    return places, light.normals[chosen] / twice[chosen, None]


def _on_rectangle(points: int, pattern: str) -> tuple[Array, Array]:
    if pattern == "ring":
        # The ellipse with the mean square distances of the rectangle (module).
        u, v = np.sqrt(2 / 3) * ring(points).T
        return u, v
    u, v = 2 * sobol(points).T - 1
    return u, v


def _on_disk(points: int, pattern: str) -> tuple[Array, Array]:
    if pattern == "ring":
        # The circle with the mean square distance of the disk (module).
        u, v = np.sqrt(1 / 2) * ring(points).T
        return u, v
    return _concentric(sobol(points))


def _concentric(places: Array) -> tuple[Array, Array]:
    """Return the unit square mapped to the unit disk, square rings to round ones
    (Shirley and Chiu 1997).
    """
    # The larger coordinate is the radius; the angle runs linearly along the side of the square.
    a, b = 2 * places.T - 1
    steep = np.abs(b) > np.abs(a)
    radius = np.where(steep, b, a)
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.where(steep, 0.5 * np.pi - 0.25 * np.pi * a / b, 0.25 * np.pi * b / a)
    # In the middle there is no angle, and no radius to turn.
    angle = np.where(radius == 0, 0, angle)
    return radius * np.cos(angle), radius * np.sin(angle)


def _on_sphere(light: AreaLight, points: int, pattern: str) -> tuple[Array, Array]:
    if pattern == "ring":
        unit_vectors = spiral(points)
    else:
        # Equal steps of height are equal areas of the sphere (Archimedes).
        u, v = sobol(points).T
        z, angle = 1 - 2 * v, 2 * np.pi * u
        across = np.sqrt(1 - z * z)
        unit_vectors = np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)
    # From the axes of the sphere, which a to_world may turn, to the scene.
    axes = (
        np.stack([light.across, light.up, np.cross(light.across, light.up) / light.radius])
        / light.radius
    )
    normals = unit_vectors @ axes
    return light.middle + light.radius * normals, normals
