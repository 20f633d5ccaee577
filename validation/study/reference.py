# SPDX-License-Identifier: BSD-3-Clause
"""The reference of the cells of one image, computed once, with its own error.

It is the quadrature at pixel centres. An area light needs many light samples, each as costly as a
point light: it has fewer here than in `airlight reference`, and three of their standard errors are
part of its error. A sixteenth of the pixels has a reference there, chosen by chance once for all: quantiles of
errors need no more.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import mitsuba as mi
import numpy as np

from airlight.analytic.clock import Spent
from airlight.reference.quadrature.image import ReferenceImage
from airlight.reference.quadrature.reference import reference_of_pixels, reference_result
from airlight.reference.quadrature.replicates import PointPlan
from airlight.reference.storage.scene_digest import scene_content
from airlight.reference.storage.store import Content, Inputs, stored
from airlight.validation.arrays import Array, Bools
from airlight.validation.estimates.quadrature import off_by
from airlight.validation.metrics.errors import FLOOR
from airlight.validation.scenes.changes import parse_changes
from airlight.validation.scenes.loading import LoadedScene, load_scene
from airlight.validation.statistics.estimate import Kind
from airlight.validation.study.row import ReferenceError
from airlight.validation.study.study import Cell

# Points of area lights: a ray has enough at a standard error of 2 %, and has never more than 8
# times 4. Each point takes as long as a point light does, and surfaces take as long again: these
# are left out.
_PLAN = PointPlan(error=2e-2, first=2, most=4, surfaces=False)

_UNKNOWN = Spent()


@dataclass(frozen=True)
class Reference:
    """The reference of all cells of one image."""

    airlight: Array  #: (height, width, 3) [W/(m^2 sr)]
    error: Array  #: its error, three standard errors of area lights among it [W/(m^2 sr)]
    kind: Kind  #: of that error
    surface: Array | None  #: (height, width, 3) [W/(m^2 sr)]; None where area lights leave it out
    mask: Bools | None  #: pixels that have a reference, (height, width); None for all
    crossings: int | None  #: of all camera rays with edges between light and shadow
    spent: Spent  #: what it took when it was computed
    off: tuple[float, float]  #: by how much its mean and its values may be off, see `off_by` [1]

    @property
    def light(self) -> Array:
        """Airlight and lit surface, (height, width, 3) [W/(m^2 sr)]."""
        return self.airlight if self.surface is None else self.airlight + self.surface

    @cached_property
    def own_error(self) -> ReferenceError:
        """The error that the reference states for itself."""
        mask = np.ones(self.airlight.shape[:2], dtype=bool) if self.mask is None else self.mask
        airlight, error = self.airlight[mask], self.error[mask]
        # A dark reference has no relative error.
        mean = float(airlight.mean())
        bright = mean > 0
        return ReferenceError(
            "quadrature",
            mean,
            float(np.sqrt(np.mean(error**2))) / mean if bright else None,
            float((error / np.maximum(airlight, FLOOR * mean)).max()) if bright else None,
            self.spent.seconds,
            self.spent.processor,
            self.crossings,
            self.kind,
        )


def of_image(image: ReferenceImage, spent: Spent = _UNKNOWN) -> Reference:
    """Return a quadrature image as the reference of cells."""
    # The light samples of area lights add three standard errors.
    by_chance = 0.0 if image.airlight_se is None else 3.0 * image.airlight_se
    error, off = image.airlight_error + by_chance, off_by(image, "airlight")
    kind: Kind = image.airlight_kind if image.airlight_se is None else "statistical"
    return Reference(
        image.airlight, error, kind, image.surface, None, image.transitions, spent, off
    )


def load_cell(cell: Cell) -> LoadedScene:
    """Load the scene of a cell at its size, with its medium."""
    return load_scene(cell.scene, cell.size, parse_changes(cell.medium))


def cell_reference(loaded: LoadedScene) -> Reference:
    """Return the reference of a loaded scene, from the cache where it was computed before."""
    if not any(emitter.get_shape() is not None for emitter in loaded.scene.emitters()):
        whole = reference_result(loaded.scene)
        return of_image(whole.value, whole.spent)
    inputs = SampledInputs(scene_content(loaded.scene))
    result = stored(inputs, lambda: sampled_reference(loaded.scene), SampledPixels)
    sampled = result.value
    return Reference(
        sampled.airlight,
        sampled.error,
        "statistical",
        None,
        sampled.mask,
        None,
        result.spent,
        sampled.off,
    )


@dataclass(frozen=True)
class SampledInputs(Inputs):
    """The inputs of the reference of some pixels of a scene with area lights."""

    kind = "sweep-reference"
    scene: Content


@dataclass(frozen=True)
class SampledPixels:
    """The reference of some pixels of an image; 0 in all others."""

    airlight: Array  #: (height, width, 3) [W/(m^2 sr)]
    error: Array  #: its error, (height, width, 3) [W/(m^2 sr)]
    mask: Bools  #: pixels that have a reference, (height, width)
    off: tuple[float, float]  #: as of `Reference`


def sampled_reference(scene: mi.Scene) -> SampledPixels:
    """Return the reference of one pixel in sixteen of a scene."""
    # At least 64 pixels have a reference. The seed is fixed: all methods, and all studies, are
    # judged at the same pixels.
    width, height = scene.sensors()[0].film().size()
    count = int(width * height)
    pixels = np.sort(np.random.default_rng(20261123).permutation(count)[: max(64, count // 16)])
    computed = of_image(reference_of_pixels(scene, pixels, plan=_PLAN))
    airlight, error, mask = np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count, dtype=bool)
    airlight[pixels], error[pixels], mask[pixels] = computed.airlight[0], computed.error[0], True
    shape = int(height), int(width)
    images = airlight.reshape(*shape, 3), error.reshape(*shape, 3)
    return SampledPixels(*images, mask.reshape(shape), computed.off)
