# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of the fog that explain an image file of a scene, with their intervals."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from airlight.analytic.clock import stopwatch
from airlight.errors import InputError
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.storage.exr import NOTE, Image
from airlight.validation.arrays import Array, Bools, Progress
from airlight.validation.engine.prediction import Predictor, SceneLight
from airlight.validation.engine.seen import (
    PIXEL_WORDS,
    Seen,
    decide_pixel,
    judged_layer,
    pixel_kinds,
    relative_errors,
    seen_image,
    stopped,
)
from airlight.validation.fit.confounding import Confounded, Group, confounded, confounded_groups
from airlight.validation.fit.solve import (
    SIGMAS,
    Model,
    Solution,
    best_start,
    interval_ends,
    no_solution,
    robust_fit,
    weighted_fit,
)
from airlight.validation.fit.unknowns import Unknown, read_unknowns
from airlight.validation.metrics.errors import FLOOR
from airlight.validation.scenes.loading import LoadedScene

_MOVES = 12  # rounds in which lit intervals are found again
_STILL = 1e-6  # of the distance of a light from the camera: it does not move any more
_STILL_IN_NOISE = 0.02  # of a standard error: the interval would not show it
# a standard error that is always there: scenes are read, and images written, in float32
_KNOWN = 1e-6
_EXACT = 1e-5  # mean relative residual at which pixels are centres beyond doubt
_MANY_RAYS = 20_000  # that are looked at: more say nothing new of few numbers
_FEW_RAYS = 3000  # on which starts are compared
_FEWER = 4
_FEWEST = 16  # pixels
_MANY = 0.1  # fraction of the pixels: if more are left out, the reader should look why
_BAD = 0.99  # fraction of the variance: an image that is explained less is not understood


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
class Fit:
    """The parameters of a scene that explain an image."""

    scene: str
    path: str
    holds: str  #: what the layer holds: 'airlight', 'surface' or 'total'
    pixel: str  #: 'centre' or 'area'
    parameters: tuple[Fitted, ...]
    residual: float  #: relative rmse that is left, over the pixels that took part
    explained: float  #: fraction of the image's variance
    pixels: int  #: that were looked at
    left_out: int  #: of these, how many disagree with what explains the others
    noise: float  #: median of the relative residual, as a standard deviation
    confounded: tuple[Confounded, ...]
    seconds: float  #: that the fit took, with the paths of light
    #: what is wrong with the file, such as pixels that are not finite
    failures: tuple[str, ...] = ()
    note: str = ""  #: what the reader of the file changed or left out, such as other primaries

    @property
    def lines(self) -> list[str]:
        """The lines that `airlight compare --fit` prints beside the table of parameters."""
        holds = "airlight + surface" if self.holds == "total" else self.holds
        left = f"{self.left_out} of {self.pixels} pixels disagree with what explains the others, and are left out"
        lines = [
            f"{self.path} as {holds} of {self.scene}, {PIXEL_WORDS[self.pixel]}: "
            f"{100 * self.explained:.6g} % of its "
            f"variance is explained; the relative rmse left is {self.residual:.3g}, the usual "
            "error of a value "
            f"{self.noise:.2g}.",
            left
            + (": look where, by airlight compare" if self.left_out > _MANY * self.pixels else "")
            + ".",
        ]
        if self.explained < _BAD:
            lines.append("That is no explanation: something that was not looked for is different.")
        held = {name for group in self.confounded for name in group.parameters}
        lines += [
            f"{each.name} has no upper end: this image allows any value above {each.low:.6g}."
            for each in self.parameters
            if each.high is None and each.low is not None and each.name not in held
        ]
        lines += [f"Failed: {reason}." for reason in self.failures]
        lines += [f"The file: {self.note}."] if self.note else []
        lines.append(f"The fit took {self.seconds:.2g} s.")
        return lines + [line for group in self.confounded for line in group.lines]


def fit_image(
    image: Image,
    loaded: LoadedScene,
    parameters: Sequence[str],
    *,
    path: str = "the image",
    layer: str | None = None,
    holds: str | None = None,
    pixel: str | None = None,
    mask: Bools | None = None,
    starts: Mapping[str, float] | None = None,
    progress: Progress | None = None,
) -> Fit:
    """Find the parameters that explain an image.

    `loaded`: the scene, at the size of the image: geometry, camera and lights are taken from it,
    and what is not looked for; `parameters`, `starts`: what is looked for, see
    `validation.fit.unknowns`, and values to begin with; the scene's own by default; `layer`,
    `holds`: which layer, and what it holds, see `validation.engine.seen.judged_layer`; `pixel`:
    'centre' or 'area'; by default what the image says of itself, or what fits better; `mask`: which
    pixels may take part, (height, width); all by default.

    Valid for single scattering: homogeneous media and height fog, point and spot lights,
    directional ones where media have bounds or density falls with height; area lights are 16 to 128
    samples here, which leaves some 0.5 % in a pixel. The intervals count pixels as independent of
    one another.
    """
    took = stopwatch()
    kinds = pixel_kinds(image, pixel)
    judged = judged_layer(image, path, name=layer, holds=holds)
    seen, wrong = seen_image(image, judged, loaded.scene, mask=mask)
    unknowns = read_unknowns(parameters, seen.reference, starts or {})
    stops = stopped(np.where(seen.used[:, None], seen.values, np.nan)).any(axis=1)
    seen = replace(seen, used=seen.used & ~stops, rays=_MANY_RAYS, apart=0)
    fewest = max(_FEWEST, 4 * len(unknowns))
    if int(seen.used.sum()) < fewest:
        raise InputError(
            f"{path}: {int(seen.used.sum())} pixels of the layer '{judged.name}' say something; "
            "expected at least "
            f"{fewest}, finite, not cut off at the brightest value, and left by the mask"
        )

    def solved(kind: str) -> _Solved:
        tell = None if progress is None else _stage(progress, kinds.index(kind), len(kinds))
        return _solved(_predictor(replace(seen, area=kind == "area")), unknowns, tell)

    kind, found = decide_pixel(
        kinds,
        solved,
        lambda found: [_wrong(each.solution) for each in found],
        lambda each: _wrong(each.solution) < _EXACT,
    )
    fit = _fit((loaded.name, path, judged.holds, kind.pixel), unknowns, found)
    return replace(
        fit, seconds=took().seconds, failures=wrong, note=str(image.attributes.get(NOTE, ""))
    )


