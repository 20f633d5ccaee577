# SPDX-License-Identifier: BSD-3-Clause
r"""Light samples of a source as methods ask them, and their shadow maps.

**Which fraction of an area light reaches the visible surfaces**, and how wide
its penumbrae are there.

The mean over N light samples has N + 1 levels. Points of a sphere face different ways: there each
counts with its cosine at the light over the square of its distance, as it counts in the irradiance.

The width of a penumbra follows from similar triangles (Fernando 2005, PCSS): of a light of the
width L, an edge at the distance d_b and a surface at d_r from it,

    w = L (d_r - d_b) / d_b,

with d_b what a map holds in the direction of the surface, where that is nearer than it. Over the
light samples and the neighbours of a pixel the geometric mean of w is taken: where edges at several
distances shadow a pixel, the narrow penumbrae count, which a wide filter would smear. Widths change
slowly, so that they are looked for in few pixels.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.image_filters import Guide, Raster, separable, small_pixels, upsample
from airlight.realtime.methods.interface.method import View
from airlight.realtime.methods.soft_shafts.parameters import SoftShaftsParameters
from airlight.realtime.numerics.array_types import two_numbers
from airlight.realtime.scene.camera import Camera
from airlight.realtime.scene.light_table import LightTable
from airlight.realtime.shadow_maps.hemisphere_map import HemisphereMaps, cast_hemisphere_maps
from airlight.realtime.shadow_maps.shadow_map import ShadowMap, cast_shadow_map


@dataclass(frozen=True)
class SourceState:
    """The state of one source, made again when lights or shapes move."""

    width: Any  #: of an area light, of a square with its mean square extent [m]
    maps: HemisphereMaps | ShadowMap | None  #: None where nobody asks them


def source_state(
    scene: Any, lights: LightTable, size: int, *, with_maps: bool, for_surfaces: bool = True
) -> SourceState:
    """Return the state of a source of some `lights`.

    `size`: texels on a side of its maps; `with_maps`: whether it needs any; `for_surfaces`: whether
    points on surfaces ask them, not only points in the air.
    """
    light = lights.rows
    # A source of one point has no width and no samples that face anywhere; its state is one shadow
    # map.
    if light.facing is None:
        maps = cast_shadow_map(scene, light, size) if with_maps else None
        return SourceState(dr.opaque(type(light.position.x), 0, 1), maps)
    # The mean square distance from the middle of a square of the side L is L^2 / 6. It stays on the
    # device.
    spread = sum(dr.mean(dr.square(column - dr.mean(column))) for column in light.position)
    hemispheres = None
    if with_maps:
        hemispheres = cast_hemisphere_maps(scene, lights, size, for_surfaces=for_surfaces)
    width = dr.sqrt(6 * spread)
    dr.eval(width)
    return SourceState(width, hemispheres)


@dataclass(frozen=True)
class Fraction:
    """The part of an area light that each ray takes: one light sample,
    with a shift of its steps.
    """

    number: Any  #: of the light sample
    shift: Any  #: of the steps, from 0 to 1 of one


#: c of hd = c w / N: what smooths the staircase of N levels best (its test fits it again).
AUTO_WIDTH = 0.4
#: The same where pixels share the points, whose mean over a tile is no staircase:
#: the least error in `fence`.
AUTO_WIDTH_SHARED = 1.6


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
    lights: LightTable,
    number_of: Callable[[Any], Any],
    count: int,
    p: SoftShaftsParameters,
    asked: Any = True,
) -> Reached:
    """Return the part of an area light that reaches `asked` surfaces of a view; others return 0.

    `view`: the rays, row by row; `state`, `lights`: the light and its samples; `number_of`,
    `count`: which light sample each ray asks first, second and so on, counted from 0, and how many;
    `p`: the parameters.
    """
    Float = type(view.distance)
    mask = dr.isfinite(view.distance) & asked
    # Rays without a surface, and those that are not asked, stand at the camera: finite, and masked.
    place = view.origin + view.direction * dr.select(mask, view.distance, 0)

    def of_sample(index: Any) -> list[Any]:
        return _reached_of_sample(view, state, lights, place, mask, number_of(index), p)

    if count == 1:
        return Reached(*of_sample(mi.UInt32(0)))

    def add(index: Any, sums: Any):
        return index + 1, [
            so_far + term for so_far, term in zip(sums, of_sample(index), strict=True)
        ]

    _, sums = dr.while_loop(
        state=(mi.UInt32(0), [dr.zeros(Float, dr.width(view.distance)) for _ in range(2)]),
        cond=lambda index, sums: mask & (index < count),
        body=add,
        labels=("index", "sums"),
    )
    return Reached(*sums)


def _reached_of_sample(
    view: View,
    state: SourceState,
    lights: LightTable,
    place: Any,
    mask: Any,
    number: Any,
    p: SoftShaftsParameters,
) -> list[Any]:
    """Return the terms of one light sample in the sums of `Reached`."""
    light = lights[number]
    away = place - light.position
    square = dr.squared_norm(away)
    # Where pixels share no samples, samples that face one way count alike: the fraction has N + 1
    # levels.
    alike = lights.flat and not p.interleave
    weight = 1 if alike else dr.maximum(dr.dot(away, light.normal), 0) / (square * dr.sqrt(square))
    if not view.features.shadows:
        lit = mask
    elif p.surfaces == "map":
        assert isinstance(state.maps, HemisphereMaps)
        lit = state.maps.of(number, light).lit_surface(place)
    else:
        lit = view.visible(place, light, mask)
    return [
        dr.select(mask & lit, type(square)(weight), 0),
        dr.select(mask, type(square)(weight), 0),
    ]


def few_pixels(raster: Raster) -> tuple[Raster, int]:
    """Return the image of the pixels in which penumbrae are looked for, and the step from one
    of these pixels to the next [pixels].
    """
    # Widths change slowly: one pixel in 4 x 4 is enough, where 4 divides the sides of the image.
    step = 4 if raster.width % 4 == 0 and raster.height % 4 == 0 else 1
    return Raster(raster.width // step, raster.height // step), step


def penumbra_width(
    blockers: Any, distance: Any, camera: Camera, width: Any, raster: Raster, *, guide: Guide
) -> Any:
    """Return how wide the penumbra of a light is about every pixel [pixels], 0
    where nothing blocks it.

    `blockers`: from `blockers_of`, in the pixels of `few_pixels`; `distance`: how far all surfaces
    of the image are, row by row [m]; `camera`, `width`: of the image, and how wide the light is
    [m]; `raster`: the image; `guide`: of the depth.
    """
    few, step = few_pixels(raster)
    dr.eval(guide.values)
    few_guide = Guide(
        dr.gather(type(distance), guide.values, small_pixels(few, step, raster.width)),
        guide.width,
    )
    # Pixels take the width from their neighbours, with a standard deviation of 4 pixels. The sum of
    # logarithms and the count are divided by the same sum of weights, which cancels in their ratio.
    search = 4.0
    sums = separable(blockers, few, hd=search / step, guides=(few_guide,), support=2.0)
    dr.eval(sums, few_guide.values)
    column, row = raster.places()
    near, blocked = upsample(sums, few_guide, guide.values, few, scale=step, column=column, row=row)
    # The geometric mean of (d_r - d_b)/d_b, and 0 where hardly any sample is blocked nearby.
    mean = dr.select(blocked > 1e-4, dr.exp(near / dr.maximum(blocked, 1e-4)), 0)
    # A pixel is as wide as this at the distance of the surface [m], and w = L times the mean.
    pixel = dr.norm(camera.left) * dr.select(dr.isfinite(distance), distance, 1)
    return width * mean / pixel


def blockers_of(view: View, state: SourceState, lights: LightTable) -> Any:
    """Return the sum of log((d_r - d_b) / d_b) over the light samples that something
    blocks, and how many these are.

    `view`: rays to surfaces; `state`, `lights`: the light, with its maps, and its samples.
    """
    Float, maps = type(view.distance), state.maps
    assert isinstance(maps, HemisphereMaps)
    hit = dr.isfinite(view.distance)
    place = view.origin + view.direction * dr.select(hit, view.distance, 0)

    def add(number: Any, near: Any, blocked: Any):
        # (d_r - d_b) / d_b by the map of the sample. Up to 1 % the map shows the surface itself;
        # and a surface behind the plane of the sample gets nothing from it anyway.
        light = lights[number]
        beyond = maps.of(number, light).beyond(place, hit)
        before = hit & (beyond > 0.01) & (dr.dot(place - light.position, light.normal) > 0)
        return (
            number + 1,
            near + dr.select(before, dr.log(beyond), 0),
            blocked + dr.select(before, Float(1), 0),
        )

    nothing = dr.zeros(Float, dr.width(view.distance))
    _, near, blocked = dr.while_loop(
        state=(mi.UInt32(0), nothing, +nothing),
        cond=lambda number, near, blocked: number < lights.count,
        body=add,
        labels=("number", "near", "blocked"),
    )
    return two_numbers(Float)(near, blocked)
