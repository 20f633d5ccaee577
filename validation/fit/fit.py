# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of the fog that explain an image file of a scene, with their intervals."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from airlight.analytic.clock import stopwatch
from airlight.errors import InputError
from airlight.reference.storage.exr import NOTE, Image
from airlight.validation.arrays import Array, Bools, Progress
from airlight.validation.engine.observation import (
    PIXEL_WORDS,
    Observation,
    decide_pixel,
    judged_layer,
    observation_of,
    pixel_kinds,
    relative_errors,
    stopped,
)
from airlight.validation.engine.prediction import Predictor, SceneLight
from airlight.validation.engine.search import usual_size
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
from airlight.validation.scenes.models import model_line, model_parts, model_words

# An albedo is called above 1 from here on: beside what its interval says, samples of area lights,
# and rays that stand for a pixel, err by half a per cent.
_ALBEDO = 1.005


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
    model: Mapping[str, str] | None = None  #: name and terms of an equation that is not physical
    #: values that no fog has, and what these mean
    doubts: tuple[str, ...] = ()

    @property
    def lines(self) -> list[str]:
        """The lines that `airlight compare --fit` prints beside the table of parameters."""
        holds = "airlight + surface" if self.holds == "total" else self.holds
        outliers = (
            f"{self.left_out} of {self.pixels} pixels disagree with what explains the others, and "
            "are left out"
        )
        lines = [
            *([] if self.model is None else [model_line(**self.model)]),
            f"{self.path} as {holds} of {self.scene}, {PIXEL_WORDS[self.pixel]}: "
            f"{100 * self.explained:.6g} % of its "
            f"variance is explained; the relative rmse left is {self.residual:.3g}, the usual "
            "error of a value "
            f"{self.noise:.2g}.",
            # If more than a tenth of the pixels are left out, the reader should look why.
            outliers
            + (": look where, by airlight compare" if self.left_out > 0.1 * self.pixels else "")
            + ".",
        ]
        # An image of whose variance less than 99 % is explained is not understood.
        if self.explained < 0.99:
            lines.append("That is no explanation: something that was not looked for is different.")
        held = {name for group in self.confounded for name in group.parameters}
        lines += [
            f"{each.name} has no upper end: this image allows any value above {each.low:.6g}."
            for each in self.parameters
            if each.high is None and each.low is not None and each.name not in held
        ]
        lines += [f"{words}." for words in self.doubts]
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

    Valid for single scattering: homogeneous media and height fog, point and spot lights,
    directional ones where media have bounds or density falls with height; area lights are 16 to 128
    samples here, which leaves some 0.5 % in a pixel. The intervals count pixels as independent of
    one another.

    Parameters
    ----------
    image, path
        The image, and its name in messages.
    loaded
        The scene at the size of the image: it says the geometry, the camera, the lights, the
        equation, and all parameters that are not looked for.
    parameters
        The names of the parameters that are looked for, see `validation.fit.unknowns`.
    layer, holds
        The layer, and what it holds, see `validation.engine.observation.judged_layer`.
    pixel
        'centre' or 'area'; by default what the image says of itself, or what fits better.
    mask
        Which pixels may take part, (height, width); all by default.
    starts
        Values to begin with, by the name of the parameter; by default the values of the scene.
    progress
        Called with (fraction done, what).

    Raises
    ------
    InputError
        If too few pixels say something, the scene has no parameter of a name, or fits do not
        predict the scene.
    """
    # The layer that is fitted, the pixels that take part, and the numbers that are looked for.
    took = stopwatch()
    kinds = pixel_kinds(image, pixel)
    judged = judged_layer(image, path, name=layer, holds=holds)
    observation, wrong = observation_of(image, judged, loaded.scene, mask=mask, model=loaded.model)
    unknowns = read_unknowns(parameters, observation.reference, starts or {}, loaded.model)
    # Pixels that are cut off at the brightest value say only that they are brighter. 20 000 rays
    # are looked at, each pixel by itself: more say nothing new of few numbers.
    stops = stopped(np.where(observation.used[:, None], observation.values, np.nan)).any(axis=1)
    observation = replace(observation, used=observation.used & ~stops, rays=20_000, apart=0)
    # Four pixels for each number, sixteen at least.
    fewest = max(16, 4 * len(unknowns))
    if (count := int(observation.used.sum())) < fewest:
        raise InputError(
            f"{path}: {count} pixels of the layer '{judged.name}' say something; "
            "expected at least "
            f"{fewest}, finite, not cut off at the brightest value, and left by the mask"
        )

    def solved(kind: str) -> _Solved:
        tell = None if progress is None else _stage(progress, kinds.index(kind), len(kinds))
        return _solved(_predictor(replace(observation, area=kind == "area")), unknowns, tell)

    # Each kind of pixels is solved for by itself, and the kind that leaves less is right; at a mean
    # relative error of 1e-5 the first kind is right beyond doubt.
    kind, best = decide_pixel(
        kinds,
        solved,
        lambda several: [_wrong(each.solution) for each in several],
        lambda each: _wrong(each.solution) < 1e-5,
    )
    fit = _fit((loaded.name, path, judged.holds, kind.pixel), unknowns, best)
    words = None if loaded.model.is_physical else model_parts(model_words(loaded.model))
    note = str(image.attributes.get(NOTE, ""))
    return replace(fit, seconds=took().seconds, failures=wrong, note=note, model=words)


def _predictor(observation: Observation) -> Predictor:
    """Return what predicts an image; every evaluation needs all its paths, so none are dropped."""
    return Predictor(observation, SceneLight(observation.reference, most=math.inf))


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
    # Starts are compared on 3000 rays. Paths cost more than the sums over them: these rays have
    # paths of their own only where they are less than a quarter of all.
    few = _predictor(replace(predictor.observation, rays=3000))
    start = best_start(
        Model.of(few, unknowns) if len(model.image) > 4 * few.observation.most_pixels else model
    )
    # Some of the parameters that the image does not tell apart are held from here on.
    groups = confounded_groups(
        (model.slopes(start) / model.relative[:, :, None]).reshape(-1, len(unknowns))
    )
    free = ~np.isin(np.arange(len(unknowns)), [number for group in groups for number in group.held])
    model, inner = model.holding(free, model.at), start[free]
    if not free.any():
        return _Solved(model, free, groups, no_solution(model))
    # Lit intervals are held while the parameters are solved for. Where a light moves, they are
    # found again at each solution, up to twelve times.
    inner = robust_fit(model, inner)
    most_turns = 12
    turns = most_turns if any(unknown.held for unknown in model.unknowns) else 1
    for turn in range(turns):
        solution = weighted_fit(model, inner)
        step, inner = np.abs(solution.inner - inner), solution.inner
        if progress is not None:
            progress(0.5 + 0.5 * (turn + 1) / most_turns, "fit")
        # A light does not move any more where its step is less than a millionth of its distance
        # from the camera, or a fiftieth of a standard error, which the interval would not show.
        error = np.sqrt(np.maximum(np.diag(solution.covariance), 0))
        still = np.maximum(1e-6, 0.02 * error)
        if turn + 1 == turns or (turn and np.all(step < still)):
            break
        model = replace(model, at=inner, predictor=_predictor(predictor.observation))
    return _Solved(model, free, groups, solution)


def _relative_residual(solution: Solution) -> Array:
    """Return the relative residual of lit values, (n,)."""
    lit = solution.radiance > 1e-3 * solution.radiance.mean()
    return np.asarray(np.abs(solution.residual[lit]) / solution.radiance[lit])


def _wrong(solution: Solution) -> float:
    """Return the mean relative error of the values, as `validation.engine.judge` does: no single
    value decides it.
    """
    floor, image = (
        FLOOR * float(np.abs(solution.radiance).mean()),
        solution.radiance + solution.residual,
    )
    return (
        float(np.abs(relative_errors(solution.radiance, image, floor)).mean())
        if image.size
        else math.inf
    )


def _fit(what: tuple[str, str, str, str], unknowns: tuple[Unknown, ...], solved: _Solved) -> Fit:
    """Return a solution as values with intervals.

    `what`: the scene, the path, what the layer holds, and the kind of its pixels.
    """
    # On the whole line: held parameters stay where they begin.
    model, solution, groups = solved.model, solved.solution, solved.groups
    doubtful = {number for group in groups for number in group.members}
    inner = Model.of(model.predictor, unknowns).at
    inner[solved.free] = solution.inner
    # Halves of intervals, with a standard error of 1e-6 that is always there: scenes are read, and
    # images written, in float32.
    reach = interval_ends(model, solution) - solution.inner[:, None]
    lengths = np.full((len(unknowns), 2), np.nan)
    lengths[solved.free] = np.copysign(np.hypot(reach, SIGMAS * 1e-6), [-1, 1])
    rows = []
    for number, unknown in enumerate(unknowns):
        value, low, high = (
            unknown.number.outward(inner[number] + part) for part in (0.0, *lengths[number])
        )
        # A parameter of a group has no interval of its own, even if it was free.
        ends = (None, None) if number in doubtful else (_finite(low), _finite(high))
        rows.append(Fitted(unknown.name, value, *ends, unknown.unit, unknown.scene))
    # Residual and variance are those of the pixels without outliers; an image of one value has no
    # variance to explain.
    mask = solution.mask
    image, residual = model.image[mask], solution.residual[mask]
    relative = _relative_residual(solution)
    mean = float(np.abs(image).mean()) if image.size else math.nan
    spread = float(np.sum((image - image.mean(axis=0)) ** 2)) if image.size else math.nan
    return Fit(
        *what,
        tuple(rows),
        float(np.sqrt(np.mean(residual**2))) / mean if mean > 0 else math.nan,
        1 - float(np.sum(residual**2)) / spread if spread > 0 else math.nan,
        len(mask),
        int((~mask).sum()),
        usual_size(relative) if relative.size else math.nan,
        tuple(confounded(group, unknowns, inner, lengths, what[2]) for group in groups),
        math.nan,
        doubts=_doubts(rows, unknowns),
    )


def _doubts(rows: Sequence[Fitted], unknowns: Sequence[Unknown]) -> tuple[str, ...]:
    """Return what it means that albedos are above 1 by more than their errors; nothing where none
    is.
    """
    names = [
        row.name
        for row, unknown in zip(rows, unknowns, strict=True)
        if unknown.kind == "albedo" and row.low is not None and row.low > _ALBEDO
    ]
    if not names:
        return ()
    are = "is" if len(names) == 1 else "are"
    return (
        f"{' and '.join(names)} {are} above 1, which no medium has: the image solves another "
        "equation than this fit (name it by --model, see airlight list models), holds light that "
        "was scattered more than once, or has brighter lights than the scene (look for 'intensity' "
        "too, in a layer with surfaces)",
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
