# SPDX-License-Identifier: BSD-3-Clause
"""The image of an engine with a fault, pixel by pixel: the fog model of a changed
scene, then changed values.
"""

from collections.abc import Callable, Hashable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar, cast

import numpy as np
from scipy.ndimage import gaussian_filter

from airlight.reference.monte_carlo.batches import LAYERS
from airlight.reference.monte_carlo.volpath import volpath_batch
from airlight.reference.monte_carlo.volpath_gaps import CannotTrace
from airlight.reference.scene.read import ReferenceScene
from airlight.validation.arrays import Array, Bools, Index
from airlight.validation.engine.observation import Observation, relative_errors
from airlight.validation.fog_model.equation import fog_of_model, scenery_of_model
from airlight.validation.fog_model.radiance import Fog, FogModel
from airlight.validation.fog_model.view import Ends, Scenery, View

Value = TypeVar("Value")
Layers = Callable[[Array, Array], tuple[Array, Array]]  #: of airlight and surfaces, (m, 3) each

_FEW_RAYS = 800  # with which faults that move paths are told apart
# of which exact paths cost much: few pixels are looked at, and faults are searched by others
_MANY_TRIANGLES = 20_000


@dataclass(frozen=True)
class Guess:
    """A guess of an image: a scene, its fog, and the changes of the values."""

    fog: Fog
    scenery: Scenery = field(default_factory=Scenery)
    surfaces: Scenery | None = None  #: the scenery of surfaces, where it is another one
    #: what was done to airlight and surfaces before they were added
    layers: tuple[Layers, ...] = ()
    values: tuple[Callable[[Array], Array], ...] = ()  #: what was done to the values, in this order
    #: Takes back what was done to the grid, (height, width, 3) -> the same.
    undo: Callable[[Array], Array] | None = None


@dataclass
class _Recent:
    """Values by their keys, as long as there is room: the one used longest ago goes first."""

    room: float  #: how many numbers stay in memory, some eight bytes each
    taken: int = 0
    # With their sizes. A dictionary keeps the order of insertion: an entry that is used is taken
    # out and put in again, so that the one used last comes last.
    entries: dict[Hashable, tuple[object, int]] = field(default_factory=dict)

    def once(
        self, key: Hashable, compute: Callable[[], Value], size: Callable[[Value], int]
    ) -> Value:
        """Return the value of a key, computed where it is not here."""
        entry = self.entries.pop(key, None)
        if entry is not None:
            self.entries[key] = entry
            return cast(Value, entry[0])
        # The values that were used longest ago make room for a new one.
        value = compute()
        number_count = size(value)
        self.taken += number_count
        while self.entries and self.taken > self.room:
            self.taken -= self.entries.pop(next(iter(self.entries)))[1]
        self.entries[key] = value, number_count
        return value


@dataclass
class SceneLight:
    """The light of a scene, which all images of it share: paths by scenery, radiance by fog."""

    reference: ReferenceScene
    most: float = 12_000_000  #: room for the numbers of paths

    @cached_property
    def _paths(self) -> _Recent:
        return _Recent(self.most)

    @cached_property
    def _radiance(self) -> _Recent:
        return _Recent(6_000_000)

    @cached_property
    def higher_orders(self) -> Array | None:
        """Light of higher orders in airlight and surfaces, (2, pixels, 3),
        by Mitsuba's path tracer.

        None where an image is so large that this would take minutes, or where it cannot trace the
        scene.
        """
        reference = self.reference
        if reference.width * reference.height > 1 << 17:
            return None
        # Paths of up to 64 segments less paths of up to two segments, which are single scattering:
        # four batches of 16 paths a pixel, each with one seed for both.
        parts = []
        with suppress(CannotTrace):
            for seed in range(4):
                whole, single = (
                    volpath_batch(reference, seed, 16, max_depth=depth).mean for depth in (64, 2)
                )
                parts.append(
                    (whole - single)[[LAYERS.index(layer) for layer in ("airlight", "surface")]]
                )
        if not parts:
            return None
        image = np.mean(parts, axis=0).reshape(2, reference.height, reference.width, 3)
        # It is smooth except for edges, and noisy: a filter of a fortieth of the image's width.
        width = reference.width / 40
        return np.asarray(gaussian_filter(image, (0, width, width, 0)).reshape(2, -1, 3))

    def view(self, observation: Observation, scenery: Scenery) -> View:
        """Return the rays of an image in a scenery, and what is known of them."""
        camera = scenery.offset, scenery.zoom, scenery.eye, scenery.turned
        key = "view", camera, _sight(observation)
        return self._paths.once(
            key, lambda: observation.view(scenery), lambda view: 40 * view.distance.size
        )

    def model(
        self, observation: Observation, scenery: Scenery, layer: int, ends: Ends | None = None
    ) -> FogModel:
        """Return the paths of a layer of an image in a scenery, 0: airlight, 1:
        surfaces; `ends`: of a fog.
        """
        key = "model", scenery, layer, ends, _sight(observation)
        view = self.view(observation, scenery)
        return self._paths.once(
            key,
            lambda: observation.model(view, scenery, layer, ends),
            lambda model: 20 * model.places,
        )

    def radiance(self, observation: Observation, scenery: Scenery, fog: Fog, layer: int) -> Array:
        """Return a layer of the pixels for a fog, (m, 3) [W/(m^2 sr)]."""
        # Factors on lights need no new sums: the radiance by light is found without them.
        plain = fog.without_factors
        ends = fog.ends if layer == 0 else None
        key = scenery, plain, layer, _sight(observation)
        by_light = self._radiance.once(
            key,
            lambda: self.model(observation, scenery, layer, ends).by_light(plain),
            lambda each: each.size,
        )
        return fog.combined(by_light)[layer]


