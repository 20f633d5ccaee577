# SPDX-License-Identifier: BSD-3-Clause
"""What takes part in a fit: some pixels of an image, and the radiance that a fog gives them, with its derivatives."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from reference.quadrature.emission import emitted_light
from reference.quadrature.surface import surface_hits
from reference.scene.read import TruthScene
from reference.storage.exr import TOTAL
from validation.comparison.engine_layers import AIRLIGHT, SURFACE, JudgedLayer
from validation.fit.unknowns import Unknown, with_values
from validation.fog_model.build import Progress, scattering_paths
from validation.fog_model.fog import Fog, scene_fog
from validation.fog_model.radiance import (
    DevicePaths,
    as_array,
    fog_airlight,
    fog_surface,
    fog_total,
    on_device,
    opaque_fog,
)

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Bools = NDArray[np.bool_]

_MOST_RAYS = 20_000  # that a fit looks at, each with some nodes for every light: more say nothing new of few numbers
_FEWEST = 64  # pixels, whatever rays they need
_SIDE = 3  # rays along a side of a pixel, for means over its area
_AREA_POINTS, _MOST_POINTS = 16, 128  # of lights with extent: at first, and at most
_SETTLED = 0.005  # mean relative change of an image with twice the points, below which there are enough
_TRIED = 48  # pixels that say how many points a light needs
_SPHERE_POINTS = 32  # of a sphere in the place of a point light: its rays pass by close
_HUGE = 1e100  # whose square is a number too
_SATURATED = 8  # values that stop at the largest one


@dataclass(frozen=True)
class Task:
    """An image and what is known of it."""

    truth: TruthScene
    values: Array  #: (pixels, 3), all pixels of the image, row by row [W/(m^2 sr)]
    holds: str  #: 'airlight', 'surface' or 'total'
    used: Bools  #: which pixels may take part, (pixels,)
    area: bool  #: whether a pixel is a mean over its area, or the value at its centre
    points: int = _AREA_POINTS  #: that stand for a light with extent, see `needed_points`


@dataclass(frozen=True)
class ImageModel:
    """The pixels of an image that take part, and their paths."""

    task: Task
    pixels: Index
    paths: DevicePaths
    fog: Fog  #: as the scene has it

    @property
    def image(self) -> Array:
        """The values of the image, (m, 3)."""
        return self.task.values[self.pixels]

    def radiance(self, fog: Fog) -> Array:
        """Return the radiance of the pixels, (m, 3) [W/(m^2 sr)]; numbers out of range are as large as can be."""
        columns = np.stack([np.array(column, dtype=np.float64) for column in self._columns(opaque_fog(fog))], axis=1)
        return np.nan_to_num(columns, nan=_HUGE, posinf=_HUGE, neginf=-_HUGE)

    def values(self, unknowns: Sequence[Unknown], inner: Sequence[float] | Array) -> Array:
        """Return the radiance for values of parameters, given as numbers on the whole line, (m, 3)."""
        return self.radiance(with_values(unknowns, self.fog, [dr.opaque(mi.Float64, value) for value in inner]))

    def derivatives(self, unknowns: Sequence[Unknown], inner: Sequence[float] | Array) -> Array:
        """Return the derivatives of `values` by each of these numbers, (m, 3, unknowns), by forward mode."""
        variables = [dr.opaque(mi.Float64, value) for value in inner]
        dr.enable_grad(variables)
        radiance = self._columns(with_values(unknowns, self.fog, variables))
        slopes = []
        for variable in variables:
            dr.set_grad(variable, 1.0)
            dr.enqueue(dr.ADMode.Forward, variable)
            dr.traverse(dr.ADMode.Forward, flags=dr.ADFlag.ClearVertices)
            slopes.append([mi.Float64(dr.grad(column)) for column in radiance])
            dr.set_grad(variable, 0.0)
            for column in radiance:
                dr.set_grad(column, 0.0)
        dr.eval(slopes)
        count = len(self.pixels)
        columns = [np.stack([np.resize(np.array(channel), count) for channel in slope], axis=1) for slope in slopes]
        return np.nan_to_num(np.stack(columns, axis=2), nan=0.0, posinf=_HUGE, neginf=-_HUGE)

    def _columns(self, fog: Fog) -> Any:
        kinds = {AIRLIGHT: fog_airlight, SURFACE: fog_surface}
        return kinds.get(self.task.holds, fog_total)(self.paths, fog)


def image_model(
    task: Task, *, most: int = _MOST_RAYS, apart: int = 0, seed: int = 0, progress: Progress | None = None, **how: Any
) -> ImageModel:
    """Return the model of an image.

    Parameters
    ----------
    apart
        Where not all pixels take part, they are chosen as pairs so far apart in a row; 0: each by itself [pixels].
    seed
        Of the choice of pixels, and of the places of rays in them.
    how
        More for `validation.fog_model.build.scattering_paths`.
    """
    pixels = _some(np.flatnonzero(task.used), pixels_of_rays(task, most), seed)
    if apart and len(pixels) < np.count_nonzero(task.used):
        pixels = _with_partners(pixels[::2], task, apart)
    paths = scattering_paths(
        task.truth,
        pixels=pixels,
        rays_per_side=_SIDE if task.area else 0,
        airlight=task.holds != SURFACE,
        surface=task.holds != AIRLIGHT,
        points=max(_SPHERE_POINTS if how.get("radius") else 0, task.points),
        seed=seed,
        progress=progress,
        **how,
    )
    return ImageModel(task, pixels, on_device(paths), scene_fog(task.truth))


def pixels_of_rays(task: Task, most: int) -> int:
    """Return how many pixels so many rays allow, or the fewest that a fit looks at."""
    return max(_FEWEST, most // ((_SIDE**2 if task.area else 1) * (task.points if task.truth.area else 1)))


def needed_points(truth: TruthScene) -> int:
    """Return how many points stand for a light with extent: twice as many until the image hardly changes.

    A window before pillars needs 128 where a lamp above an edge needs 16: each point has shadows of its own.
    """
    points = _AREA_POINTS
    if not truth.area:
        return points
    count = truth.width * truth.height
    pixels = np.unique(np.linspace(0, count - 1, min(count, _TRIED)).astype(np.int64))

    def image(points: int) -> Array:
        paths = on_device(scattering_paths(truth, pixels=pixels, points=points))
        return as_array(fog_total(paths, scene_fog(truth)))

    values = image(points)
    while points < _MOST_POINTS:
        finer = image(2 * points)
        points *= 2
        change = np.abs(finer - values) / np.maximum(finer, 0.01 * finer.mean())
        if float(change.mean()) < _SETTLED:
            return points // 2
        values = finer
    return points


def at_places(task: Task, places: dict[int, tuple[float, float, float]]) -> Task:
    """Return a task with point or spot lights, by number, at other places [m]."""
    lights = tuple(
        replace(light, position=np.array(places[number])) if number in places else light
        for number, light in enumerate(task.truth.lights)
    )
    return replace(task, truth=replace(task.truth, lights=lights))


def usable_pixels(values: Array) -> Bools:
    """Return which pixels say something: finite ones that do not stop, with many others, at the largest value."""
    finite: Bools = np.asarray(np.isfinite(values).all(axis=1))
    if not finite.any():
        return finite
    largest = values[finite].max()
    stopped: Bools = np.asarray(np.any(values == largest, axis=1) & finite)
    return finite & ~stopped if largest > 0 and np.count_nonzero(stopped) >= _SATURATED else finite


def without_lights(truth: TruthScene, judged: JudgedLayer) -> Bools:
    """Return which pixels show no area light, and have none beside them, where an image shows these, (pixels,).

    Neither a fit nor a diagnosis explains the light itself, whose radiance no fog makes.
    """
    if not (truth.area or truth.background is not None) or judged.holds != TOTAL or not judged.emitted:
        return np.ones(truth.width * truth.height, dtype=bool)
    lit = emitted_light(truth, surface_hits(truth).distance).any(axis=1).reshape(truth.height, truth.width)
    return ~binary_dilation(lit, np.ones((3, 3), dtype=bool)).ravel()


def _with_partners(pixels: Index, task: Task, apart: int) -> Index:
    """Return pixels, and those to the right of them that can take part too."""
    partners = pixels + apart
    there = (pixels % task.truth.width + apart < task.truth.width) & (partners < len(task.used))
    partners = partners[there]
    return np.asarray(np.union1d(pixels, partners[task.used[partners]]), dtype=np.int64)


def _some(pixels: Index, most: int, seed: int) -> Index:
    """Return at most so many of the pixels: one at random of each of as many equal shares."""
    if len(pixels) <= most:
        return pixels
    places = (np.arange(most) + np.random.default_rng(seed).random(most)) * (len(pixels) / most)
    return np.asarray(np.unique(pixels[np.minimum(places.astype(np.int64), len(pixels) - 1)]), dtype=np.int64)
