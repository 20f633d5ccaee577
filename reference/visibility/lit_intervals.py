# SPDX-License-Identifier: BSD-3-Clause
"""Lit intervals of camera rays: by exact geometry from polygons and spheres, by ray casting from all other shapes.

Along a ray the angle theta at the light is the natural variable: the airlight integrand is bounded in it, an endless
ray ends at pi/2, and the direction from the light to the point is simply ``sin(theta) direction + cos(theta) n`` (n the
unit vector from the light to the foot point), at the distance height / cos(theta). Nothing cancels, however close the
ray passes to the light.

Exact geometry (`reference.visibility.triangles`) misses nothing and is as fast as casting rays. Casting works for all
shapes; the rays are cast in a scene of those that geometry leaves over, and what is lit is lit in both. Every ray is
sampled at `samples` angles; cells in which the light sees another shape at one end than at the other, or a surface that
comes or goes too fast to be one, are cut further; wherever two neighbours disagree a transition lies between them, and
is bisected to rounding.

Whatever the route, fresh random shadow rays then check the intervals (`reference.visibility.random_checks`).

A directional light takes the same steps (`reference.visibility.directional_casting`), but a share of the way, not an
angle, gives a point of a ray. `Legs` holds what differs.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from reference.scene.read import TruthLight, TruthScene
from reference.scene.shapes import Shapes, read_shapes, refuse_others
from reference.visibility.intervals import LitIntervals, intersected
from reference.visibility.random_checks import (
    ROUNDING,
    Leg,
    Rounding,
    Toggles,
    Visible,
    checked_cast,
    checked_geometry,
)
from reference.visibility.triangles import geometric_intervals

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Index = NDArray[np.int64]

_BISECTIONS = 26  # theta range / 256 / 2^26 < 1e-10 rad: below the float32 rounding of the rays that are cast
_CHUNK = 1 << 22  # rays cast at once
_PARTS = 4  # a suspicious cell is cut into so many
_LEVELS = 2  # so many times
CLEAR = 1e-5  #: of the largest coordinate: float32 rounding is 1e-7 of it
_STEEP = 4.0  # a surface seen within atan(1/4) = 14 degrees of grazing, or a jump, may hide an edge


@dataclass(frozen=True)
class Legs:
    """The legs from one light to points of camera rays; ray number and angle give a point."""

    shadow: Callable[[Index, Array], Any]  #: Mitsuba's shadow rays, from the light on, which end just before the points
    single: Leg  #: one leg in float64: where it begins, and the way from there to the point
    depth: Callable[[Index, Array], Array]  #: (ray numbers, distances along their legs) -> what no smooth surface makes
    #: change faster than `_STEEP` times the angle
    exact: Callable[[Shapes], LitIntervals]  #: lit intervals by geometry
    rounding: Array | float = ROUNDING  #: how close to an edge shadow rays cannot be asked [rad]


def lit_intervals(
    truth: TruthScene,
    light: TruthLight,
    rays: tuple[Array, Array, Array],
    *,
    ends: tuple[Array, Array],
    samples: int = 256,
    edges: str = "auto",
    shapes: Shapes | None = None,
    checks: int | None = None,
) -> LitIntervals:
    """Find the lit intervals of rays between two angles, and have them checked.

    Parameters
    ----------
    truth
        The scene.
    light
        The light.
    rays
        Unit directions (n, 3), unit normals from the light to the foot points (n, 3), heights (n,) [m].
    ends
        Angles at the light between which a ray is looked at [rad], each (n,); empty where the first is not below the
        second.
    samples
        Regular samples of each ray if rays are cast; an eighth as many random ones check either route, at least one.
    edges
        "geometry": exactly, from triangles and spheres. "rays": by casting rays. "auto": by geometry where it can be.
    shapes
        What `reference.scene.shapes.read_shapes` returned for the occluders, if known.
    checks
        Random samples of each ray; an eighth of `samples` if None.

    Raises
    ------
    InputError
        For another word in `edges`; for "geometry" in a scene with shapes that are neither polygons nor spheres.

    Notes
    -----
    By geometry, valid for all scenes of opaque meshes, rectangles and spheres. By casting rays, valid where shadows
    along a ray are wider than (high - low)/samples in theta; the random checks measure what is not.
    """
    how: dict[str, Any] = {"samples": samples, "edges": edges, "shapes": shapes, "checks": checks}
    return found_intervals(truth, _point_legs(truth, light, rays, ends), ends=ends, **how)


def _point_legs(truth: TruthScene, light: TruthLight, rays: tuple[Array, Array, Array], ends: tuple[Array, Array]):
    return Legs(
        _shadow_rays(_start(light), rays),
        point_leg(light.position, rays),
        lambda ray, distance: np.log(distance),
        lambda shapes: geometric_intervals(truth, light, rays, ends=ends, shapes=shapes),
    )


def _start(light: TruthLight) -> Array:
    """Return where the shadow rays of a light start: from a light with extent, clear of float32 shapes in its plane."""
    if not light.cosine or light.axis is None:
        return light.position
    return light.position + CLEAR * (1 + np.abs(light.position).max()) * light.axis


def point_leg(position: Array, rays: tuple[Array, Array, Array]) -> Leg:
    """Return a function (ray number, angle) -> the light's position and the way to the point, in float64."""
    direction, normal, height = rays

    def leg(ray: np.int64, theta: np.float64) -> tuple[Array, Array]:
        sine, cosine = np.sin(theta), np.cos(theta)
        return position, (sine * direction[ray] + cosine * normal[ray]) * height[ray] / cosine

    return leg


