# SPDX-License-Identifier: BSD-3-Clause
"""The light that reaches a point of each froxel and is scattered there towards the camera.

With P that point, r its distance from the light, T the transmittance from there and V the
visibility, a froxel holds

    S = 1/(4 pi) sum_lights I V T / max(r^2, b^2)  sum_media c albedo sigma_t p        [W/(m^3 sr)],

c the fraction of the froxel that the medium fills. For a directional light,
I / r^2 is the irradiance.

About a light 1/r^2 has no bound, though its mean over a froxel has. With a half the diagonal of the
froxel, the mean of 1/r^2 over a ball of the radius a about the light is

    3/(4 pi a^3) int_0^a (1/r^2) 4 pi r^2 dr = 3/a^2.

Hence b^2 = a^2/3: a froxel that holds the light has about the mean, froxels away from the light
hardly change, and b vanishes with the size of the froxels.

With `jitter=frames` frame n samples at the middle of a froxel plus a place from -1/2 to 1/2 on each
of three sides, n times the additive recurrence of Roberts in three dimensions, 1/g, 1/g^2, 1/g^3
with g^4 = g + 1, from a random place of the run on, modulo 1.

References
----------
Roberts 2018, *The unreasonable effectiveness of quasirandom sequences*.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.methods.froxel_fog.grid import Grid
from airlight.realtime.methods.interface.method import View
from airlight.realtime.numerics.array_types import PerRay
from airlight.realtime.rays import profile
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.integrate import half_angles
from airlight.realtime.scene.media.medium import Rays

#: (point, number of a table) -> function (light, its number in the table) ->
#: whether it reaches the point.
Visibility = Callable[[Any, int], Callable[[Light, Any], Any]]


@dataclass(frozen=True)
class FroxelPoints:
    """The points at which froxels are lit, one entry each."""

    point: Any  #: [m]
    unit: Any  #: from the camera there, of unit length
    least: Any  #: b^2 [m^2]
    rays: Rays  #: the middle ray of the column
    ends: tuple[Any, Any]  #: where it enters and leaves the froxel [m]


def frame_shift(view: View) -> tuple[Any, Any, Any]:
    """Return by how much the samples of a frame are moved from the middles of
    froxels, in parts of a froxel.
    """
    # n/g, n/g^2 and n/g^3 modulo 1 as whole numbers of 32 bits, which wrap by themselves; taken
    # with a sign they lie from -1/2 to 1/2.
    growth = 1.2207440846057596  # g^4 = g + 1
    steps = tuple(round(2**32 / growth**power) % 2**32 for power in (1, 2, 3))
    Float, begin = type(view.distance), view.random.of_run()
    across, down, deep = (
        Float(mi.Int32(word + view.frame * mi.UInt32(step))) * 2.0**-32
        for word, step in zip(begin, steps, strict=False)
    )
    return across, down, deep


def scattered_light(
    view: View,
    grid: Grid,
    rays: Rays,
    *,
    shift: tuple[Any, Any, Any],
    visible: Visibility,
) -> PerRay:
    """Return the light that each froxel scatters to the camera, a colour [W/(m^3 sr)].

    `view`, `grid`, `rays`: the frame, its froxels, and the middle rays of columns; `shift`: of the
    points from the middles of the froxels, in parts of a froxel across, down and in depth;
    `visible`: which light reaches which point.
    """
    # The points do not depend on the light: they are found once for all tables.
    points = _froxel_points(view, grid, rays, shift)
    total = dr.zeros(type(view.medium.albedo), grid.columns * grid.slices)

    for place, table in enumerate(view.tables):
        # `visible` is asked once a table; the light and its number come with each row.
        reaches = visible(points.point, place)

        def scattered(light: Light, number: Any, reaches: Any = reaches) -> Any:
            lit = reaches(light, number) if view.features.shadows else True
            return light.intensity * _weight(view, light, points, lit)

        total = table.sum(scattered, total)
    return view.medium.unit * total * (0.25 * dr.inv_pi)


def _froxel_points(view: View, grid: Grid, rays: Rays, shift: tuple[Any, Any, Any]) -> FroxelPoints:
    Float = type(view.distance)
    # Slice by slice, column by column within a slice, as `accumulated` gathers them.
    lane = dr.arange(mi.UInt32, grid.columns * grid.slices)
    number = lane // grid.columns
    column = lane - number * grid.columns
    ray = grid.column_ray(column, shift[:2])
    begin, end = (
        grid.depth(Float(number) / grid.slices),
        grid.depth((Float(number) + 1) / grid.slices),
    )
    # The sample lies on the ray that is shifted across, in depth between both ends of the froxel.
    point = dr.fma(ray, dr.lerp(begin, end, 0.5 + shift[2]), view.origin)
    # The medium between the ends of the froxel is that along the middle ray, where it was found for
    # all slices of the column at once.
    middle = grid.column_ray(column)
    length = dr.norm(middle)
    direction = middle / length
    rays = Rays(view.origin, direction, direction, dr.gather(tuple, rays.crossed, column))
    unit = ray * dr.rsqrt(dr.squared_norm(ray))
    return FroxelPoints(
        point, unit, _least_square(grid, begin, end), rays, (begin * length, end * length)
    )


def _least_square(grid: Grid, begin: Any, end: Any) -> Any:
    """Return b^2 of froxels between two depths [m^2]."""
    camera = grid.camera
    depth = 0.5 * (begin + end)
    # b^2 = a^2/3 with a^2 a quarter of the squared diagonal, whose parts are across, at the middle
    # depth, and along the axis.
    across = dr.squared_norm(camera.left * (camera.width / grid.width)) + dr.squared_norm(
        camera.up * (camera.height / grid.height)
    )
    return (across * dr.square(depth) + dr.square(end - begin)) / 12


def _weight(view: View, light: Light, points: FroxelPoints, lit: Any) -> Any:
    """Return S for unit intensity without its factor 1/(4 pi), in parts of the medium's `unit`."""
    medium, Float = view.medium, type(view.distance)
    toward = light.toward(points.point)
    square = dr.squared_norm(toward)
    r = dr.sqrt(square) if light.w else Float(1)
    # At the light itself there is no direction: any will do.
    unit = toward * dr.rsqrt(dr.maximum(square, 1e-30))
    strength = (dr.rcp(dr.maximum(square, points.least)) if light.w else Float(1)) * profile(
        light, points.point, -unit
    )
    # c albedo sigma_t p of all media in parts of `unit`, one value for each froxel. Narrow lobes
    # need both halves of the angle: a cosine has lost them.
    down, up = half_angles(unit, points.unit)
    value = strength * medium.mean_source(
        points.rays, *points.ends, lambda phase: phase.evaluate_half(down, up)
    )
    # The depth to the light is walked only where some light arrives and is scattered.
    some = lit & (sum(value) > 0 if dr.depth_v(value) > 1 else value > 0)
    depths = medium.depth_to_light(light, points.point, r, active=some)
    return dr.select(some, value * medium.transmittance(depths), 0)
