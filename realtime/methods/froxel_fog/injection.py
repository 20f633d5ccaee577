# SPDX-License-Identifier: BSD-3-Clause
"""The light that reaches a point of each froxel and is scattered there towards the camera.

With P that point, r its distance from the light, T the transmittance from there and V the visibility, a froxel holds

    S = 1/(4 pi) sum_lights I V T / max(r^2, b^2)  sum_media c albedo sigma_t p        [W/(m^3 sr)],

c the share of the froxel that the medium fills. For a directional light, I / r^2 is the irradiance.

About a light 1/r^2 has no bound, though its mean over a froxel has. With a half the diagonal of the froxel, the mean of
1/r^2 over a ball of the radius a about the light is

    3/(4 pi a^3) int_0^a (1/r^2) 4 pi r^2 dr = 3/a^2.

So b^2 = a^2/3: a froxel with the light in it has about its mean, those away from the light are as they are, and b
vanishes with the size of the froxels.
"""

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.bounded_media.ray_segments import Piece, path_transmittance
from realtime.methods.froxel_fog.grid import Grid
from realtime.methods.froxel_fog.media import piece_length
from realtime.methods.interface.view import View
from realtime.numerics.array_types import PerRay
from realtime.rays.ray_light import falloff, ray_geometry
from realtime.scene.lights import Light
from realtime.scene.medium import transmittance

#: (point, number of the light) -> whether that light reaches the point.
Visibility = Callable[[Any, int], Any]


def scattered_light(
    view: View, grid: Grid, pieces: tuple[Piece, ...], *, shift: tuple[Any, Any, Any], visible: Visibility
) -> PerRay:
    """Return the light that each froxel scatters to the camera, a colour [W/(m^3 sr)].

    Parameters
    ----------
    view, grid
        The frame and its froxels.
    pieces
        Of the columns, from `realtime.methods.froxel_fog.media.column_pieces`.
    shift
        Of the points from the middles of the froxels, in parts of a froxel across, down and in depth.
    visible
        Which light reaches which point.
    """
    Float, Color = type(view.distance), type(view.medium.albedo)
    lane = dr.arange(mi.UInt32, grid.columns * grid.slices)
    number = lane // grid.columns
    column = lane - number * grid.columns
    ray = grid.column_ray(column, shift[:2])
    unit = ray * dr.rsqrt(dr.squared_norm(ray))
    begin, end = grid.depth(Float(number) / grid.slices), grid.depth((Float(number) + 1) / grid.slices)
    point = dr.fma(ray, dr.lerp(begin, end, 0.5 + shift[2]), view.origin)
    least = _least_square(grid, begin, end)
    filled: list[tuple[Any, Any]] = []
    if view.features.bounded:
        middle = dr.norm(grid.column_ray(column))
        for piece in pieces:
            share = piece_length(piece, begin * middle, end * middle, column) / ((end - begin) * middle)
            filled.append((piece.medium, share))
    else:
        filled.append((view.medium, Float(1)))
    some = sum((share for _, share in filled), Float(0)) > 0
    total = dr.zeros(Color, dr.width(lane))
    for index, light in enumerate(view.lights):
        arriving, cosine = _arriving(view, light, point, unit, least=least, active=some)
        density = Color(0)
        for medium, share in filled:
            sigma_t = medium.sigma_t[0] if len(medium.sigma_t) == 1 else Color(*medium.sigma_t)
            density += medium.albedo * (sigma_t * (share * medium.phase.evaluate(cosine)))
        lit = some & (visible(point, index) if view.features.shadows else True)
        total += dr.select(lit, arriving * density, 0)
    return total * (0.25 * dr.inv_pi)


def _least_square(grid: Grid, begin: Any, end: Any) -> Any:
    """Return b^2 of froxels between two depths [m^2]."""
    camera = grid.camera
    depth = 0.5 * (begin + end)
    across = dr.squared_norm(camera.left * (camera.width / grid.width)) + dr.squared_norm(
        camera.up * (camera.height / grid.height)
    )
    return (across * dr.square(depth) + dr.square(end - begin)) / 12


def _arriving(view: View, light: Light, point: Any, unit: Any, *, least: Any, active: Any) -> tuple[Any, Any]:
    """Return I T / r^2 [W/m^2] of a light at points, without shadows, and the cosine of the scattering angle there."""
    medium, Float = view.medium, type(view.distance)
    toward = light.toward(point)
    square = dr.squared_norm(toward)
    r = dr.sqrt(square) if light.w else Float(1)
    # At the light itself there is no direction: any will do.
    cosine = dr.dot(toward, unit) * dr.rcp(dr.maximum(r, 1e-15))
    strength = (dr.rcp(dr.maximum(square, least)) if light.w else Float(1)) * _profile(light, point)
    if view.features.bounded:
        depths = [dr.zeros(Float, dr.width(point)) for _ in medium.sigma_t]
        kept = path_transmittance(medium, light, depths=depths, point=point, active=active & (strength > 0))
    else:
        kept = transmittance(medium, r)
    return light.intensity * (strength * kept), cosine


def _profile(light: Light, point: Any) -> Any:
    """Return the relative intensity of a light towards points."""
    if light.cone is None:
        return type(point.x)(1)
    away = dr.normalize(point - light.position)
    inside = dr.dot(light.axis, away) > light.cos_cutoff
    if not light.soft:
        return dr.select(inside, type(point.x)(1), 0)
    # The point lies at x = 0 of a ray that starts there.
    return dr.select(inside, falloff(ray_geometry(point, away, light), light, type(point.x)(0)), 0)
