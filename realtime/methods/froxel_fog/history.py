# SPDX-License-Identifier: BSD-3-Clause
"""From frame to frame: the samples move within their froxels, and what they found is averaged over the frames.

Frame n samples at the middle of a froxel plus (n alpha mod 1), which lies in [-1/2, 1/2) on each of three sides, with
alpha the additive recurrence of Roberts in three dimensions: 1/g, 1/g^2, 1/g^3, where g^4 = g + 1. The first frame
samples the middles.

A froxel holds then the mean of frames, the newest with the weight 1 - h:

    S_n = (1 - h) S + h S_{n-1}(P).

P is the middle of the froxel, looked up where the last frame's camera saw it; what it did not see starts anew. A change
of the light is forgotten like h^n: to within a share e after log e / log h frames. That is the ghost.

References
----------
Roberts 2018, *The unreasonable effectiveness of quasirandom sequences*. Wronski 2014, *Volumetric fog: unified, compute
shader based solution to atmospheric scattering*.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.methods.froxel_fog.grid import Grid, trilinear
from realtime.numerics.array_types import PerRay, four_numbers, packed

_GROWTH = 1.2207440846057596  # g^4 = g + 1
_STEPS = tuple(round(2**32 / _GROWTH**power) % 2**32 for power in (1, 2, 3))


@dataclass(frozen=True)
class FroxelHistory:
    """What a frame leaves to the next one."""

    volume: Any  #: what each froxel scattered, four numbers each [W/(m^3 sr)]
    grid: Grid
    frame: Any  #: how many frames there were


def frame_shift(last: FroxelHistory | None, Float: Any) -> tuple[Any, Any, Any]:
    """Return by how much the samples of the frame after `last` are moved, in parts of a froxel."""
    if last is None:
        return Float(0), Float(0), Float(0)
    across, down, deep = (Float(mi.Int32(last.frame * mi.UInt32(step))) * 2.0**-32 for step in _STEPS)
    return across, down, deep


def averaged(
    scattered: PerRay, grid: Grid, last: FroxelHistory | None, *, weight: float
) -> tuple[PerRay, FroxelHistory]:
    """Return the mean of what froxels scatter in this frame and in those before, and what to hand on.

    `scattered`: of this frame, a colour [W/(m^3 sr)]; `grid`: of this frame; `last`: what the last frame handed on;
    None for the first; `weight`: h, of the history.
    """
    Float, Color = type(grid.far), type(scattered)
    if last is None:
        frame = dr.opaque(mi.UInt32, 1)
    else:
        before, seen = _before(grid, last)
        scattered = dr.select(seen, dr.lerp(scattered, Color(before), weight), scattered)
        frame = last.frame + 1
    volume = packed(four_numbers(Float)(scattered.x, scattered.y, scattered.z, 0))
    return scattered, FroxelHistory(volume, grid, frame)


def _before(grid: Grid, last: FroxelHistory) -> tuple[Any, Any]:
    """Return what the last frame held at the middles of froxels, and whether it saw them."""
    Float = type(grid.far)
    lane = dr.arange(mi.UInt32, grid.columns * grid.slices)
    number = lane // grid.columns
    ray = grid.column_ray(lane - number * grid.columns)
    point = dr.fma(ray, grid.depth((Float(number) + 0.5) / grid.slices), grid.camera.origin)
    u, v, depth = last.grid.place(point)
    s = last.grid.share(dr.maximum(depth, 0))
    seen = (depth > 0) & (s <= 1) & (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
    size = grid.width, grid.height, grid.slices
    steps = [dr.fma(place, count, -0.5) for place, count in zip((u, v, s), size)]
    return trilinear(last.volume, size, (steps[0], steps[1], steps[2])), seen
