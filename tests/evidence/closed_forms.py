# SPDX-License-Identifier: BSD-3-Clause
r"""Closed forms for area lights: the known answers of scenes.

**A sphere next to a ray, in unbounded fog of isotropic scattering.** A point at the distance d from
the centre of a sphere of radius R and radiance Le receives the fluence

    Phi = Le int exp(-sigma_t r) domega

over the directions that meet the sphere. A direction at the angle psi from the centre meets it
first at the distance r with cos(psi) = (r^2 + T^2)/(2 d r), T^2 = d^2 - R^2, so that with r in the
place of psi

    domega = 2 pi |dcos(psi)| = (pi/d) (T^2/r^2 - 1) dr,      d - R <= r <= T:
    Phi = Le (pi/d) int_{d-R}^{T} (T^2/r^2 - 1) exp(-sigma_t r) dr.

The airlight of a
ray at the height h over the centre, whose foot is at the distance `foot`, is

    L = albedo sigma_t/(4 pi) int_{x0}^{x1} exp(-sigma_t x) Phi(sqrt(h^2 + (x - foot)^2)) dx = albedo sigma_t/(4 pi) K.

**How much of a flat light a surface point sees.** Seen from the point, an edge of an occluder falls
on a line in the plane of the light, and a convex polygon on a convex polygon. A line at the signed
distance u (in radii) from the centre of a disk leaves the fraction (acos u - u sqrt(1 - u^2))/pi;
the area that a polygon covers is added up edge by edge as signed triangles and sectors. On a
rectangle, polygons are clipped (Sutherland, Hodgman 1974) and measured (Gauss's shoelace).
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airlight.errors import InputError

Array = NDArray[np.float64]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(40)
_PANEL = 0.5  # of the distance between ray and sphere: panels of x


def sphere_airlight(
    sigma_t: float, height: float, radius: float, *, foot: float, x0: float, x1: float
) -> float:
    """Return K of a sphere of radiance 1 beside a ray [m].

    Parameters
    ----------
    sigma_t
        Extinction [1/m].
    height
        Distance between the centre of the sphere and the ray, above `radius` [m].
        radius
        Radius of the sphere [m].
    foot
        Distance along the ray at which it is closest to the centre [m].
    x0, x1
        Ends of the ray [m].

    Raises
    ------
    InputError
        If the ray meets the sphere.

    Notes
    -----
    Valid for isotropic scattering, to 1e-12, where sigma_t times the panels' width is below 10.
    """
    if not height > radius > 0:
        raise InputError(
            f"height is {height} and radius {radius}; expected a ray that passes beside the sphere"
        )
    # In w = asinh((x - foot)/(height - radius)) the peak beside the sphere is as
    # wide as everything else.
    scale = height - radius
    ends = np.arcsinh((x0 - foot) / scale), np.arcsinh((x1 - foot) / scale)
    count = max(1, math.ceil((ends[1] - ends[0]) / _PANEL))
    half = 0.5 * (ends[1] - ends[0]) / count
    middle = ends[0] + half * (2 * np.arange(count) + 1)
    w = (middle[:, None] + half * _NODES).ravel()
    s = scale * np.sinh(w)
    weight = np.tile(half * _WEIGHTS, count) * scale * np.cosh(w)
    return float(
        np.sum(
            weight
            * np.exp(-sigma_t * (foot + s))
            * sphere_fluence(sigma_t, np.hypot(height, s), radius)
        )
    )


def sphere_fluence(sigma_t: float, distance: ArrayLike, radius: float) -> Array:
    """Return the fluence [1] that a sphere of radiance 1 gives at distances above its
    radius from its centre, (n,).
    """
    d = np.asarray(distance, dtype=np.float64)
    tangent = np.sqrt((d - radius) * (d + radius))
    # In t = log(r/T) the integrand is as wide near the sphere as far from
    # it; T/(d - R) = (d + R)/T.
    width = np.log((d + radius) / tangent)
    t = -0.5 * width[:, None] * (1 - _NODES)
    r = tangent[:, None] * np.exp(t)
    f = -np.expm1(2 * t) * np.exp(-2 * t) * r * np.exp(-sigma_t * r)
    return np.asarray(np.pi / d * 0.5 * width * (f @ _WEIGHTS))


def disk_fraction(offset: ArrayLike) -> Array:
    """Return the fraction of a disk beyond a line at signed distances from its centre, in radii."""
    u = np.clip(np.asarray(offset, dtype=np.float64), -1.0, 1.0)
    return np.asarray((np.arccos(u) - u * np.sqrt((1 - u) * (1 + u))) / np.pi)


def polygon_in_disk(corners: ArrayLike) -> float:
    """Return the area that a convex polygon has in common with the unit disk about the origin.

    Parameters
    ----------
    corners
        In order, either way round, (n, 2), in radii.
    """
    points = np.asarray(corners, dtype=np.float64)
    total = 0.0
    for start, end in zip(points, np.roll(points, -1, axis=0), strict=True):
        total += _edge_area(start, end)
    return abs(total)


def _edge_area(start: Array, end: Array) -> float:
    """Return the signed area between the origin and a directed edge, within the unit disk."""
    way = end - start
    a, b, c = way @ way, start @ way, start @ start - 1
    root = math.sqrt(max(float(b * b - a * c), 0.0))
    low, high = (
        min(max(float(end / a), 0.0), 1.0) if root > 0 and a > 0 else 0.0
        for end in (-b - root, -b + root)
    )
    first, last = start + low * way, start + high * way
    inside = 0.5 * _cross(first, last)
    return inside + 0.5 * (_angle(start, first) + _angle(last, end))


def _cross(a: Array, b: Array) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def _angle(a: Array, b: Array) -> float:
    return math.atan2(_cross(a, b), float(a @ b))


def polygon_overlap(first: ArrayLike, second: ArrayLike) -> float:
    """Return the area that two convex polygons have in common, corners in order and
    counter-clockwise, (n, 2) each.
    """
    part = [np.asarray(point, dtype=np.float64) for point in np.asarray(first)]
    corners = np.asarray(second, dtype=np.float64)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        way, kept = end - start, []
        for point, following in zip(part, [*part[1:], *part[:1]], strict=True):
            here, there = _cross(way, point - start), _cross(way, following - start)
            if here >= 0:
                kept.append(point)
            if here * there < 0:
                kept.append(point + here / (here - there) * (following - point))
        part = kept
    if len(part) < 3:
        return 0.0
    return 0.5 * sum(_cross(a, b) for a, b in zip(part, [*part[1:], *part[:1]], strict=True))
