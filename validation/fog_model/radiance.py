# SPDX-License-Identifier: BSD-3-Clause
"""The fog of a scene with the laws as they are read, and the radiance of every pixel.

With the lengths c_k to the camera and l_k to the light in the medium k, a node in the medium m adds

    albedo_m sigma_m I p_m(cos) / (4 pi)  weight / r^2  exp(-sum_k sigma_k (a c_k + b l_k)),

where a and b are the fractions of the extinction that attenuate the segment to the camera and the
segment to the light, 1 if correct. A surface point adds its radiance times the same exponential.
Visibility is fixed. Where a light is moved by d and its paths are not, a node at r v from the place
where the paths begin (v of unit length, w along the ray) has

    r' = |r v - d|,    cos = -(r v - d) . w / r',

and the lengths of its segment change as r'/r, which is right where the medium has no bounds. In
height fog a path counts by its length times the mean density between its ends
(`analytic.height_fog`), and one to a directional light by the column above over the cosine of the
light's height; the extinction is then a factor on that density.

A fog may have light without lights: an ambient light A adds the sum of albedo sigma exp(-a tau) A
along a ray, in a stretch of one medium albedo A (exp(-a tau_0) - exp(-a tau_1))/a; and a constant
source C (1 - exp(-a tau)) stands for the light of all lights.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from airlight.analytic.height_fog import HeightFog
from airlight.analytic.phase import HenyeyGreenstein
from airlight.reference.quadrature.height_fog import fog_of
from airlight.reference.quadrature.intervals import camera_segments
from airlight.reference.scene.directional_light import DirectionalLight
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.scene.varying import HeightMedium
from airlight.validation.arrays import Array, Index
from airlight.validation.fog_model.laws import Falloff
from airlight.validation.fog_model.places import AROUND, Places, lengths
from airlight.validation.fog_model.view import Ends, LightPaths, View

Colour = tuple[float, float, float]
Path = tuple[str | int, ...]  #: of a number in a fog: fields, and places in tuples
#: of the cosine of the scattering angle, of mean 1 over the sphere
PhaseLaw = Callable[[Array], Array]
Record = TypeVar("Record")  #: a frozen dataclass


def put(whole: Record, path: Path, value: object) -> Record:
    """Return a copy of a record with another value at a path of fields, and places in tuples."""
    # Records are copied from the value at the end of the path outwards: none of them is changed.
    changed: Record = _copied(whole, path, value)
    return changed


def _copied(whole: Any, path: Path, value: object) -> Any:
    if not path:
        return value
    first, rest = path[0], path[1:]
    if isinstance(first, str):
        return replace(whole, **{first: _copied(getattr(whole, first), rest, value)})
    return (*whole[:first], _copied(whole[first], rest, value), *whole[first + 1 :])


@dataclass(frozen=True)
class Fog:
    """Media, lights and laws. Tuples have an entry for each medium, the medium without bounds
    first, or for each light.
    """

    sigma_t: tuple[Colour, ...]  #: extinction [1/m]; of height fog a factor on its density
    albedo: tuple[Colour, ...]  #: single-scattering albedo [1]
    #: g of Henyey and Greenstein's function, or a law; None: the scene's
    phase: tuple[float | PhaseLaw | None, ...]
    intensity: tuple[float, ...]  #: factors on the lights [1]
    airlight: tuple[float, ...]  #: factors on what the media scatter of each light [1]
    surface: tuple[float, ...]  #: factors on what surfaces reflect of each light [1]
    moved: tuple[Colour, ...]  #: how far the lights are from where the paths begin, x, y, z [m]
    exposure: Colour = (1.0, 1.0, 1.0)  #: factor on the image [1]
    #: Fractions of the extinction that attenuate the way to the camera, and the way from the light:
    #: of what the medium scatters, and of what surfaces reflect [1].
    camera_segment: tuple[float, float] = (1.0, 1.0)
    light_segment: tuple[float, float] = (1.0, 1.0)
    #: length of a further path that attenuates what the medium scatters, with the extinction at the
    #: place that scatters [m]
    light_length: float = 0.0
    #: the medium is missing before this plane, along the camera's axis [m]
    near: float = 0.0
    far: float = np.inf  #: it ends at this plane, or at this distance [m]
    spherical: bool = False  #: whether `near` and `far` are distances from the camera, not planes
    reach: float = 1.0  #: fraction of the distance of surfaces at which rays end [1]
    #: Where depth along the axis is taken for distance along the ray: 'nodes' and 'surfaces' in
    #: what attenuates them, 'steps' in the length of ray that a node stands for, 'ends' where rays
    #: end; 'lookup': rays end where their depth is the distance of the surface.
    planar: frozenset[str] = frozenset()
    #: factor on the light of a point light by the distance from it, of another law than 1/r^2: in
    #: the fog, and on surfaces
    law: tuple[Falloff | None, Falloff | None] = (None, None)
    window: Falloff | None = None  #: factor on the light of lamps with a range
    #: distances from lamps at which their light has corners: nodes lie between them [m]
    corners: tuple[float, ...] = ()
    #: factors of an equation on what media scatter of each light, and on no other light; none: 1
    strength: tuple[float, ...] = ()
    #: whether lamps scatter without a phase function: it is 4 pi
    bare: bool = False
    #: depths at which a factor along a line on what the medium scatters is 1 and 0 [m]
    fade: tuple[float, float] | None = None
    ambient: Colour = (0.0, 0.0, 0.0)  #: light that all of the fog scatters [W/(m^2 sr)]
    #: the colour of opaque fog, in the place of the light of all lights [W/(m^2 sr)]
    constant: Colour | None = None
    most: float = 1.0  #: the most that such a fog covers [1]
    #: power of the cosine about directional lights in such a fog, and where it begins [m]
    lobe: tuple[float, float] | None = None
    #: factor k: the light X of lights is 1 - exp(-k X) in the image
    lit: float | None = None
    #: how the density of the medium without bounds depends on height
    height: HeightFog | None = None
    up: Colour = (0.0, 0.0, 1.0)  #: unit vector along which heights are

    def put(self, path: Path, value: object) -> "Fog":
        """Return the fog with another number, given by fields and by places in tuples,
        such as ('moved', 0, 2).
        """
        return put(self, path, value)

    @property
    def ends(self) -> Ends | None:
        """Between which distances rays have nodes; None where that is all of every ray."""
        end = next((word for word in ("ends", "lookup") if word in self.planar), "")
        faded = np.inf if self.fade is None else self.fade[1]
        ends = Ends(self.near, self.far, self.spherical, end, faded, self.corners, self.reach)
        return None if ends == Ends() else ends

    @property
    def without_factors(self) -> "Fog":
        """The fog without what multiplies the light of each source or changes their sum, see
        `combined`.
        """
        one = (1.0,) * len(self.intensity)
        return replace(
            self, intensity=one, airlight=one, surface=one, exposure=(1.0, 1.0, 1.0), lit=None
        )

    def combined(self, by_light: Array) -> Array:
        """Return airlight and surfaces, (2, m, 3), from what `FogModel.by_light` returns."""
        # Axes of the sum: k the layer, l the light, p the pixel, c the channel.
        factors = np.array([self.airlight, self.surface]) * np.array(self.intensity)
        layers = np.einsum("kl,klpc->kpc", factors, by_light[:, :-1])
        # With a constant source the light of lights is its lobes, which no density makes.
        if self.lit is not None and self.constant is None:
            layers[0] = -np.expm1(-self.lit * layers[0])
        # Light without lights has the factor that the fog of all lights has.
        shared = self.airlight[0] if len(set(self.airlight)) == 1 else 1.0
        return np.asarray((layers + shared * by_light[:, -1]) * np.array(self.exposure))


def scene_fog(reference: ReferenceScene) -> Fog:
    """Return the fog as the scene has it."""
    media, medium = (reference.medium, *reference.media), reference.medium
    height, up = (
        (fog_of(medium), colour(medium.up))
        if isinstance(medium, HeightMedium)
        else (None, (0.0, 0.0, 1.0))
    )
    # Lights are counted as in `view.light_sources`. In height fog the density carries the
    # extinction, so that 1 stands in its place.
    one = (1.0,) * (len(reference.lights) + len(reference.directional) + len(reference.area))
    return Fog(
        sigma_t=tuple(colour(each.sigma_t) for each in media)
        if height is None
        else ((1.0, 1.0, 1.0),),
        albedo=tuple(colour(medium.albedo) for medium in media),
        phase=tuple(
            medium.phase.g if isinstance(medium.phase, HenyeyGreenstein) else None
            for medium in media
        ),
        intensity=one,
        airlight=one,
        surface=one,
        moved=((0.0, 0.0, 0.0),) * len(one),
        height=height,
        up=up,
    )


def colour(values: Iterable[float]) -> Colour:
    """Return three numbers as a tuple."""
    red, green, blue = (float(value) for value in values)
    return red, green, blue


def henyey_greenstein(g: float) -> PhaseLaw:
    """Return Henyey and Greenstein's phase function, of mean 1."""
    return lambda cosine: (1 - g * g) / (1 + g * g - 2 * g * cosine) ** 1.5


