# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of the fog that explain an image file of a scene, with their intervals."""

import math
import os
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from reference.scene.read import read_truth
from reference.storage.exr import Image, read_exr
from validation.comparison.engine_compare import scene_of_size
from validation.comparison.engine_layers import JudgedLayer, judged_layer
from validation.comparison.engine_pixels import PIXELS
from validation.comparison.images import read_mask
from validation.fit.confounding import Group, confounded_groups
from validation.fit.image_model import (
    ImageModel,
    Task,
    at_places,
    image_model,
    needed_points,
    pixels_of_rays,
    usable_pixels,
    without_lights,
)
from validation.fit.intervals import SIGMAS, interval_ends
from validation.fit.least_squares import Solution, best_start, robust_fit, weighted_derivatives, weighted_fit
from validation.fit.unknowns import AXES, CHANNELS, Unknown, read_unknowns
from validation.fog_model.fog import scene_fog
from validation.metrics.errors import plain
from validation.scenes.loading import LoadedScene

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

_MOVES = 12  # rounds in which lit intervals are found anew
_STILL = 1e-6  # of the distance of a light from the camera: it does not move any more
_STILL_IN_NOISE = 0.02  # of a standard error: the interval would not show it
_KNOWN = 1e-6  # a standard error that is always there: scenes are read, and images written, in float32
_EXACT = 1e-5  # mean relative residual at which pixels are centres beyond doubt
_FEW_RAYS = 3000  # on which starts are compared
_FEWER = 4
_FEWEST = 16  # pixels


@dataclass(frozen=True)
class Fitted:
    """A parameter and its 95 % interval; None where the image does not tell it from others."""

    name: str
    value: float
    low: float | None
    high: float | None
    unit: str
    scene: float  #: what the scene says


@dataclass(frozen=True)
class Product:
    """What an image says of parameters that it does not tell apart: a product of powers of them."""

    name: str  #: such as 'albedo * intensity'
    value: float
    low: float
    high: float | None  #: None where the image sets no end


@dataclass(frozen=True)
class Confounded:
    """Parameters that the image does not tell apart."""

    parameters: tuple[str, ...]
    held: tuple[str, ...]  #: which of them were held at the value to begin with
    products: tuple[Product, ...]  #: what is known of them
    way_out: str


@dataclass(frozen=True)
class Fit:
    """What explains an image of a scene."""

    scene: str
    path: str
    holds: str  #: what the layer holds: 'airlight', 'surface' or 'total'
    pixel: str  #: 'centre' or 'area'
    parameters: tuple[Fitted, ...]
    groups: tuple[tuple[str, tuple[int, ...]], ...]  #: by name for JSON, which of `parameters` are its channels
    residual: float  #: relative rmse that is left, over the pixels that took part
    explained: float  #: share of the image's variance
    pixels: int  #: that were looked at
    left_out: int  #: of these, how many disagree with what explains the others
    noise: float  #: median of the relative residual, as a standard deviation
    confounded: tuple[Confounded, ...]
    seconds: float  #: that the fit took, with the paths of light

    def to_json(self) -> dict[str, Any]:
        """Return every number by name. A parameter of three channels has lists of three."""
        parameters: dict[str, Any] = {}
        for name, members in self.groups:
            rows = [self.parameters[number] for number in members]
            row = {key: [plain(getattr(each, key)) for each in rows] for key in ("value", "low", "high", "scene")}
            parameters[name] = row if len(rows) > 1 else {key: values[0] for key, values in row.items()}
        return {
            "scene": self.scene,
            "file": self.path,
            "holds": self.holds,
            "pixel": self.pixel,
            "parameters": parameters,
            "residual": plain(self.residual),
            "explained": plain(self.explained),
            "noise": plain(self.noise),
            "pixels": self.pixels,
            "left_out": self.left_out,
            "confounded": [asdict(each) for each in self.confounded],
            "seconds": plain(self.seconds),
        }