def _sight(observation: Observation) -> tuple[Hashable, ...]:
    """Return the key of the paths of an image: all that its pixels depend on."""
    return (
        observation.area,
        observation.holds,
        observation.samples,
        observation.rays,
        observation.steps,
        observation.apart,
        observation.used.tobytes(),
        observation.cut_off.tobytes(),
    )


@dataclass
class Predictor:
    """Predicts images."""

    observation: Observation
    light: SceneLight

    @property
    def reference(self) -> ReferenceScene:
        """The scene."""
        return self.observation.reference

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width of the image [pixels]."""
        return self.reference.height, self.reference.width

    @cached_property
    def unchanged(self) -> Guess:
        """The scene as it is, in the equation that the image should solve."""
        model = self.observation.equation
        return Guess(fog_of_model(self.reference, model), scenery_of_model(model))

    @property
    def fog(self) -> Fog:
        """The fog as the scene and its equation have it."""
        return self.unchanged.fog

    @cached_property
    def many(self) -> bool:
        """Whether a scene has so many triangles that exact paths cost much."""
        return (
            sum(shape.primitive_count() for shape in self.reference.occluders.shapes())
            >= _MANY_TRIANGLES
        )

    @cached_property
    def few(self) -> "Predictor":
        """A predictor with fewer pixels."""
        return Predictor(replace(self.observation, rays=_FEW_RAYS), self.light)

    @cached_property
    def quick(self) -> "Predictor":
        """A predictor with enough pixels to tell faults apart that move no paths."""
        # As many pixels as with centres: a mean over the area of a pixel has nine rays.
        rays = _FEW_RAYS * (9 if self.observation.area else 1)
        return Predictor(
            replace(self.observation, rays=min(rays, self.observation.rays)), self.light
        )

    @cached_property
    def fewest(self) -> "Predictor":
        """A predictor with just enough pixels for the size of a light: each needs many paths."""
        return Predictor(replace(self.observation, rays=_FEW_RAYS // 8), self.light)

    @cached_property
    def coarse(self) -> "Predictor":
        """A predictor with fewer pixels, and with shadow rays where exact paths cost much."""
        # 64 shadow rays find the lit parts of a ray.
        return (
            Predictor(replace(self.few.observation, steps=64), self.light)
            if self.many
            else self.few
        )

    @cached_property
    def view(self) -> View:
        """The rays of the scene."""
        return self.light.view(self.observation, Scenery())

    @cached_property
    def pixels(self) -> Index:
        """Which pixels take part, in any scenery, (m,)."""
        return self.view.pixels

    def layers(self, guess: Guess) -> tuple[Array, Array]:
        """Return airlight and surfaces of the pixels, (m, 3) each; 0 where the
        image does not hold one.
        """
        parts = []
        for layer, scenery in enumerate((guess.scenery, guess.surfaces or guess.scenery)):
            is_shown = self.observation.holds != ("surface", "airlight")[layer]
            # Where surfaces have their own scenery, a light that moves with its paths held
            # moves for the fog alone.
            fog = (
                replace(guess.fog, moved=self.fog.moved)
                if layer == 1 and guess.surfaces
                else guess.fog
            )
            parts.append(
                self.light.radiance(self.observation, scenery, fog, layer) if is_shown else None
            )
        airlight, surface = (
            np.zeros((len(self.pixels), 3)) if part is None else part for part in parts
        )
        for change in guess.layers:
            airlight, surface = change(airlight, surface)
        return airlight, surface

    def predicted(self, guess: Guess) -> Array:
        """Return the values of the pixels, (m, 3)."""
        radiance = self.observation.held(np.stack(self.layers(guess)))
        for change in guess.values:
            radiance = change(radiance)
        return radiance

    def transmittance(self, guess: Guess) -> Array:
        """Return the fraction of light that a guess leaves of what surfaces send, (m, 3)."""
        return self.light.model(self.observation, guess.scenery, 0).transmittance(guess.fog)

    @cached_property
    def cosines(self) -> Array:
        """The cosines of the pixels to the axis of the camera, (m,)."""
        return np.asarray(self.reference.direction[self.pixels] @ self.view.axis)

    def shown(self, guess: Guess) -> Array:
        """Return the values of the image in these pixels, (m, 3), with the
        fault of the grid taken back.
        """
        values = self.observation.values
        if guess.undo is not None:
            values = np.ascontiguousarray(guess.undo(values.reshape(*self.shape, 3))).reshape(-1, 3)
        return values[self.pixels]

    @cached_property
    def _least(self) -> float:
        # An image that is dimmer than 1e-7 of the mean that the scene itself would have is black.
        return 1e-7 * float(np.mean(np.abs(self.predicted(self.unchanged)))) + 1e-300

    def _floor(self, shown: Array) -> float:
        # Below 1 % of the mean of the image values count relative to that.
        finite = shown[np.isfinite(shown)]
        return max(0.01 * float(np.mean(np.abs(finite))) if finite.size else 0.0, self._least)

    def errors(self, guess: Guess) -> Array:
        """Return the errors of a guess, relative to the larger of both
        values, (m, 3), from -1 to 1.
        """
        return self.relative(self.predicted(guess), self.shown(guess))

    def relative(self, predicted: Array, shown: Array) -> Array:
        """Return the errors of predicted values, as `errors` has them, (m, 3)."""
        return relative_errors(predicted, shown, self._floor(shown))

    def lit(self, guess: Guess) -> Bools:
        """Return which values of the image are not dark, (m, 3): the others have no
        noise that could be seen.
        """
        shown = self.shown(guess)
        return np.asarray(np.abs(shown) > self._floor(shown))