@dataclass(frozen=True)
class FogModel:
    """The paths of some pixels, and the radiance that a fog gives these."""

    view: View
    lights: tuple[LightPaths, ...]
    _phases: dict[tuple[int, int], Array] = field(default_factory=dict, repr=False)

    @property
    def places(self) -> int:
        """How many nodes and surface points there are."""
        return sum(len(light.nodes.r) + len(light.surface.r) for light in self.lights)

    def layers(self, fog: Fog) -> Array:
        """Return the radiance of airlight and surfaces, (2, m, 3) [W/(m^2 sr)]."""
        return fog.combined(self.by_light(fog.without_factors))

    def by_light(self, fog: Fog) -> Array:
        """Return airlight and surfaces from each light, and last what no light sends,
        (2, lights + 1, m, 3) [W/(m^2 sr)]; no number is out of range.
        """
        # Extreme parameters of a search overflow: values out of range become a number whose square
        # is a number too, so that its loss can be computed.
        largest = 1e100
        view = self.view
        radiance = np.zeros((2, len(self.lights) + 1, len(view.pixels), 3))
        with np.errstate(over="ignore", invalid="ignore"):
            for number, light in enumerate(self.lights):
                for layer, places in enumerate((light.nodes, light.surface)):
                    strength = fog.strength[number] if fog.strength and layer == 0 else 1.0
                    if fog.constant is not None and layer == 0:
                        radiance[0, number] = self._lobe(fog, number) * light.intensity
                    elif len(places.r) and strength:  # 0 times infinity is no number
                        sums = self._sums(places, fog, number)
                        radiance[layer, number] = sums * (strength * light.intensity)
            radiance[0, -1] = self._without_lights(fog)
        # Each pixel has the sum over its rays so far: the mean is this sum over their number.
        radiance *= len(view.pixels) / len(view.ray_pixel)
        return np.nan_to_num(radiance, nan=largest, posinf=largest, neginf=-largest)

    def transmittance(self, fog: Fog) -> Array:
        """Return how much of what is behind it the fog leaves, the mean over each pixel, (m, 3) [1].

        It is the factor that surfaces have, and one less the opacity by which fog is blended. Where
        surfaces are not attenuated it is by the way of the fog to the camera, and where that is not
        either, by the extinction itself: fog has an opacity even if it does not dim.
        """
        fraction = next((each for each in reversed(fog.camera_segment) if each), 1.0)
        depth = fraction * self._depth(fog, *self._ray_ends(fog))
        if "surfaces" in fog.planar and "ends" not in fog.planar:
            depth = depth * (self.view.reference.direction @ self.view.axis)[:, None]
        left = self._of_pixels(np.maximum(np.exp(-depth), 1 - fog.most))
        return left / np.bincount(self.view.ray_pixel)[:, None]

    # Light without lights, of whole rays.

    def _of_pixels(self, values: Array) -> Array:
        """Return the sums of values of rays, (rays, 3), over those of each pixel, (m, 3)."""
        return np.stack([np.bincount(self.view.ray_pixel, column) for column in values.T], axis=1)

    def _lobe(self, fog: Fog, number: int) -> Array | float:
        """Return the lobe of a directional light of irradiance 1 in fog of one colour, (m, 3)."""
        sun = self._sun(number)
        if fog.lobe is None or sun is None:
            return 0.0
        power, start = fog.lobe
        # The lobe has a beginning of its own, on rays that reach the fog.
        begin, end = self._ray_ends(fog)
        end = np.where(end > begin, end, 0.0)
        begin = np.full_like(end, start)
        towards = np.maximum(self.view.reference.direction @ -sun.direction, 0.0)
        opacity = -np.expm1(-self._fraction(fog) * self._depth(fog, begin, np.maximum(end, begin)))
        return self._of_pixels((towards**power)[:, None] * opacity)

    def _without_lights(self, fog: Fog) -> Array:
        """Return the airlight that no light sends, the sum over the rays of each pixel, (m, 3)."""
        begin, end = self._ray_ends(fog)
        total = np.zeros((len(begin), 3))
        if any(fog.ambient):
            total += np.array(fog.ambient) * self._scattered(fog, begin, end)
        if fog.constant is not None:
            opacity = -np.expm1(-self._fraction(fog) * self._depth(fog, begin, end))
            total += np.array(fog.constant) * np.minimum(opacity, fog.most)
        return self._of_pixels(total)

    def _fraction(self, fog: Fog) -> Array:
        """Return the fraction of the depths of rays that attenuates what they scatter, (rays, 1)."""
        flat = self.view.reference.direction @ self.view.axis if "nodes" in fog.planar else 1.0
        count = len(self.view.reference.direction)
        return np.broadcast_to(fog.camera_segment[0] * flat, (count,))[:, None]

    def _ray_ends(self, fog: Fog) -> tuple[Array, Array]:
        """Return the distances at which the fog of rays begins and ends, (rays,) each [m]."""
        slant = 1 / (self.view.reference.direction @ self.view.axis)
        return _way(fog, slant, self.view.distance, ends_at_surface=True)

    def _depth(self, fog: Fog, low: Array, high: Array) -> Array:
        """Return the optical depth of rays between two distances, (rays, 3) [1]; 0 where the second
        is not beyond the first. It may be infinite.
        """
        reference, inside = self.view.reference, high > low
        low = np.where(inside, low, 0.0)
        high = np.where(inside, high, low)
        if fog.height is not None:
            # A horizontal ray stays at its height, even if it is unbounded: 0 times infinity is not
            # a number. The length becomes the depth in a density of 1.
            origin, rise = reference.origin @ fog.up, reference.direction @ fog.up
            z0, z1 = (origin + np.where(rise == 0, 0.0, rise * x) for x in (low, high))
            length = fog.height.along(z0, z1, high - low, rise)[:, None]
        else:
            length, before = (
                lengths(reference, reference.origin, reference.direction, x) for x in (high, low)
            )
            length = length - before
            length[np.isinf(high), AROUND] = np.inf
        # A medium that does not attenuate a channel does so over any length, even an infinite one:
        # it is left out there.
        depth = [length[:, own > 0] @ own[own > 0] for own in np.array(fog.sigma_t).T]
        return np.stack(depth, axis=1)

    def _scattered(self, fog: Fog, begin: Array, end: Array) -> Array:
        """Return the sum of albedo sigma exp(-a tau) along rays, (rays, 3) [1]."""
        reference, albedo = self.view.reference, np.array(fog.albedo)
        # The parts of rays in each medium, which the reference counts from 0, and -1 around them.
        if isinstance(reference.medium, HeightMedium):
            spans = [(begin, end, np.zeros(len(begin), np.int64))]
        else:
            parts = camera_segments(reference, end)
            spans = list(zip(parts.start, parts.end, parts.medium + 1, strict=True))
        total, fraction = np.zeros((len(begin), 3)), self._fraction(fog)
        for start, stop, medium in spans:
            low = np.clip(start, begin, end)
            high = np.clip(stop, low, np.maximum(end, low))
            before, depth = self._depth(fog, begin, low), self._depth(fog, low, high)
            with np.errstate(divide="ignore"):
                fallen = np.exp(-fraction * before) * -np.expm1(-fraction * depth) / fraction
            total += albedo[medium] * np.where(fraction > 0, fallen, depth)
        if "steps" in fog.planar:
            total *= (reference.direction @ self.view.axis)[:, None]
        return total

    # Light of lights, from nodes and surface points.

    def _sums(self, places: Places, fog: Fog, number: int) -> Array:
        """Return the light from the places to each pixel, for intensity 1, (m, 3)."""
        # `slant` is the length of a ray over its depth along the axis of the camera; `away` leads
        # from the light to the places [m].
        view, sun = self.view, self._sun(number)
        layer = int(places.is_surface)
        direction, pixel = view.reference.direction[places.ray], view.ray_pixel[places.ray]
        slant = 1 / (direction @ view.axis)
        r, cosine, light, away = (
            places.r,
            places.cosine,
            places.light,
            places.towards * places.r[:, None],
        )
        # A light that is moved by d with its paths held: r' = |r v - d| and
        # cos = -(r v - d) . w / r' of the module, and its path grows with r'/r in every medium.
        if any(fog.moved[number]):
            away = away - np.array(fog.moved[number])
            r = np.linalg.norm(away, axis=1)
            cosine = -np.sum(away * direction, axis=1) / r if len(cosine) else cosine
            light = light * (r / places.r)[:, None]
        # The radiance of surface points contains 1/r^2, which is taken out for the law of the fog;
        # the weight of nodes has no distance in it. A march that takes steps of depth for steps of
        # distance makes the nodes' lengths of ray shorter by `slant`.
        strength = _falls(r, fog, layer) if sun is None else np.ones_like(r)
        if places.is_surface:
            strength = strength * places.r**2
        else:
            strength = (
                strength
                * places.value[:, 0]
                / (4 * np.pi * (slant if "steps" in fog.planar else 1.0))
            )
            if fog.fade is not None:
                full, none = fog.fade
                strength *= np.maximum((none - places.x / slant) / (none - full), 0.0)
        # The lengths to the camera, or the depths that are taken for them, within the near and far
        # ends of the fog.
        begin, end = _way(fog, slant, places.x, ends_at_surface=places.is_surface)
        camera, log_density = places.camera, np.zeros(len(places.r))
        if np.any(begin > 0) or np.any(end != places.x):
            camera = self._camera_lengths(places.ray, begin, end)
        if ("surfaces" if places.is_surface else "nodes") in fog.planar and not (
            places.is_surface and "ends" in fog.planar
        ):
            camera = camera / slant[:, None]
        if fog.height is not None:
            camera, light, log_density = self._by_height(
                places, fog, sun, (begin, end), camera, light, away
            )
        # Both ways together, as lengths in each medium. A way that does not attenuate may have an
        # infinite length.
        ways = fog.camera_segment[layer] * camera
        if fog.light_segment[layer]:
            ways = ways + fog.light_segment[layer] * light
        if fog.light_length and not places.is_surface:
            ways[np.arange(len(ways)), places.medium] += fog.light_length * np.exp(log_density)
        total, sigma_t, count = (
            np.zeros((len(view.pixels), 3)),
            np.array(fog.sigma_t),
            len(view.pixels),
        )
        # One exponential serves all channels of the same extinction. A node whose exponent is no
        # number, such as 0 times an infinite length, sends nothing.
        for channels in _alike(fog):
            exponent = log_density - ways @ sigma_t[:, channels[0]]
            if places.is_surface and fog.most < 1:
                # A source that covers no more than its cap leaves the rest of the surface behind it.
                depth = fog.camera_segment[layer] * camera @ sigma_t[:, channels[0]]
                exponent += np.maximum(depth + np.log1p(-fog.most), 0.0)
            attenuated = strength * np.exp(np.nan_to_num(exponent, nan=-np.inf, neginf=-np.inf))
            if places.is_surface:
                for channel in channels:
                    total[:, channel] = np.bincount(
                        pixel, attenuated * places.value[:, channel], count
                    )
                continue
            # Albedo and extinction of a medium multiply the sum over the nodes in it.
            for medium in range(len(sigma_t)):
                nodes = slice(None) if len(sigma_t) == 1 else places.medium == medium
                phase = self._phase(places, number, medium, fog, cosine)[nodes]
                summed = np.bincount(pixel[nodes], attenuated[nodes] * phase, count)
                for channel in channels:
                    total[:, channel] += (
                        fog.albedo[medium][channel] * sigma_t[medium, channel] * summed
                    )
        return total

    def _camera_lengths(self, ray: Index, begin: Array, end: Array) -> Array:
        """Return the lengths of parts of rays in each medium, (n, media) [m]."""
        reference = self.view.reference
        if not reference.media:
            return (end - begin)[:, None]
        whole, before = (
            lengths(reference, reference.origin, reference.direction[ray], x) for x in (end, begin)
        )
        return whole - before

    def _sun(self, number: int) -> DirectionalLight | None:
        """Return the directional light of a number; None for a light that has a place."""
        # Lights count point and spot lights first, then directional ones, then area lights.
        reference = self.view.reference
        numbers = range(len(reference.lights), len(reference.lights) + len(reference.directional))
        return reference.directional[number - numbers.start] if number in numbers else None

    def _by_height(
        self,
        places: Places,
        fog: Fog,
        sun: DirectionalLight | None,
        between: tuple[Array, Array],
        camera: Array,
        light: Array,
        away: Array,
    ) -> tuple[Array, Array, Array]:
        """Return lengths that in a density of 1 have the depths of height fog, and the
        logarithm of its density.

        `between`: distances at which the way to the camera ends and begins, (n,) each [m]; `away`
        is from the light to the places, (n, 3) [m]. Surfaces scatter by no density.
        """
        reference, density = self.view.reference, fog.height
        assert density is not None
        origin, rise = reference.origin @ fog.up, reference.direction[places.ray] @ fog.up
        z, begin, end = (origin + x * rise for x in (places.x, *between))
        camera, light = camera.copy(), light.copy()
        camera[:, AROUND] = density.optical_depth(begin, end, camera[:, AROUND])
        if sun is not None:
            # The column above a place over the sine of the light's height over the horizon.
            light[:, AROUND] = density.column(z) / max(float(-sun.direction @ fog.up), 1e-300)
        else:
            light[:, AROUND] = density.optical_depth(z - away @ fog.up, z, light[:, AROUND])
        return camera, light, np.zeros_like(z) if places.is_surface else density.log_density(z)

    def _phase(self, places: Places, number: int, medium: int, fog: Fog, cosine: Array) -> Array:
        if fog.bare and self._sun(number) is None:
            return np.full(len(cosine), 4 * np.pi)
        law = fog.phase[medium]
        if isinstance(law, float):
            return henyey_greenstein(law)(cosine)
        if law is not None:
            return law(np.clip(cosine, -1, 1))
        # The scene's own phase function is evaluated once, at the scattering angles of the paths:
        # it does not change, not even where a light moves a little.
        key = number, medium
        if key not in self._phases:
            reference = self.view.reference
            phase = (reference.medium, *reference.media)[medium].phase
            self._phases[key] = (
                np.ones(len(cosine)) if phase.is_constant else phase(np.clip(places.cosine, -1, 1))
            )
        return self._phases[key]