def fit_file(
    path: str | os.PathLike[str],
    scene: str,
    parameters: Sequence[str],
    *,
    layer: str | None = None,
    mask: str | os.PathLike[str] | None = None,
    **how: Any,
) -> Fit:
    """Find the parameters that explain an EXR file.

    Parameters
    ----------
    scene
        A built-in scene or a Mitsuba XML file: geometry, camera and lights are taken from it, and so is what is not
        looked for.
    parameters
        What is looked for, see `validation.fit.unknowns`.
    layer
        Which layer, see `validation.comparison.engine_layers.judged_layer`.
    mask
        An EXR file that is 0 in pixels to leave out.
    how
        More for `fit_image`.

    Raises
    ------
    InputError
        For files, scenes and names that cannot be used, and what `fit_image` refuses.
    """
    image = read_exr(path)
    judged = judged_layer(image, path, name=layer, holds=how.get("holds"))
    loaded = scene_of_size(scene, judged.size, path)
    chosen = None if mask is None else read_mask(mask)
    return fit_image(image, loaded, parameters, path=str(path), layer=layer, mask=chosen, **how)


def fit_image(
    image: Image,
    loaded: LoadedScene,
    parameters: Sequence[str],
    *,
    path: str = "the image",
    layer: str | None = None,
    holds: str | None = None,
    pixel: str | None = None,
    mask: NDArray[np.bool_] | None = None,
    starts: Mapping[str, float] | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Find the parameters that explain an image.

    Parameters
    ----------
    loaded
        The scene, at the size of the image.
    parameters, layer, holds
        See `fit_file`; what the layer holds is 'airlight', 'surface' or 'total'.
    pixel
        'centre' or 'area'; by default what the image says of itself, or what fits better.
    mask
        Which pixels may take part, (height, width); all by default.
    starts
        Values to begin with, by name; the scene's own by default.

    Raises
    ------
    InputError
        For layers and names that are not known, a scene that has no truth, a mask of another size, and an image with
        too few pixels that say something.

    Notes
    -----
    Valid for single scattering: homogeneous media, point and spot lights, directional ones where media have bounds;
    lights with extent are 16 to 128 points here, which leaves some 0.5 % in a pixel. The intervals count pixels as
    independent of one another.
    """
    if pixel is not None and pixel not in PIXELS:
        raise InputError(f"--pixel {pixel}; wanted 'centre' or 'area'")
    started = time.perf_counter()
    judged = judged_layer(image, path, name=layer, holds=holds)
    truth = read_truth(loaded.scene)
    unknowns = read_unknowns(parameters, truth, scene_fog(truth), starts or {})
    values = three_channels(judged)
    used = usable_pixels(values) & without_lights(truth, judged)
    if mask is not None:
        used &= _fitting_mask(mask, judged)
    fewest = max(_FEWEST, 4 * len(unknowns))
    if int(used.sum()) < fewest:
        raise InputError(
            f"{path}: {int(used.sum())} pixels of the layer '{judged.name}' say something; wanted at least {fewest}, "
            "finite, not cut off at the brightest value, and left by the mask"
        )
    task = Task(truth, values, judged.holds, used, area=False, points=needed_points(truth))
    said = pixel or said_pixel(image)
    kinds = [said] if said else list(PIXELS)
    results = []
    for number, kind in enumerate(kinds):
        tell = None if progress is None else _stage(progress, number, len(kinds))
        results.append((kind, *_solved(replace(task, area=kind == "area"), unknowns, tell)))
        if _wrong(results[-1][3]) < _EXACT:
            break
    kind, model, groups, solution, unknowns = min(results, key=lambda result: _wrong(result[3]))
    fit = _fit((loaded.name, path, judged.holds, kind), model, groups, solution, unknowns)
    return replace(fit, seconds=time.perf_counter() - started)


def said_pixel(image: Image) -> str | None:
    """Return what an image of ours says of its pixels, 'centre' or 'area'; None for others."""
    said = image.attributes.get("airlight:pixel")
    if said in PIXELS:
        return str(said)
    if "airlight:method" in image.attributes:
        return "centre"
    return "area" if "airlight:spp" in image.attributes else None


def three_channels(judged: JudgedLayer) -> Array:
    """Return the values of a layer as rows of pixels, a single channel three times, (pixels, 3)."""
    values = np.asarray(judged.values, dtype=np.float64)
    return np.broadcast_to(values.reshape(-1, values.shape[-1]), (judged.size[0] * judged.size[1], 3)).copy()


def _fitting_mask(mask: NDArray[np.bool_], judged: JudgedLayer) -> NDArray[np.bool_]:
    chosen = np.asarray(mask)
    if chosen.shape != judged.values.shape[:2]:
        shape = " x ".join(str(side) for side in chosen.shape[::-1])
        raise InputError(
            f"the mask is {shape} pixels, the image {judged.size[0]} x {judged.size[1]}; wanted one of the image's size"
        )
    return chosen.ravel() != 0


def _stage(progress: Progress, number: int, count: int) -> Progress:
    return lambda share, what: progress((number + share) / count, what)


def _solved(
    task: Task, unknowns: Sequence[Unknown], progress: Progress | None
) -> tuple[ImageModel, tuple[Group, ...], Solution, tuple[Unknown, ...]]:
    """Solve for parameters; where lights move, with lit intervals found anew in every round."""
    unknowns = tuple(unknowns)
    if any(unknown.moves and unknown.start != unknown.scene for unknown in unknowns):
        task, unknowns = _moved(task, unknowns, [unknown.start for unknown in unknowns])
    model = image_model(task, progress=None if progress is None else lambda share, what: progress(0.5 * share, what))
    # Paths cost more than what is done with them: starts have some of their own where these are far fewer.
    few = len(model.pixels) > _FEWER * pixels_of_rays(task, _FEW_RAYS)
    start = best_start(image_model(task, most=_FEW_RAYS) if few else model, unknowns)
    groups = confounded_groups(weighted_derivatives(model, unknowns, start))
    held = {number for group in groups for number in group.held}
    free = [number for number in range(len(unknowns)) if number not in held]
    given = {number: unknowns[number].scale.inward(unknowns[number].start) for number in held}
    if not free:
        return model, groups, _nothing(model), unknowns
    inner = start[free]
    turns = _MOVES if any(unknowns[number].moves for number in free) else 1
    for turn in range(turns):
        fixed = _holding(model, unknowns, given)
        known = [unknowns[number] for number in free]
        inner = robust_fit(fixed, known, inner) if turn == 0 else inner
        solution = weighted_fit(fixed, known, inner)
        step, inner = np.abs(solution.inner - inner), solution.inner
        if progress is not None:
            progress(0.5 + 0.5 * (turn + 1) / _MOVES, "fit")
        still = np.maximum(_STILL * _size(task), _STILL_IN_NOISE * np.sqrt(np.maximum(np.diag(solution.covariance), 0)))
        if turn + 1 == turns or (turn and np.all(step < still)):
            break
        outward = [unknown.start for unknown in unknowns]
        for number, value in zip(free, inner, strict=True):
            outward[number] = float(unknowns[number].scale.outward(float(value)))
        task, unknowns = _moved(task, unknowns, outward)
        model = image_model(task)
    return fixed, groups, solution, unknowns


def _size(task: Task) -> float:
    return max((float(np.linalg.norm(light.position - task.truth.origin)) for light in task.truth.lights), default=1.0)


def _moved(task: Task, unknowns: Sequence[Unknown], values: Sequence[float]) -> tuple[Task, tuple[Unknown, ...]]:
    """Return a task with the lights where parameters put them, and the parameters relative to there."""
    places = {number: list(light.position) for number, light in enumerate(task.truth.lights)}
    moved = list(unknowns)
    for row, (unknown, value) in enumerate(zip(unknowns, values, strict=True)):
        if unknown.moves:
            places[unknown.number][AXES.index(unknown.kind[-1])] = value
            moved[row] = replace(unknown, place=value)
    return at_places(task, {number: (x, y, z) for number, (x, y, z) in places.items()}), tuple(moved)


def _holding(model: ImageModel, unknowns: Sequence[Unknown], given: Mapping[int, float]) -> ImageModel:
    """Return the model with parameters held."""
    fog = model.fog
    for number, inner in given.items():
        fog = unknowns[number].put(fog, float(unknowns[number].scale.outward(inner)))
    return replace(model, fog=fog)


def _nothing(model: ImageModel) -> Solution:
    radiance = model.radiance(model.fog)
    kept = np.ones(len(model.pixels), dtype=bool)
    return Solution(
        np.empty(0), np.empty((0, 0)), model.image - radiance, radiance, kept, np.ones_like(radiance), np.empty(0)
    )


def _left(solution: Solution) -> Array:
    """Return the relative residual of lit values, (n,)."""
    lit = solution.radiance > 1e-3 * solution.radiance.mean()
    return np.asarray(np.abs(solution.residual[lit]) / solution.radiance[lit])


def _wrong(solution: Solution) -> float:
    """Return how far values are off, as `validation.comparison.engine_pixels` does: no single one decides."""
    left = _left(solution)
    return float(np.minimum(left, 1.0).mean()) if left.size else math.inf


def _fit(
    what: tuple[str, str, str, str],
    model: ImageModel,
    groups: tuple[Group, ...],
    solution: Solution,
    unknowns: Sequence[Unknown],
) -> Fit:
    held = {number for group in groups for number in group.held}
    doubtful = {number for group in groups for number in group.members}
    free = [number for number in range(len(unknowns)) if number not in held]
    known = [unknowns[number] for number in free]
    reach = interval_ends(model, known, solution) - solution.inner[:, None]
    lengths = dict(zip(free, np.copysign(np.hypot(reach, SIGMAS * _KNOWN), [-1, 1]), strict=True))
    inner = {number: unknowns[number].scale.inward(unknowns[number].start) for number in held}
    inner |= dict(zip(free, (float(value) for value in solution.inner), strict=True))
    rows = []
    for number, unknown in enumerate(unknowns):
        outward = unknown.scale.outward
        ends: tuple[float | None, float | None] = (None, None)
        if number not in doubtful:
            low, high = inner[number] + lengths[number]
            ends = _finite(outward(float(low))), _finite(outward(float(high)))
        rows.append(Fitted(unknown.name, float(outward(inner[number])), *ends, unknown.unit, unknown.scene))
    kept = solution.kept
    image, residual = model.image[kept], solution.residual[kept]
    mean = float(np.abs(image).mean()) if image.size else math.nan
    spread = float(np.sum((image - image.mean(axis=0)) ** 2)) if image.size else math.nan
    return Fit(
        *what,
        tuple(rows),
        _by_name(unknowns),
        float(np.sqrt(np.mean(residual**2))) / mean if mean > 0 else math.nan,
        1 - float(np.sum(residual**2)) / spread if spread > 0 else math.nan,
        len(kept),
        int((~kept).sum()),
        1.4826 * float(np.median(_left(solution))) if _left(solution).size else math.nan,
        tuple(_confounded(group, unknowns, inner, lengths, what[2]) for group in groups),
        math.nan,
    )


def _finite(value: Any) -> float | None:
    return float(value) if math.isfinite(value) else None


def _by_name(unknowns: Sequence[Unknown]) -> tuple[tuple[str, tuple[int, ...]], ...]:
    """Return the rows that JSON shows together: three channels that stand for one word."""
    names: dict[str, list[int]] = {}
    for number, unknown in enumerate(unknowns):
        names.setdefault(_whole(unknown), []).append(number)
    # A channel that was asked for by itself keeps its name.
    whole = {name: rows for name, rows in names.items() if len(rows) == 3 or len(unknowns[rows[0]].channels) == 3}
    ordered = [(name, tuple(rows)) for name, rows in whole.items()]
    taken = {number for rows in whole.values() for number in rows}
    ordered += [(unknown.name, (number,)) for number, unknown in enumerate(unknowns) if number not in taken]
    return tuple(sorted(ordered, key=lambda entry: entry[1]))


def _whole(unknown: Unknown) -> str:
    word, colon, place = unknown.name.partition(":")
    if len(unknown.channels) == 1:
        word = word.removesuffix(f".{CHANNELS[unknown.channels[0]]}")
    return word + colon + place


def _confounded(
    group: Group, unknowns: Sequence[Unknown], inner: Mapping[int, float], lengths: Mapping[int, Array], holds: str
) -> Confounded:
    names = {number: unknowns[number].name for number in group.members}
    products = []
    for kept, powers in group.powers.items():
        if all(unknowns[number].scale.relative for number in (kept, *powers)):
            words = [names[kept], *(_power(names[number], power) for number, power in powers.items())]
            middle = inner[kept] + sum(power * inner[number] for number, power in powers.items())
            low, high = (float(dr.exp(middle + float(length))) for length in lengths[kept])
            products.append(Product(" * ".join(words), math.exp(middle), low, _finite(high)))
    held = tuple(names[number] for number in group.held)
    return Confounded(tuple(names.values()), held, tuple(products), _way_out(group, unknowns, holds))


def _power(name: str, power: float) -> str:
    return name if abs(power - 1) < 1e-3 else f"{name}^{power:.3g}"


def _way_out(group: Group, unknowns: Sequence[Unknown], holds: str) -> str:
    kinds = {unknowns[number].kind for number in group.members}
    if len(group.held) == len(group.members):
        return "these do nothing in the pixels of this image: fit a layer in which they show"
    if "albedo" in kinds and holds == "airlight":
        return (
            "the airlight holds only their product: leave all but one out of --parameters, or fit a layer with lit "
            "surfaces, which the albedo does not change, such as --layer total"
        )
    return "leave all but one out of --parameters; what is left out keeps the value of the scene"
