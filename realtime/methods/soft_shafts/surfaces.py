# SPDX-License-Identifier: BSD-3-Clause
"""Which fraction of an area light reaches the visible surfaces, and how wide its penumbrae are there.

The mean over N light samples has N + 1 levels. Points of a sphere face different ways: there each counts with its
cosine at the light over the square of its distance, as it counts in the irradiance.

The width of a penumbra follows from similar triangles (Fernando 2005, PCSS): of a light of the width L, an edge at the
distance d_b and a surface at d_r from it,

    w = L (d_r - d_b) / d_b,

with d_b what a map holds in the direction of the surface, where that is nearer than it. Over the light samples and the
neighbours of a pixel the geometric mean of w is taken: where edges at several distances shadow a pixel, the narrow
penumbrae count, which a wide filter would smear. Widths change slowly, so that they are looked for in few pixels.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.image_filters import Guide, Raster, separable, small_pixels, upsample
from realtime.methods.interface.method import View
from realtime.methods.soft_shafts.march import SourceState
from realtime.methods.soft_shafts.parameters import SoftShaftsParameters
from realtime.numerics.array_types import two_numbers
from realtime.scene.camera import Camera
from realtime.scene.light_samples import frame_at
from realtime.shadow_maps.hemisphere_map import HemisphereMaps

#: c of hd = c w / N: what smooths the staircase of N levels best (`tests/.../test_auto_width.py` fits it again).
AUTO_WIDTH = 0.4
#: The same where pixels share the points, whose mean over a tile is no staircase: the least error in `fence`.
AUTO_WIDTH_SHARED = 1.6
_STEP = 4  # pixels from one place where the width is looked for to the next
_SEARCH = 4.0  # how far pixels take the width of a penumbra from their neighbours, a standard deviation [pixels]
_NEARER = 0.01  # what is this much nearer to the light than a surface, of its own distance, is not that surface


@dataclass(frozen=True)
class Reached:
    """The light samples that reach the visible surfaces, row by row."""

    lit: Any  #: sum of the weights of the light samples that reach them
    all: Any  #: sum of all weights

    @property
    def fraction(self) -> Any:
        """From 0 to 1; 1 where no sample could reach the surface."""
        return dr.select(self.all > 0, self.lit / self.all, 1)


def reached_surfaces(
    view: View,
    state: SourceState,
    number_of: Callable[[Any], Any],
    count: int,
    p: SoftShaftsParameters,
    asked: Any = True,
) -> Reached:
    """Return the part of an area light that reaches `asked` surfaces of a view; others return 0.

    `view`: the rays, row by row; `state`: the light; `number_of`, `count`: which light sample each ray asks first,
    second and so on, counted from 0, and how many; `p`: the parameters.
    """
    Float = type(view.distance)
    there = dr.isfinite(view.distance) & asked
    place = view.origin + view.direction * dr.select(there, view.distance, 0)
    if count == 1:
        return Reached(*_of_point(view, state, place, there, number_of(mi.UInt32(0)), p))

    def add(index: Any, sums: Any):
        more = _of_point(view, state, place, there, number_of(index), p)
        return index + 1, [so_far + term for so_far, term in zip(sums, more, strict=True)]

    _, sums = dr.while_loop(
        state=(mi.UInt32(0), [dr.zeros(Float, dr.width(view.distance)) for _ in range(2)]),
        cond=lambda index, sums: there & (index < count),
        body=add,
        labels=("index", "sums"),
    )
    return Reached(*sums)


def _of_point(view: View, state: SourceState, place: Any, there: Any, number: Any, p: SoftShaftsParameters) -> Any:
    """Return the terms of one light sample in the sums of `Reached`."""
    Float = type(view.distance)
    frame = frame_at(state.frames, number)
    a, b, c = frame.local(place - frame.position)
    square = dr.fma(a, a, dr.fma(b, b, c * c))
    r = dr.sqrt(square)
    weight = Float(1) if state.flat and fraction_is_plain(p) else dr.maximum(c, 0) / (square * r)
    if not view.features.shadows:
        lit = there
    elif p.surfaces == "map":
        assert isinstance(state.maps, HemisphereMaps)
        lit = state.maps.lit_surface(number, (a, b, c))
    else:
        lit = view.visible(place, frame, there)
    return [dr.select(there & lit, weight, 0), dr.select(there, weight, 0)]


def fraction_is_plain(p: SoftShaftsParameters) -> bool:
    """Return whether every light sample counts alike, so that the fraction has N + 1 levels."""
    return not p.interleave


def few_pixels(raster: Raster) -> tuple[Raster, int]:
    """Return the image of the pixels in which penumbrae are looked for, and how many pixels it is to the next one."""
    # One pixel of some is enough to look about, where these divide the image.
    step = _STEP if raster.width % _STEP == 0 and raster.height % _STEP == 0 else 1
    return Raster(raster.width // step, raster.height // step), step


def penumbra_width(blockers: Any, distance: Any, camera: Camera, width: Any, raster: Raster, *, guide: Guide) -> Any:
    """Return how wide the penumbra of a light is about every pixel [pixels], 0 where nothing blocks it.

    `blockers`: from `blockers_of`, in the pixels of `few_pixels`; `distance`: how far all surfaces of the image are,
    row by row [m]; `camera`, `width`: of the image, and how wide the light is [m]; `raster`: the image; `guide`: of the
    depth.
    """
    few, step = few_pixels(raster)
    dr.eval(guide.values)
    few_guide = Guide(
        dr.gather(type(distance), guide.values, small_pixels(few, step, raster.width)),
        guide.width,
    )
    # The mean over a neighbourhood of what is there: both are divided by the same sum of weights.
    sums = separable(blockers, few, hd=_SEARCH / step, guides=(few_guide,), support=2.0)
    dr.eval(sums, few_guide.values)
    column, row = raster.places()
    near, blocked = upsample(sums, few_guide, guide.values, few, scale=step, column=column, row=row)
    mean = dr.select(blocked > 1e-4, dr.exp(near / dr.maximum(blocked, 1e-4)), 0)
    pixel = dr.norm(camera.left) * dr.select(dr.isfinite(distance), distance, 1)
    return width * mean / pixel


def blockers_of(view: View, state: SourceState, count: int) -> Any:
    """Return the sum of log((d_r - d_b) / d_b) over the light samples that something blocks, and how many these are.

    `view`: rays to surfaces; `state`, `count`: the light, with its maps, and how many points it has.
    """
    Float = type(view.distance)
    there = dr.isfinite(view.distance)
    place = view.origin + view.direction * dr.select(there, view.distance, 0)

    def add(number: Any, near: Any, blocked: Any):
        assert isinstance(state.maps, HemisphereMaps)
        frame = frame_at(state.frames, number)
        local = frame.local(place - frame.position)
        beyond = state.maps.beyond(number, local, there)
        before = there & (beyond > _NEARER) & (local[2] > 0)
        return number + 1, near + dr.select(before, dr.log(beyond), 0), blocked + dr.select(before, Float(1), 0)

    nothing = dr.zeros(Float, dr.width(view.distance))
    _, near, blocked = dr.while_loop(
        state=(mi.UInt32(0), nothing, +nothing),
        cond=lambda number, near, blocked: number < count,
        body=add,
        labels=("number", "near", "blocked"),
    )
    return two_numbers(Float)(near, blocked)