def found_intervals(
    truth: TruthScene,
    legs: Legs,
    *,
    ends: tuple[Array, Array],
    samples: int,
    edges: str,
    shapes: Shapes | None,
    checks: int | None = None,
) -> LitIntervals:
    """Find and check the lit intervals of rays for any light.

    Parameters
    ----------
    truth
        The scene.
    legs
        The legs from the light to points of the rays.
    ends
        Between which the rays are looked at, (rays,) each, in the variable of the legs: an angle [rad], or a share.
    samples, edges, shapes, checks
        As in `lit_intervals`.

    Raises
    ------
    InputError
        For another word in `edges`; for `edges` 'geometry' with shapes whose shadows are not exact.
    """
    if edges not in ("auto", "geometry", "rays"):
        raise InputError(f"edges is '{edges}'; wanted 'geometry', 'rays' or 'auto'")
    checks = max(1, samples // 8) if checks is None else checks
    low, high = ends
    used = np.flatnonzero(high > low)
    if not truth.occluders.shapes() or not len(used):
        return LitIntervals(used, low[used], high[used], 0, edge=0.0)
    if edges == "rays":
        return _cast_intervals(truth.occluders, legs, ends, samples, checks)
    shapes = read_shapes(truth.occluders) if shapes is None else shapes
    if edges == "geometry":
        refuse_others(shapes)
    if shapes.others is not None and not shapes.single:
        return _cast_intervals(shapes.others, legs, ends, samples, checks)
    exact = legs.exact(shapes)
    others = None
    if shapes.others is not None:
        others = _visible(shapes.others, legs.shadow)
        exact = intersected(exact, _cast_intervals(shapes.others, legs, ends, samples, checks), ends)
    return checked_geometry(
        exact,
        _visible(truth.occluders, legs.shadow),
        (legs.single, shapes),
        ends=ends,
        checks=checks,
        others=others,
        rounding=legs.rounding,
    )


def _cast_intervals(scene, legs: Legs, ends: tuple[Array, Array], samples: int, checks: int) -> LitIntervals:
    """Find lit intervals by casting rays in a scene, and have them checked and mended."""
    used = np.flatnonzero(ends[1] > ends[0])
    visible = _visible(scene, legs.shadow)
    hits = _first_hits(scene, legs)
    per_chunk = max(1, _CHUNK // (samples + 2))
    chunks = [
        _toggles(visible, hits, ends, used[start : start + per_chunk], samples)
        for start in range(0, len(used), per_chunk)
    ]
    return checked_cast(Toggles.joined(chunks), Rounding(visible, _bisect), ends=ends, checks=checks)


def _visible(scene, shadow: Callable[[Index, Array], Any]) -> Visible:
    def visible(ray: Index, theta: Array) -> Bools:
        return ~np.array(scene.ray_test(shadow(ray, theta)), dtype=bool)

    return visible


def _shadow_rays(position: Array, rays: tuple[Array, Array, Array]) -> Callable:
    direction, normal, height = mi.Vector3d(rays[0].T), mi.Vector3d(rays[1].T), mi.Float64(rays[2])
    start = mi.Point3f(*(float(c) for c in position))
    dr.make_opaque(direction, normal, height, start)

    def shadow(ray: Index, theta: Array):
        index = mi.UInt32(ray.astype(np.uint32))
        sine, cosine = dr.sincos(mi.Float64(theta))
        to_point = dr.gather(mi.Vector3d, direction, index) * sine + dr.gather(mi.Vector3d, normal, index) * cosine
        length = dr.gather(mi.Float64, height, index) / dr.maximum(cosine, 1e-300) * (1 - 2e-6)
        return mi.Ray3f(start, dr.normalize(mi.Vector3f(to_point)), mi.Float(length), 0.0, [])

    return shadow


def _first_hits(scene, legs: Legs) -> Callable:
    """Return a function (ray numbers, angles) -> (lit or not, `Legs.depth` of what is met, number of the shape)."""

    def hits(ray: Index, theta: Array) -> tuple[Bools, Array, Index]:
        shadow_ray = legs.shadow(ray, theta)
        length = mi.Float(shadow_ray.maxt)
        shadow_ray.maxt = dr.inf
        hit = scene.ray_intersect_preliminary(shadow_ray, coherent=True)
        valid = hit.is_valid()
        lit = ~(valid & (hit.t < length))
        shape = dr.select(valid, dr.reinterpret_array(mi.UInt32, hit.shape), 0)
        distance = np.array(dr.select(valid, hit.t, 1.0), dtype=np.float64)
        return np.array(lit, dtype=bool), legs.depth(ray, distance), np.array(shape, dtype=np.int64)

    return hits


def _toggles(visible: Visible, hits: Callable, ends: tuple[Array, Array], used: Index, samples: int) -> Toggles:
    """Sample the rays of a chunk, cut suspicious cells further, and bisect every transition."""
    low, high = ends[0][used], ends[1][used]
    # Regular samples at the middles of equal cells, and one close to each end: a shadow that touches the surface.
    fractions = np.concatenate([[1e-4], (np.arange(samples) + 0.5) / samples, [1 - 1e-4]])
    theta = low[:, None] + (high - low)[:, None] * fractions
    row = np.repeat(np.arange(len(used)), len(fractions))
    theta = theta.ravel()
    lit, distance, shape = hits(used[row], theta)
    for _ in range(_LEVELS):
        cells = np.flatnonzero((row[1:] == row[:-1]) & _suspicious(theta, lit, distance, shape))
        if not len(cells):
            break
        share = np.arange(1, _PARTS) / _PARTS
        more = (theta[cells, None] + (theta[cells + 1] - theta[cells])[:, None] * share).ravel()
        more_row = np.repeat(row[cells], _PARTS - 1)
        added = hits(used[more_row], more)
        at = np.repeat(cells + 1, _PARTS - 1)
        row, theta = np.insert(row, at, more_row), np.insert(theta, at, more)
        lit, distance, shape = (np.insert(old, at, new) for old, new in zip((lit, distance, shape), added, strict=True))
    cells = np.flatnonzero((row[1:] == row[:-1]) & (lit[1:] != lit[:-1]))
    edge = _bisect(visible, used[row[cells]], (theta[cells], theta[cells + 1]), lit[cells])
    first = np.flatnonzero(np.append(True, row[1:] != row[:-1]))
    return Toggles(used, lit[first], used[row[cells]], edge)


def _suspicious(theta: Array, lit: Bools, distance: Array, shape: Index) -> Bools:
    """Return in which cells something may begin or end unseen: both ends alike, but not the same surface."""
    steep = np.abs(np.diff(distance)) > _STEEP * np.diff(theta)
    return (lit[1:] == lit[:-1]) & (steep | (shape[1:] != shape[:-1]))


def _bisect(visible: Visible, ray: Index, bracket: tuple[Array, Array], lit_low: Bools) -> Array:
    low, high = bracket[0].copy(), bracket[1].copy()
    for _ in range(_BISECTIONS if len(ray) else 0):
        middle = 0.5 * (low + high)
        same = visible(ray, middle) == lit_low
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return 0.5 * (low + high)