def _way(fog: Fog, slant: Array, x: Array, *, ends_at_surface: bool) -> tuple[Array, Array]:
    """Return where in the fog the way from the camera to places at distances x begins and ends,
    distances along the rays, (n,) each [m].

    `slant`: lengths of rays over their depth along the camera's axis, (n,). A plane at the depth z
    is at the distance z times `slant`.
    """
    end = x * fog.reach if ends_at_surface else x
    if ends_at_surface and "ends" in fog.planar:
        end = end / slant
    elif ends_at_surface and "lookup" in fog.planar:
        end = end * slant
    along = np.ones_like(slant) if fog.spherical else slant
    if np.isfinite(fog.far):
        end = np.minimum(end, fog.far * along)
    return np.minimum(fog.near * along, end), end


def _falls(r: Array, fog: Fog, layer: int) -> Array:
    """Return how the light of a source that has a place falls with the distance from it, (n,)."""
    # Squares of shorter distances are no numbers of use: a law that ends at the light has none.
    r = np.maximum(r, 1e-100)
    falls = r**-2
    for factor in (fog.law[layer], fog.window):
        if factor is not None:
            falls = falls * factor(r)
    return np.asarray(falls)


def _alike(fog: Fog) -> list[list[int]]:
    """Return the channels in groups of the same extinction: one exponential is enough for each."""
    groups: dict[tuple[float, ...], list[int]] = {}
    for channel in range(3):
        groups.setdefault(tuple(colours[channel] for colours in fog.sigma_t), []).append(channel)
    return list(groups.values())