def _predictor(seen: Seen) -> Predictor:
    """Return what predicts an image; every evaluation needs all its paths, so none are dropped."""
    return Predictor(seen, SceneLight(seen.reference, most=math.inf))


def _stage(progress: Progress, number: int, count: int) -> Progress:
    return lambda fraction, what: progress((number + fraction) / count, what)


@dataclass(frozen=True)
class _Solved:
    model: Model  #: of the parameters that are free, with the others held
    free: Bools  #: which are free, (parameters,)
    groups: tuple[Group, ...]
    solution: Solution


def _solved(
    predictor: Predictor, unknowns: tuple[Unknown, ...], progress: Progress | None
) -> _Solved:
    """Solve for parameters; where lights move, with lit intervals found again in every round."""
    model = Model.of(predictor, unknowns)
    if progress is not None:
        progress(0.5, "lit intervals")
    # Paths cost more than what is done with them: starts have some of their own
    # where these are far fewer.
    few = _predictor(replace(predictor.seen, rays=_FEW_RAYS))
    start = best_start(
        Model.of(few, unknowns) if len(model.image) > _FEWER * few.seen.most_pixels else model
    )
    groups = confounded_groups(
        (model.slopes(start) / model.relative[:, :, None]).reshape(-1, len(unknowns))
    )
    free = ~np.isin(np.arange(len(unknowns)), [number for group in groups for number in group.held])
    model, inner = model.holding(free, model.at), start[free]
    if not free.any():
        return _Solved(model, free, groups, no_solution(model))
    inner = robust_fit(model, inner)
    turns = _MOVES if any(unknown.held for unknown in model.unknowns) else 1
    for turn in range(turns):
        solution = weighted_fit(model, inner)
        step, inner = np.abs(solution.inner - inner), solution.inner
        if progress is not None:
            progress(0.5 + 0.5 * (turn + 1) / _MOVES, "fit")
        error = np.sqrt(np.maximum(np.diag(solution.covariance), 0))
        still = np.maximum(_STILL * _size(predictor.reference), _STILL_IN_NOISE * error)
        if turn + 1 == turns or (turn and np.all(step < still)):
            break
        model = replace(model, at=inner, predictor=_predictor(predictor.seen))
    return _Solved(model, free, groups, solution)


def _size(reference: ReferenceScene) -> float:
    return max(
        (float(np.linalg.norm(light.position - reference.origin)) for light in reference.lights),
        default=1.0,
    )


def _left(solution: Solution) -> Array:
    """Return the relative residual of lit values, (n,)."""
    lit = solution.radiance > 1e-3 * solution.radiance.mean()
    return np.asarray(np.abs(solution.residual[lit]) / solution.radiance[lit])


def _wrong(solution: Solution) -> float:
    """Return how far values are off, as `validation.engine.judge` does: no single one decides."""
    floor, image = (
        FLOOR * float(np.abs(solution.radiance).mean()),
        solution.radiance + solution.residual,
    )
    return (
        float(np.abs(relative_errors(solution.radiance, image, floor)).mean())
        if image.size
        else math.inf
    )


def _fit(what: tuple[str, str, str, str], unknowns: tuple[Unknown, ...], found: _Solved) -> Fit:
    model, solution, groups = found.model, found.solution, found.groups
    doubtful = {number for group in groups for number in group.members}
    inner = Model.of(model.predictor, unknowns).at
    inner[found.free] = solution.inner
    reach = interval_ends(model, solution) - solution.inner[:, None]
    lengths = np.full((len(unknowns), 2), np.nan)
    lengths[found.free] = np.copysign(np.hypot(reach, SIGMAS * _KNOWN), [-1, 1])
    rows = []
    for number, unknown in enumerate(unknowns):
        value, low, high = (
            unknown.number.outward(inner[number] + part) for part in (0.0, *lengths[number])
        )
        ends = (None, None) if number in doubtful else (_finite(low), _finite(high))
        rows.append(Fitted(unknown.name, value, *ends, unknown.unit, unknown.scene))
    kept = solution.kept
    image, residual = model.image[kept], solution.residual[kept]
    mean = float(np.abs(image).mean()) if image.size else math.nan
    spread = float(np.sum((image - image.mean(axis=0)) ** 2)) if image.size else math.nan
    return Fit(
        *what,
        tuple(rows),
        float(np.sqrt(np.mean(residual**2))) / mean if mean > 0 else math.nan,
        1 - float(np.sum(residual**2)) / spread if spread > 0 else math.nan,
        len(kept),
        int((~kept).sum()),
        1.4826 * float(np.median(_left(solution))) if _left(solution).size else math.nan,
        tuple(confounded(group, unknowns, inner, lengths, what[2]) for group in groups),
        math.nan,
    )


def _finite(value: Any) -> float | None:
    return float(value) if math.isfinite(value) else None
