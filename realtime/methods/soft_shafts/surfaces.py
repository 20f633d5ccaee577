# SPDX-License-Identifier: BSD-3-Clause
"""Which share of a light with extent reaches the visible surfaces, and how wide its penumbrae are there.

The mean over N light points has N + 1 levels. Points of a sphere face different ways: there each counts with its cosine
at the light over the square of its distance, as it counts in the irradiance.

The width of a penumbra follows from similar triangles (Fernando 2005, PCSS): of a light of the width L, an edge at the
distance d_b and a surface at d_r from it,

    w = L (d_r - d_b) / d_b,

with d_b the mean of what the maps hold in the direction of the surface, where that is nearer than it. A pixel that all
points reach, or whose blocker the maps do not see, takes the width of its neighbours.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.image_filters.guides import Guide
from realtime.image_filters.raster import Raster
from realtime.image_filters.separable import separable
from realtime.image_filters.upsample import small_pixels, upsample
from realtime.methods.interface.view import View
from realtime.methods.soft_shafts.light_sources import SourceState, frame_at
from realtime.methods.soft_shafts.parameters import AUTO, SoftShaftsParameters
from realtime.numerics.array_types import two_numbers
from realtime.shadow_maps.hemisphere_map import HemisphereMaps

#: c of hd = c w / N: what smooths the staircase of N levels best (`tests/.../test_auto_width.py` fits it again).
AUTO_WIDTH = 0.4
#: The same where pixels share the points, whose mean over a tile is no staircase: the least error in `fence`.
AUTO_WIDTH_SHARED = 1.2
_STEP = 4  # pixels from one place where the width is looked for to the next
_SEARCH = 4.0  # how far pixels take the width of a penumbra from their neighbours, a standard deviation [pixels]
_NEARER = 0.01  # what is this much nearer to the light than a surface, of its own distance, is not that surface


@dataclass(frozen=True)
class Reached:
    """What of a light reaches the visible surfaces, row by row."""

    lit: Any  #: sum of the weights of the light points that reach them
    all: Any  #: sum of all weights
    near: Any  #: sum of (d_r - d_b) / d_b over the points that something blocks
    blocked: Any  #: how many these are

    @property
    def share(self) -> Any:
        """From 0 to 1; 1 where no point could reach the surface."""
        return dr.select(self.all > 0, self.lit / self.all, 1)


def reached_surfaces(
    view: View,
    state: SourceState,
    number_of: Callable[[Any], Any],
    count: int,
    p: SoftShaftsParameters,
    asked: Any = True,
) -> Reached:
    """Return what of a light with extent reaches the surfaces of a view, where they are `asked` for.

    Parameters
    ----------
    view
        The rays, row by row.
    state
        The light.
    number_of, count
        Which light point each ray asks first, second and so on, counted from 0, and how many.
    p
        The parameters.
    asked
        Which rays are asked for; the others return 0.
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
        state=(mi.UInt32(0), [dr.zeros(Float, dr.width(view.distance)) for _ in range(4)]),
        cond=lambda index, sums: there & (index < count),
        body=add,
        labels=("index", "sums"),
    )
    return Reached(*sums)


def _of_point(view: View, state: SourceState, place: Any, there: Any, number: Any, p: SoftShaftsParameters) -> Any:
    """Return what one light point adds to each sum of `Reached`."""
    Float = type(view.distance)
    frame = frame_at(state.frames, number)
    a, b, c = frame.local(place - frame.position)
    square = dr.fma(a, a, dr.fma(b, b, c * c))
    r = dr.sqrt(square)
    weight = Float(1) if state.flat and share_is_plain(p) else dr.maximum(c, 0) / (square * r)
    near = blocked = Float(0)
    if state.maps is not None and (p.hd == AUTO or p.surfaces == "map"):
        assert isinstance(state.maps, HemisphereMaps)
        if p.hd == AUTO:
            beyond = state.maps.beyond(number, (a, b, c), there)
            before = there & (beyond > _NEARER) & (c > 0)
            near, blocked = dr.select(before, beyond, 0), dr.select(before, Float(1), 0)
    if not view.features.shadows:
        lit = there
    elif p.surfaces == "map":
        assert isinstance(state.maps, HemisphereMaps)
        lit = state.maps.lit_surface(number, (a, b, c))
    else:
        lit = view.visible(place, frame)
    return [dr.select(there & lit, weight, 0), dr.select(there, weight, 0), near, blocked]


def share_is_plain(p: SoftShaftsParameters) -> bool:
    """Return whether every light point counts alike, so that the share has N + 1 levels."""
    return not p.interleave


def penumbra_width(view: View, reached: Reached, state: SourceState, raster: Raster, *, guide: Guide) -> Any:
    """Return how wide the penumbra of a light is about every pixel [pixels], 0 where nothing blocks it.

    Parameters
    ----------
    view
        The rays, row by row.
    reached, state
        The light.
    raster
        The image.
    guide
        Of the depth.
    """
    # Widths change slowly: one pixel of some is enough to look about, where these divide the image.
    step = _STEP if raster.width % _STEP == 0 and raster.height % _STEP == 0 else 1
    few = Raster(raster.width // step, raster.height // step)
    chosen = small_pixels(few, step, raster.width)
    dr.eval(reached.near, reached.blocked, guide.values)
    near, blocked, alike = (
        dr.gather(type(values), values, chosen) for values in (reached.near, reached.blocked, guide.values)
    )
    few_guide = Guide(alike, guide.width)
    # The mean over a neighbourhood of what is there: both are divided by the same sum of weights.
    sums = two_numbers(type(view.distance))(near, blocked)
    sums = separable(sums, few, hd=_SEARCH / step, guides=(few_guide,), support=2.0)
    dr.eval(sums, few_guide.values)
    column, row = raster.places()
    near, blocked = upsample(sums, few_guide, guide.values, few, scale=step, column=column, row=row)
    mean = dr.select(blocked > 1e-4, near / dr.maximum(blocked, 1e-4), 0)
    pixel = dr.norm(view.camera.left) * dr.select(dr.isfinite(view.distance), view.distance, 1)
    return state.width * mean / pixel
