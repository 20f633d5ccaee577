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
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from airlight.analytic.height_fog import HeightFog
from airlight.analytic.phase import HenyeyGreenstein
from airlight.reference.quadrature.height_fog import fog_of
from airlight.reference.scene.directional_light import DirectionalLight
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.scene.varying import HeightMedium
from airlight.validation.arrays import Array
from airlight.validation.fog_model.places import AROUND, Places
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
    #: the medium without bounds is missing before this plane, along the camera's axis [m]
    near: float = 0.0
    far: float = np.inf  #: it ends at this plane, or at this distance [m]
    spherical: bool = False  #: whether `near` and `far` are distances from the camera, not planes
    #: Where depth along the axis is taken for distance along the ray: 'nodes' and 'surfaces' in
    #: what attenuates them, 'steps' in the length of ray that a node stands for, 'ends' where rays
    #: end.
    planar: frozenset[str] = frozenset()
    distance_power: float = 2.0  #: the irradiance falls as the distance to this power [1]
    #: factor on the light by the distance from it [m]
    window: Callable[[Array], Array] | None = None
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
        """Between which distances rays are in the fog; None where all of every ray is in it."""
        if "ends" in self.planar:
            return 0.0, np.inf, "depth"
        bounded = self.near > 0 or np.isfinite(self.far)
        return (self.near, self.far, "spheres" if self.spherical else "planes") if bounded else None

    @property
    def without_factors(self) -> "Fog":
        """The fog without the factors that multiply the light of each source, see `combined`."""
        one = (1.0,) * len(self.intensity)
        return replace(self, intensity=one, airlight=one, surface=one, exposure=(1.0, 1.0, 1.0))

    def combined(self, by_light: Array) -> Array:
        """Return airlight and surfaces, (2, m, 3), from what `FogModel.by_light` returns."""
        # Axes of the sum: k the layer, l the light, p the pixel, c the channel.
        factors = np.array([self.airlight, self.surface]) * np.array(self.intensity)
        return np.asarray(np.einsum("kl,klpc->kpc", factors, by_light) * np.array(self.exposure))


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
        """Return airlight and surfaces from each light, (2, lights, m, 3) [W/(m^2 sr)];
        no number is out of range.
        """
        # Extreme parameters of a search overflow: values out of range become a number whose square
        # is a number too, so that its loss can be computed.
        largest = 1e100
        view = self.view
        radiance = np.zeros((2, len(self.lights), len(view.pixels), 3))
        with np.errstate(over="ignore", invalid="ignore"):
            for number, light in enumerate(self.lights):
                for layer, places in enumerate((light.nodes, light.surface)):
                    if len(places.r):
                        radiance[layer, number] = self._sums(places, fog, number) * light.intensity
        # Each pixel has the sum over its rays so far: the mean is this sum over their number.
        radiance *= len(view.pixels) / len(view.ray_pixel)
        return np.nan_to_num(radiance, nan=largest, posinf=largest, neginf=-largest)

    def transmittance(self, fog: Fog) -> Array:
        """Return the transmittance of the rays up to their ends, the mean over each pixel,
        (m, 3) [1].
        """
        view = self.view
        length = _between_ends(view.length, fog, 1 / (view.reference.direction @ view.axis))
        if fog.height is not None:
            # In height fog the length becomes the optical depth of the ray. A horizontal ray stays
            # at its height, even if it is unbounded: 0 times infinity is not a number.
            origin, rise = view.reference.origin @ fog.up, view.reference.direction @ fog.up
            end = origin + np.where(rise == 0, 0.0, rise * length[:, AROUND])
            length[:, AROUND] = fog.height.along(origin, end, length[:, AROUND], rise)
        # A medium that does not attenuate a channel does so over any length, even an infinite one:
        # it is left out there.
        depth = [length[:, own > 0] @ own[own > 0] for own in np.array(fog.sigma_t).T]
        count = np.bincount(view.ray_pixel)
        return np.stack(
            [np.bincount(view.ray_pixel, np.exp(-column)) / count for column in depth], axis=1
        )

    def _sums(self, places: Places, fog: Fog, number: int) -> Array:
        """Return the light from the places to each pixel, for intensity 1, (m, 3)."""
        # `slant` is the length of a ray over its depth along the axis of the camera; `away` leads
        # from the light to the places [m].
        view = self.view
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
        strength = _falls(r, fog) if self._sun(number) is None else np.ones_like(r)
        if places.is_surface:
            strength = strength * places.r**2
        else:
            strength = (
                strength
                * places.value[:, 0]
                / (4 * np.pi * (slant if "steps" in fog.planar else 1.0))
            )
        # The lengths to the camera, or the depths that are taken for them, within the near and far
        # ends of the medium without bounds.
        flat = ("surfaces" if places.is_surface else "nodes") in fog.planar
        camera = _between_ends(
            places.camera / slant[:, None] if flat else places.camera, fog, slant
        )
        log_density = np.zeros(len(places.r))
        if fog.height is not None:
            camera, light, log_density = self._by_height(places, fog, number, camera, light, away)
        total, sigma_t, count = (
            np.zeros((len(view.pixels), 3)),
            np.array(fog.sigma_t),
            len(view.pixels),
        )
        # One exponential serves all channels of the same extinction. A node whose exponent is no
        # number, such as 0 times an infinite length, sends nothing.
        for channels in _alike(fog):
            depth = (
                fog.camera_segment[layer] * camera + fog.light_segment[layer] * light
            ) @ sigma_t[:, channels[0]]
            attenuated = strength * np.exp(
                np.nan_to_num(log_density - depth, nan=-np.inf, neginf=-np.inf)
            )
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

    def _sun(self, number: int) -> DirectionalLight | None:
        """Return the directional light of a number; None for a light that has a place."""
        # Lights count point and spot lights first, then directional ones, then area lights.
        reference = self.view.reference
        numbers = range(len(reference.lights), len(reference.lights) + len(reference.directional))
        return reference.directional[number - numbers.start] if number in numbers else None

    def _by_height(
        self, places: Places, fog: Fog, number: int, camera: Array, light: Array, away: Array
    ) -> tuple[Array, Array, Array]:
        """Return lengths that in a density of 1 have the depths of height fog, and the
        logarithm of its density.

        `away` is from the light to the places, (n, 3) [m]. Surfaces scatter by no density.
        """
        reference, density = self.view.reference, fog.height
        assert density is not None
        origin = reference.origin @ fog.up
        z = origin + places.x * (reference.direction[places.ray] @ fog.up)
        camera, light, sun = camera.copy(), light.copy(), self._sun(number)
        camera[:, AROUND] = density.optical_depth(origin, z, camera[:, AROUND])
        if sun is not None:
            # The column above a place over the sine of the light's height over the horizon.
            light[:, AROUND] = density.column(z) / max(float(-sun.direction @ fog.up), 1e-300)
        else:
            light[:, AROUND] = density.optical_depth(z - away @ fog.up, z, light[:, AROUND])
        return camera, light, np.zeros_like(z) if places.is_surface else density.log_density(z)

    def _phase(self, places: Places, number: int, medium: int, fog: Fog, cosine: Array) -> Array:
        law = fog.phase[medium]
        if isinstance(law, float):
            return henyey_greenstein(law)(cosine)
        if law is not None:
            return law(cosine)
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


def _between_ends(length: Array, fog: Fog, slant: Array) -> Array:
    """Return a copy of lengths from the camera in each medium, (n, media), in which the medium
    without bounds begins and ends as the fog says.

    `slant`: lengths of rays over their depth along the camera's axis, (n,).
    """
    # Only the medium without bounds begins and ends. Lengths are measured along the ray: a plane at
    # the depth z is at the distance z times `slant`.
    ends, length = (1.0 if fog.spherical else slant), length.copy()
    length[:, AROUND] = np.maximum(
        np.minimum(length[:, AROUND], fog.far * ends) - fog.near * ends, 0.0
    )
    return length


def _falls(r: Array, fog: Fog) -> Array:
    """Return how the light of a source that has a place falls with the distance from it, (n,)."""
    falls = r**-2 if fog.distance_power == 2 else r**-fog.distance_power
    return falls if fog.window is None else falls * fog.window(r)


def _alike(fog: Fog) -> list[list[int]]:
    """Return the channels in groups of the same extinction: one exponential is enough for each."""
    groups: dict[tuple[float, ...], list[int]] = {}
    for channel in range(3):
        groups.setdefault(tuple(colours[channel] for colours in fog.sigma_t), []).append(channel)
    return list(groups.values())
