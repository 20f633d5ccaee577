# SPDX-License-Identifier: BSD-3-Clause
"""Soft shafts: airlight and surfaces under area lights, from few light samples and filters.

Ali 2016 takes 3 or 5 points of a light, a shadow map for each, the mean of their visibilities in
N + 1 levels, few steps along each ray, and a bilateral filter of what comes out (its SBFS and
SoftBiF-VS); its realTiSoftLS computes airlight in fewer pixels. It prints no equation: all is
reconstructed from captions, and the defaults are those of its Fig. 4.9.

The stages of a frame:

1. `prepare`: a table of the light samples, and their maps.
2. Airlight of every `scale`-th pixel by `steps` steps for each point, a number per ray and light.
3. The bilateral filter, on log(1 + L / mean L), and joint up-sampling with a depth test.
4. The fraction of each light that reaches each pixel's surface, and its filter, before anything is
   shaded.
5. The frame multiplies the unshadowed surface by that fraction and adds the airlight,
   both in linear radiance.

With `interleave` each pixel of a tile of 4 x 4 takes one of the points and a shift of the steps of
its own; the mean over the tile, by depth, is that of all points and of sixteen times as many steps.
The mean of the fraction is a ratio of two means (Heitz, Hill, McGuire 2018): what a tile does not
shadow is not noisy.

Lights without extent are one point. Their surfaces are lit by shadow rays and
have no penumbra to filter.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.errors import InputError
from airlight.realtime.image_filters import (
    Guide,
    Raster,
    airlight_guide,
    bilateral,
    bilateral_of_levels,
    depth_guide,
    separable,
    small_pixels,
    tile_average,
    upsample,
)
from airlight.realtime.methods.interface.marching import marched_integral
from airlight.realtime.methods.interface.method import Layers, View
from airlight.realtime.methods.soft_shafts.parameters import AUTO, SoftShaftsParameters
from airlight.realtime.methods.soft_shafts.sources import (
    AUTO_WIDTH,
    AUTO_WIDTH_SHARED,
    Fraction,
    Reached,
    SourceState,
    blockers_of,
    few_pixels,
    penumbra_width,
    reached_surfaces,
    source_state,
)
from airlight.realtime.numerics.array_types import two_numbers
from airlight.realtime.scene.light_table import LightTable, lights_apart
from airlight.realtime.scene.lights import Light
from airlight.realtime.shadow_maps.hemisphere_map import HemisphereMaps, maps_memory
from airlight.realtime.shadow_maps.shadow_map import check_maps, lit_in_map, map_memory

_MOST_AUTO = 8.0  # the widest filter of hd=auto [pixels]
# its narrowest, and that where pixels share the points [pixels]
_LEAST_AUTO, _LEAST_SHARED = 0.3, 0.5
_GROUP = 4  # how many light samples a pixel of a narrow penumbra asks


@dataclass(frozen=True)
class SoftShafts(SoftShaftsParameters):
    """The airlight of every ray, and the fraction of each light that reaches its surface.

    References
    ----------
    Ali 2016, reconstructed from captions: Figs. 4.8, 4.9 (points, `hd`, `hr`),
    4.19 (taps), 5.8 (R1 to R4).
    """

    def check(self, scene):
        """Refuse a `scale` that does not divide the image, more samples than share a
        tile, and maps without room.
        """
        camera = scene.camera
        size, scale = self.map, self.scale
        if camera.width % scale or camera.height % scale:
            raise InputError(
                f"scale: got {scale} and an image of {camera.width} x {camera.height}, expected "
                "one that divides both "
                "sides"
            )
        most = max(lights.count for lights in lights_apart(scene.tables, by_source=True))
        if self.interleave and (most > 16 or 16 % most):
            raise InputError(
                f"interleave: got {most} points of a light, expected 1, 2, 4, 8 or 16, of which a "
                "tile has each"
            )
        if self._with_maps and scene.features.shadows:
            one = maps_memory(type(camera.origin.x), 1, size)
            needed = sum(
                map_memory(light, size) if light.facing is None else one for light in scene.lights
            )
            check_maps(scene.lights, size, needed)

    @property
    def _with_maps(self) -> bool:
        return self.shadow == "map" or self.surfaces == "map" or self.hd == AUTO

    def preparation(self, scene):
        """Return a function for the tables of light samples of a frame, and their maps:
        a record for each source.
        """
        asked = {
            "with_maps": self._with_maps and scene.features.shadows,
            "for_surfaces": self.surfaces == "map",
        }

        def prepare(now):
            sources = lights_apart(now.tables, by_source=True)
            return tuple(
                source_state(now.geometry, lights, self.map, **asked) for lights in sources
            )

        return prepare

    def render(self, view, state, kernel):
        """Return the layers of every ray."""
        frame = _Frame(view, state, self)
        total, visibility = dr.zeros(type(view.medium.albedo), dr.width(view.pixel)), []
        for number, lights in enumerate(lights_apart(view.tables, by_source=True)):
            total += frame.airlight(number, lights)
            visibility.append(frame.visibility(number, lights))
        return Layers(total, tuple(visibility))


class _Frame:
    """The images of one frame while it is recorded: all pixels row by row, and the few that
    airlight is computed in.
    """

    def __init__(
        self, view: View, states: tuple[SourceState, ...], parameters: SoftShaftsParameters
    ):
        width, height, scale = view.camera.width, view.camera.height, parameters.scale
        self.view, self.parameters = view, parameters
        self.states = states
        self.raster = Raster(width, height)
        depth = dr.empty(type(view.distance), width * height)
        dr.scatter(depth, view.distance, view.pixel)

        def rays(pixel: Any) -> View:
            return view.of_pixels(pixel, dr.gather(type(depth), depth, pixel))

        self.rays = rays
        self.whole = rays(dr.arange(mi.UInt32, width * height))
        self.few_raster = Raster(width // scale, height // scale)
        self.few = rays(small_pixels(self.few_raster, scale, width))
        self.depth = depth_guide(self.whole.distance, parameters.hz)
        self.few_depth = depth_guide(self.few.distance, parameters.hz)

    def airlight(self, number: int, lights: LightTable) -> Any:
        """Return the radiance that a source scatters into every ray, in the order of the view."""
        view, p, few = self.view, self.parameters, self.few
        state, like = self.states[number], lights[mi.UInt32(0)]

        def of_sample(index: Any, shift: Any = 0.5) -> Any:
            light = lights[index]
            how: dict[str, Any] = {
                "steps": p.steps,
                "spacing": p.spacing,
                "lit": self._lit(state, light, index),
            }
            return marched_integral(few.lit_by(light), few.distance, shift=shift, **how)

        if like.facing is None:
            integral = of_sample(0)
        elif p.interleave:
            fraction = self._fraction(self.few_raster, lights.count)
            integral = lights.count * of_sample(fraction.number, fraction.shift)
            integral = tile_average(integral, self.few_raster, guides=(self.few_depth,))
        else:
            nothing = few.lit_by(like).nothing(dr.width(few.distance))
            integral = lights.sum(lambda _, index: of_sample(index), nothing)
        integral = _smooth_airlight(integral, self.few_raster, depth=self.few_depth, p=p)
        dr.eval(integral, self.few_depth)
        if p.scale == 1:
            integral = dr.gather(type(integral), integral, view.pixel)
        else:
            row = view.pixel // self.raster.width
            place = {"column": view.pixel - row * self.raster.width, "row": row}
            own = depth_guide(view.distance, p.hz)
            integral = upsample(
                integral, self.few_depth, own.values, self.few_raster, scale=p.scale, **place
            )
        return view.medium.radiance(like, integral)

    def visibility(self, number: int, lights: LightTable) -> Any:
        """Return the fraction of a source that reaches the surfaces, or a function for
        that of each of its lights.
        """
        view, p, whole = self.view, self.parameters, self.whole
        if not view.features.shadows or not view.features.surfaces:
            return True
        there = dr.isfinite(view.distance)
        point = view.origin + view.direction * dr.select(there, view.distance, 0)
        if lights.rows.facing is None:
            # Twenty units in the last place towards the camera: rounded behind its surface,
            # a point is in its shadow.
            before = view.origin + view.direction * dr.select(there, view.distance * (1 - 2e-6), 0)
            return there & view.visible(before, lights.rows)
        state = self.states[number]
        if p.filter == "none" and not p.interleave:
            # Without a filter each point keeps its own fraction, and the sum is exact.
            return lambda light, place: there & self._reached(state, place, light, point)
        if p.interleave:
            number = self._fraction(self.raster, lights.count).number
            own = reached_surfaces(whole, state, lights, lambda _: number, 1, p)
            if p.narrow:
                # With the means over tiles: who asks for it later would cast its rays again.
                dr.schedule(own.lit, own.all)
            lit = self._over_tiles(own).fraction
        else:
            lit = reached_surfaces(
                whole, state, lights, lambda index: index, lights.count, p
            ).fraction
        if p.hd == AUTO:
            dr.eval(lit)
            width = self._penumbra_width(state, lights)
            dr.eval(width)
            if p.interleave and p.narrow:
                lit = self._where_narrow(lit, width, own, number, state, lights)
                del own  # two images that the filter needs not
            lit = self._smooth_by_width(lit, width, lights.count)
        elif p.filter != "none":
            there, levels = dr.isfinite(whole.distance), lights.flat and not p.interleave
            lit = _smooth_fraction(
                lit,
                self.raster,
                there=there,
                depth=self.depth,
                points=lights.count,
                levels=levels,
                p=p,
            )
        lit = dr.clip(lit, 0, 1)
        dr.eval(lit)
        return dr.gather(type(lit), lit, view.pixel)

    def _penumbra_width(self, state: SourceState, lights: LightTable) -> Any:
        few, step = few_pixels(self.raster)
        blockers = blockers_of(self.rays(small_pixels(few, step, self.raster.width)), state, lights)
        distance, camera = self.whole.distance, self.view.camera
        return penumbra_width(
            blockers, distance, camera, state.width, self.raster, guide=self.depth
        )

    def _over_tiles(self, reached: Reached) -> Reached:
        """Return the means over a tile: the fraction is then one mean over another."""
        sums = two_numbers(type(self.view.distance))(reached.lit, reached.all)
        return Reached(*tile_average(sums, self.raster, guides=(self.depth,)))

    def _where_narrow(
        self,
        lit: Any,
        width: Any,
        own: Reached,
        number: Any,
        state: SourceState,
        lights: LightTable,
    ) -> Any:
        """Return the fraction, with the rest of each pixel's group of light samples
        where penumbrae are narrow.

        Adjacent pixels lie in different groups of `_GROUP` light samples; the filter that follows
        combines four groups. A pixel has already tested one sample of its group.
        """
        p = self.parameters
        group = min(_GROUP, lights.count)
        asked = (lit > 0) & (lit < 1) & (width < p.narrow)

        def other(index: Any) -> Any:
            return number // group * group + (number + 1 + index) % group

        more = reached_surfaces(self.whole, state, lights, other, group - 1, p, asked)
        lit = dr.select(asked, Reached(own.lit + more.lit, own.all + more.all).fraction, lit)
        dr.eval(lit)
        return lit

    def _smooth_by_width(self, lit: Any, width: Any, points: int) -> Any:
        p = self.parameters
        fraction, least = (
            (AUTO_WIDTH_SHARED, _LEAST_SHARED) if p.interleave else (AUTO_WIDTH, _LEAST_AUTO)
        )
        hd = dr.clip(fraction / points * width, least, _MOST_AUTO)
        return separable(
            lit, self.raster, hd=hd, guides=(self.depth,), support=2.0, most=_MOST_AUTO
        )

    def _lit(self, state: SourceState, light: Light, number: Any) -> Callable[[Any], Any]:
        """Return a test of whether a light of a number in its source reaches the
        few rays at distances [m].
        """
        view, p, maps = self.few, self.parameters, state.maps
        if not view.features.shadows or p.shadow == "none":
            return lambda x: True
        if p.shadow == "ray":
            return lambda x: view.visible(view.at(x), light)
        if isinstance(maps, HemisphereMaps):
            return maps.of(number, light).lit_along(view)
        assert maps is not None
        return lambda x: lit_in_map(maps, light, view.at(x))

    def _reached(self, state: SourceState, number: Any, light: Light, point: Any) -> Any:
        if self.parameters.surfaces == "ray":
            return self.view.visible(point, light)
        assert isinstance(state.maps, HemisphereMaps)
        return state.maps.of(number, light).lit_surface(point)

    def _fraction(self, raster: Raster, samples: int) -> Fraction:
        """Return which light sample each pixel takes, and how far its steps are shifted."""
        column, row = raster.places()
        # The order of ordered dithering (Bayer 1973): pixels side by side are far apart in it,
        # and so are their points.
        other = column ^ row
        order = (other & 1) * 8 + (row & 1) * 4 + (other & 2) + ((row & 2) >> 1)
        # Another lattice, so that the shifts of neighbouring points are far apart too.
        shift = (order * 7 + 3) & 15
        return Fraction(order % samples, (type(self.view.distance)(shift) + 0.5) / 16)


def _smooth_fraction(
    fraction: Any,
    raster: Raster,
    *,
    there: Any,
    depth: Guide,
    points: int,
    levels: bool,
    p: SoftShaftsParameters,
) -> Any:
    """Return the fraction of a light that reaches the surfaces, filtered.

    `fraction`: from 0 to 1, row by row; `raster`: the image; `there`: where there are surfaces: the
    sky takes no part; `depth`: the guide of their depth; `points`, `levels`: N, and whether the
    fraction has N + 1 levels; `p`: the parameters, with a filter whose `hd` is a number.
    """
    if p.filter == "gauss" or p.guide == "self":
        hr = math.inf if p.filter == "gauss" else p.hr
        if levels:
            return bilateral_of_levels(
                fraction, raster, levels=points, hd=p.width, hr=hr, there=there
            )
        # The sky is unlike all surfaces.
        sky = Guide(dr.select(there, type(fraction)(0), 1), 1e-3)
        guides = (sky,) if math.isinf(hr) else (sky, Guide(fraction, hr))
        return _filtered(fraction, raster, guides, p.width)
    return _filtered(fraction, raster, (depth,), p.width)


def _smooth_airlight(
    integral: Any, raster: Raster, *, depth: Guide, p: SoftShaftsParameters
) -> Any:
    """Return airlight filtered; `hd` counts pixels of the full image,
    whatever the scale of this one.
    """
    if p.filter == "none" or p.hd == AUTO:
        return integral
    guides: tuple[Guide, ...] = ()
    if p.filter == "bilateral" and p.guide == "depth":
        guides = (depth,)
    elif p.filter == "bilateral" and not math.isinf(p.hr):
        guides = (airlight_guide(integral, p.hr),)
    return _filtered(integral, raster, guides, p.width / p.scale)


def _filtered(image: Any, raster: Raster, guides: tuple[Guide, ...], hd: float) -> Any:
    return (bilateral if guides else separable)(image, raster, hd=hd, guides=guides)
