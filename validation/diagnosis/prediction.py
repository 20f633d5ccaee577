# SPDX-License-Identifier: BSD-3-Clause
"""What an engine with a fault would show, pixel by pixel: the fog model of a changed scene, then changed values."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from reference.monte_carlo.batches import LAYERS
from reference.monte_carlo.volpath.integrator import volpath_batch
from reference.scene.camera import camera_matrix
from reference.scene.read import TruthScene
from validation.fit.image_model import ImageModel, Task, image_model, needed_points
from validation.fog_model.fog import Fog, scene_fog

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Bools = NDArray[np.bool_]

APART = 2  #: pixels between those whose errors are compared: a filter that is wider than a pixel joins neighbours
_MOST_RAYS = 3000
_BATCH = 4  # batches of 16 paths a pixel for the light of multiple scattering
_SAMPLES = 16
_SMOOTH = 40  # of the width of an image: the width of the filter for that light
_FLOOR = 0.01  # of the mean of an image: below it values count relative to this


@dataclass(frozen=True)
class Scenery:
    """What of a scene decides the paths of light; each combination has paths of its own."""

    shadows: bool = True
    offset: tuple[float, float] = (0.0, 0.0)  #: of all rays, to the right and down [pixels]
    zoom: float = 1.0  #: factor on the distance of pixels from the middle of the image
    moved: tuple[float, float, float] = (0.0, 0.0, 0.0)  #: of the first point or spot light [m]
    cone: float = 1.0  #: factor on the angles of spots
    edge: str = ""  #: of spots: 'hard', or 'smooth' from the axis on; the scene's own
    radius: float = 0.0  #: of spheres in the place of point lights [m]
    near: float = 0.0  #: distance along the axis where the medium begins; the fog's own is only that of its nodes [m]
    blend: float = 0.0  #: share of 1 - cos(cut-off) in which spots fall off smoothly, as Blender's do


@dataclass(frozen=True)
class Guess:
    """What an image could be: a scene, what fills it, and what was done to the values."""

    fog: Fog
    scenery: Scenery = field(default_factory=Scenery)
    multiple: tuple[float, float] = (0.0, 0.0)  #: shares of the light of higher orders: airlight, surfaces
    vignette: float = 0.0  #: power of the cosine to the camera's axis that dims the image
    values: tuple[Callable[[Array], Array], ...] = ()  #: what was done to the values, in this order
    undo: Callable[[Array], Array] | None = (
        None  #: takes back what was done to the grid, (height, width, 3) -> the same
    )


@dataclass
class SceneLight:
    """The light of a scene, which all images of it share: paths by scenery, and what scatters again."""

    truth: TruthScene
    most: int = 4_000_000  #: nodes whose paths are kept, those used last: some 120 bytes each
    most_values: int = 8_000_000  #: of images that are kept, those used last: hypotheses share fogs, and images starts
    _models: dict[Any, ImageModel] = field(default_factory=dict)  # the one used last comes last
    _images: dict[Any, Array] = field(default_factory=dict)  # likewise

    @cached_property
    def points(self) -> int:
        """How many points stand for a light with extent."""
        return needed_points(self.truth)

    @cached_property
    def higher_orders(self) -> Array | None:
        """Light of higher orders in airlight and surfaces, (2, pixels, 3), by Mitsuba's path tracer.

        None where an image is so large that this would take minutes.
        """
        truth = self.truth
        if truth.width * truth.height > 1 << 17:
            return None
        parts = []
        for seed in range(_BATCH):
            whole, single = (volpath_batch(truth, seed, _SAMPLES, max_depth=depth).mean for depth in (64, 2))
            parts.append((whole - single)[[LAYERS.index(layer) for layer in ("airlight", "surface")]])
        image = np.mean(parts, axis=0).reshape(2, truth.height, truth.width, 3)
        # It is smooth but for edges, and noisy.
        width = truth.width / _SMOOTH
        return np.asarray(gaussian_filter(image, (0, width, width, 0)).reshape(2, -1, 3))

    def model(self, task: Task, scenery: Scenery) -> ImageModel:
        """Return the model of an image in a scenery."""
        key = scenery, *_sight(task)
        known = self._models.pop(key, None)
        if known is None:
            known = image_model(
                replace(task, truth=changed_scene(task.truth, scenery)),
                most=_MOST_RAYS,
                apart=APART,
                shadows=scenery.shadows,
                offset=scenery.offset,
                zoom=scenery.zoom,
                radius=scenery.radius,
                blend=scenery.blend,
                near=scenery.near,
            )
            room = self.most - known.paths.nodes
            while self._models and sum(model.paths.nodes for model in self._models.values()) > room:
                del self._models[next(iter(self._models))]
        self._models[key] = known
        return replace(known, task=task)

    def radiance(self, task: Task, scenery: Scenery, fog: Fog) -> Array:
        """Return what a fog makes of the pixels of an image in a scenery, (m, 3) [W/(m^2 sr)]."""
        grey = replace(fog, exposure=(1.0, 1.0, 1.0))
        key = scenery, grey, *_sight(task)
        known = self._images.pop(key, None)
        if known is None:
            known = self.model(task, scenery).radiance(grey)
            while (len(self._images) + 1) * known.size > self.most_values and self._images:
                del self._images[next(iter(self._images))]
        self._images[key] = known
        return known * np.array(fog.exposure)


def _sight(task: Task) -> tuple[Any, ...]:
    """Return what of a task its pixels depend on, and their paths."""
    return task.area, task.holds, task.points, task.used.tobytes()


@dataclass
class Predictor:
    """Predicts images."""

    task: Task
    shape: tuple[int, int]
    light: SceneLight

    @property
    def fog(self) -> Fog:
        """The fog as the scene has it."""
        return scene_fog(self.task.truth)

    @cached_property
    def pixels(self) -> Index:
        """Which pixels take part, in any scenery, (m,)."""
        return self.light.model(self.task, Scenery()).pixels

    @cached_property
    def pairs(self) -> tuple[Index, Index]:
        """Which rows of `errors` are pixels, and which their neighbours, those of the next columns if it can be."""
        pixels, width = self.pixels, self.shape[1]
        for apart in (1, APART) if len(pixels) == self.task.used.sum() else (APART,):
            partner = np.searchsorted(pixels, pixels + apart)
            row = np.flatnonzero(partner < len(pixels))
            partner = partner[row]
            there = (pixels[partner] == pixels[row] + apart) & (pixels[row] % width + apart < width)
            if there.any():
                return row[there], partner[there]
        return np.empty(0, np.int64), np.empty(0, np.int64)

    def predicted(self, guess: Guess) -> Array:
        """Return the values of the pixels, (m, 3)."""
        radiance = self.light.radiance(self.task, guess.scenery, guess.fog)
        if any(guess.multiple):
            more = self.light.higher_orders
            if more is not None:
                radiance = radiance + sum(share * part[self.pixels] for share, part in zip(guess.multiple, more))
        if guess.vignette:
            radiance = radiance * self._cosines()[:, None] ** guess.vignette
        for change in guess.values:
            radiance = change(radiance)
        return radiance

    def _cosines(self) -> Array:
        """Return the cosines of the pixels to the axis of the camera, (m,)."""
        truth = self.task.truth
        return np.asarray(truth.direction[self.pixels] @ camera_matrix(truth.scene.sensors()[0])[:3, 2])

    def seen(self, guess: Guess) -> Array:
        """Return the values of the image in these pixels, (m, 3), with the fault of the grid taken back."""
        values = self.task.values
        if guess.undo is not None:
            values = np.ascontiguousarray(guess.undo(values.reshape(*self.shape, 3))).reshape(-1, 3)
        return values[self.pixels]

    def errors(self, guess: Guess) -> Array:
        """Return the errors of a guess, relative to the larger of both values, (m, 3), from -1 to 1."""
        predicted, seen = self.predicted(guess), self.seen(guess)
        scale = np.maximum(np.maximum(np.abs(seen), np.abs(predicted)), _floor(seen))
        errors = (seen - predicted) / scale
        return np.where(np.isfinite(errors), errors, 1.0)

    def lit(self, guess: Guess) -> Bools:
        """Return which values of the image are not dark, (m, 3): the others have no noise that could be seen."""
        seen = self.seen(guess)
        return np.asarray(np.abs(seen) > _floor(seen))


def _floor(seen: Array) -> float:
    return _FLOOR * max(float(np.mean(np.abs(seen))), 1e-300)


def changed_scene(truth: TruthScene, scenery: Scenery) -> TruthScene:
    """Return a scene with its point and spot lights as a scenery has them."""
    lights = []
    for number, light in enumerate(truth.lights):
        if number == 0 and any(scenery.moved):
            light = replace(light, position=light.position + np.array(scenery.moved))
        if light.axis is not None and scenery.cone != 1:
            half = 0.499 * np.pi
            light = replace(
                light, cutoff=min(light.cutoff * scenery.cone, half), beam=min(light.beam * scenery.cone, half)
            )
        if light.axis is not None and scenery.edge:
            light = replace(light, beam=light.cutoff if scenery.edge == "hard" else 0.0)
        lights.append(light)
    return replace(truth, lights=tuple(lights))
