# SPDX-License-Identifier: BSD-3-Clause
"""Frames that another renderer made of a scene, against the reference of each frame,
and what is said of them.

**Masks.** Every measure is taken of all pixels, of those that were disoccluded up to eight frames
ago, of the others, and of those within a pixel of a lamp. A surface point was disoccluded where it
lay outside the frame before, or was hidden there: what stood in its pixel was nearer by more than 5
%. Shadows that move are no disocclusion.

**Verdict.** A lag is reported where its error is known and below a quarter of a frame, and where
the second-best delay is worse by more than four errors. Frames are late, or early, where only a
delay is left: nothing persists within four errors, and the delay describes 95 % of what an impulse
response does. They lag where a lag describes 90 %; what is less is not one lag, and a ghost where
light that left is still there by more than four errors. Without any of these the error is noise, a
factor and an offset. A number without an error decides nothing: the verdict then says why.
"""

import math
import os
from collections.abc import Mapping
from collections.abc import Sequence as Several
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from airlight.errors import InputError
from airlight.reference.scene.camera import film_positions
from airlight.reference.scene.read import ReferenceScene, read_reference
from airlight.reference.storage.exr import NOTE, read_exr
from airlight.reference.storage.files import temporary_folder
from airlight.validation.arrays import Array, Bools, Index, Progress
from airlight.validation.engine.judge import lamp_distance
from airlight.validation.engine.seen import (
    PIXELS,
    JudgedLayer,
    expected_layer,
    judged_layer,
    pixel_kinds,
    scene_of_size,
)
from airlight.validation.estimates.quadrature import (
    known_to,
    known_words,
    reference_image,
    relative_error,
)
from airlight.validation.motion.blocks import BLOCK
from airlight.validation.motion.frames_file import FramesRecord, frame_paths, read_frames
from airlight.validation.motion.lag import SURE, Lag
from airlight.validation.motion.measures import AGES, Measures, Sequence, measure
from airlight.validation.scenes.changes import move_shapes, shift_film
from airlight.validation.scenes.loading import load_scene
from airlight.validation.statistics.estimate import Answer, Estimate, fact
from airlight.validation.statistics.samples import UNTOLD_SERIES

_ROUNDING = 1e-6  # relative error of exact frames in files of float32
_FACTOR = 1e-5  # relative: a gain nearer to 1 is not worth a word
# of a lag that is reported [frames]: half of one is the distance to the next whole delay
_LARGEST_ERROR = 0.25
_ONE_LAG, _ONE_DELAY = 0.9, 0.95  # of what an impulse response describes
_HIDDEN = 0.95  # of the distance of a point: what stood before it by less hid it
_POP = 3.0  # times the median change of the error
_RECENT = 8  # frames since a point was disoccluded
_BESIDE = 1.0  # of a lamp [pixels]


@dataclass(frozen=True)
class MotionVerdict:
    """The verdict on a sequence of frames."""

    kind: str  #: 'exact', 'noise', 'lag', 'late', 'ghost', 'not one lag' or 'cannot be told'
    words: str


@dataclass(frozen=True)
class MotionComparison:
    """Frames of a renderer against the reference of each."""

    scene: str
    files: str  #: with # for the digits of a number
    size: tuple[int, int]
    frames: int
    layer: str
    expected: str  #: what the layer was compared with: 'airlight', 'surface', or 'total' for both
    pixel: str
    #: mean of the layer of the reference, and its error, of the worst frame [W/(m^2 sr)]
    known: Estimate
    masks: Mapping[str, Measures]  #: 'all' first
    verdict: MotionVerdict
    lag_ms: float | None  #: None where the frames have no rate
    #: relative RMSE of frames against the reference so many frames before
    shifts: Mapping[int, float]
    notes: tuple[str, ...]
    failures: tuple[str, ...]  #: why the comparison must be called failed

    @property
    def measures(self) -> Measures:
        """Those of all pixels."""
        return self.masks["all"]

    @property
    def lines(self) -> list[str]:
        """Return the numbers as text, a line for each group."""
        found, lag = self.measures, self.measures.lag
        width, height = self.size
        lines = [
            f"scene            {self.scene}, {width} x {height}, {self.frames} frames; reference: "
            f"{self.expected}, pixel {self.pixel}, {known_words(self.known)}",
            f"values           {found.values}, {found.nonfinite} not finite; the reference changes "
            "by "
            f"{_percent(found.reference_change)} a frame",
            f"relative RMSE    {found.relative_rmse.percent()}, relative bias "
            f"{found.bias.percent()}",
            f"flicker          {found.flicker.percent()} a frame, "
            f"{found.flicker_beside_lag.percent()} beside the lag",
            f"lag              {lag.lag.words()} frames: delay {_delay_words(lag)}, persistence "
            f"{lag.persistence.words()}, gain {lag.gain.words()}",
            f"ghost            {found.ghost.percent()} of the light that left in {AGES} frames",
        ]
        if found.pop is not None:
            words = "a pop" if found.pop >= _POP else "no pop"
            lines.append(
                f"largest change   of the error in frame {found.pop_frame}, {found.pop:.3g} times "
                f"the median: {words}"
            )
        for name, each in self.masks.items():
            if name != "all":
                lines.append(
                    f"{name:16} {each.values} values: relative RMSE "
                    f"{each.relative_rmse.percent()}, flicker "
                    f"{each.flicker.percent()}, lag {each.lag.lag.words()}, ghost "
                    f"{each.ghost.percent()}"
                )
        shifts = ", ".join(f"{shift:+d}: {_percent(error)}" for shift, error in self.shifts.items())
        lines += (
            [f"shifted          {shifts} off the reference so many frames before"] if shifts else []
        )
        lines += [f"note             {note}" for note in self.notes]
        lines += [f"failed           {reason}" for reason in self.failures]
        return [*lines, f"verdict          {self.verdict.words}"]


def compare_frames(
    scene: str,
    pattern: str | os.PathLike[str],
    about: str | os.PathLike[str],
    *,
    layer: str | None = None,
    holds: str | None = None,
    pixel: str | None = None,
    margin: float | None = None,
    progress: Progress | None = None,
) -> MotionComparison:
    """Compare the frames of a renderer with the references of a scene that changes.

    `pattern`: the EXR files, # for each digit of their numbers; `about`: `frames.json`, see
    `validation.motion.frames_file`; the rest as of `validation.engine.judge.compare_scene`. Raises
    InputError for what cannot be read, frames of two sizes, and changes that the scene does not
    have.
    """
    record = read_frames(about)
    paths = frame_paths(pattern, record, str(about))
    first = read_exr(paths[0])
    judged = judged_layer(first, paths[0], name=layer or record.layer, holds=holds)
    kinds = pixel_kinds(first, pixel or record.pixel)
    scene_of_size(scene, judged.size, paths[0])
    with temporary_folder() as folder:
        frames = _Frames(folder, scene, record, judged, kinds[0])
        for n, path in enumerate(paths):
            frames.take(n, path)
        for n in range(record.frames):
            if progress is not None:
                progress(0.8 * n / record.frames, f"the reference of frame {n}")
            frames.expect(n)
        if min(frames.nonfinite) == judged.values.size:
            raise InputError(f"{pattern}: no frame has a finite value: all are NaN or infinite")
        if progress is not None:
            progress(0.8, "measures")
        masks = {
            name: measured
            for name in frames.masks
            if (measured := measure(frames.sequence(name))) is not None
        }
        if "all" not in masks:
            raise InputError(
                f"{pattern}: the reference of every frame is dark: nothing is relative to it"
            )
        shifts = _shifts(frames.sequence("all"))
    notes: tuple[str, ...] = ()
    if len(kinds) > 1:
        notes += (
            'judged at pixel centres: the files do not say; expected "pixel": '
            f"{' or '.join(PIXELS)}",
        )
    if repeated := masks["all"].repeated:
        notes += (
            f"frames {_listed(repeated)} repeat the frame before them, though the reference changed",
        )
    if NOTE in first.attributes:
        notes += (f"{paths[0]}: {first.attributes[NOTE]}",)
    found = masks["all"]
    lag = found.lag.lag.value
    verdict = motion_verdict(found, relative_error(frames.known))
    failures = []
    if any(frames.nonfinite):
        wrong = [f"{n} ({path.name})" for n, path in enumerate(paths) if frames.nonfinite[n]]
        failures.append(
            f"{sum(frames.nonfinite)} values are NaN or infinite, in frames {_listed(wrong)}"
        )
    if (
        margin is not None
        and verdict.kind != "exact"
        and found.bias.within(margin) is not Answer.YES
    ):
        why = "" if found.bias.error is not None else f": {UNTOLD_SERIES}"
        failures.append(f"the relative bias is not shown to be within +-{margin:.3g}{why}")
    return MotionComparison(
        scene=scene,
        files=str(pattern),
        size=judged.size,
        frames=record.frames,
        layer=judged.name,
        expected=judged.holds,
        pixel=kinds[0],
        known=frames.known,
        masks=masks,
        verdict=verdict,
        lag_ms=None if lag is None or record.fps is None else 1000 * lag / record.fps,
        shifts=shifts,
        notes=notes,
        failures=tuple(failures),
    )


class _Frames:
    """The frames of a renderer and their references, as arrays in a folder, and which
    pixels are in which mask.
    """

    def __init__(
        self, folder: Path, scene: str, record: FramesRecord, judged: JudgedLayer, pixel: str
    ) -> None:
        self._folder, self._scene, self._record, self._judged, self._pixel = (
            folder,
            scene,
            record,
            judged,
            pixel,
        )
        self.known = fact(0.0)  # of the frame that is known worst
        self.nonfinite: list[int] = []  # values of each frame that are NaN or infinite
        shape = (record.frames, *judged.values.shape[:2])
        self._uncovered, self._beside = np.zeros((2, *shape), dtype=bool)
        # of the last frame, since a point was disoccluded
        self._ages = np.full(shape[1:], math.inf)
        self._seen: ReferenceScene | None = None  # in the last frame
        self._distance = np.zeros(shape[1:])
        self._shown: list[int] = []  # the frame that has the same reference first

    def take(self, n: int, path: Path) -> None:
        """Keep a frame, which must have the size of the first."""
        values = judged_layer(
            read_exr(path), path, name=self._judged.name, holds=self._judged.holds
        ).values
        if values.shape != self._judged.values.shape:
            sizes = [
                " x ".join(str(side) for side in each.shape[1::-1])
                for each in (values, self._judged.values)
            ]
            raise InputError(f"frame {n}: {path} has {sizes[0]} pixels, the first frame {sizes[1]}")
        self.nonfinite.append(int((~np.isfinite(values)).sum()))
        np.save(
            self._folder / f"frame-{n}.npy", values.astype(np.float64) / 2 ** self._record.stops(n)
        )

    def expect(self, n: int) -> None:
        """Keep the reference and the masks of a frame; refuse changes that the scene does
        not have, by its number.
        """
        record = self._record
        if n and record.shown(n) == record.shown(n - 1):
            self._shown.append(self._shown[-1])
            self._ages = self._ages + 1
            self._beside[n] = self._beside[n - 1]
        else:
            try:
                changes, moves, jitter = record.shown(n)
                loaded = load_scene(self._scene, self._judged.size, changes)
                move_shapes(loaded.scene, moves)
                shift_film(loaded.scene, *jitter)
                image = reference_image(loaded.scene, pixel=self._pixel)
            except InputError as error:
                raise InputError(f"frame {n}: {error}") from error
            self._shown.append(n)
            self.known = max(self.known, known_to(image, self._judged.holds), key=_doubt)
            np.save(self._folder / f"reference-{n}.npy", expected_layer(image, self._judged))
            self._beside[n] = lamp_distance(loaded, image) <= _BESIDE
            self._uncover(image.distance, read_reference(loaded.scene))
        self._uncovered[n] = self._ages <= _RECENT

    @property
    def masks(self) -> tuple[str, ...]:
        """Return the masks that some pixel of some frame is in."""
        moved, lamps = self._uncovered.any(), self._beside.any()
        return (
            "all",
            *(("disoccluded", "rest") if moved else ()),
            *(("next to a light",) if lamps else ()),
        )

    def sequence(self, mask: str) -> Sequence:
        """Return the sequence with the pixels of a mask."""
        everywhere = np.ones_like(self._beside)
        masks = {"all": everywhere, "disoccluded": self._uncovered, "rest": ~self._uncovered}
        selected = masks.get(mask, self._beside)
        # The pixels beside a lamp are few: of the files only the blocks that have some are read.
        rows, columns = (_blocks(selected.any(axis=axes)) for axes in ((0, 2), (0, 1)))

        def read(name: str) -> Array:
            return np.array(np.load(self._folder / name, mmap_mode="r")[rows, columns])

        return Sequence(
            self._record.frames,
            lambda n: read(f"frame-{n}.npy"),
            lambda n: read(f"reference-{self._shown[n]}.npy"),
            lambda n: selected[n, rows, columns],
            self._record.resets,
        )

    def _uncover(self, distance: Array, here: ReferenceScene) -> None:
        """Tell how many frames ago the point of each pixel was disoccluded; this frame
        differs from the one before.
        """
        before, self._seen = self._seen, here
        there, self._distance = self._distance, distance
        moving = self._record.objects or any(
            name.startswith("camera.") for name in self._record.changes
        )
        if before is None or not moving:
            return
        far = 1e6 * (1.0 + float(np.abs(here.origin).max()))
        points = (
            here.origin
            + np.where(np.isfinite(distance), distance, far).reshape(-1, 1) * here.direction
        )
        row, column, inside = _pixel_of(before, points)
        hidden = there[row, column] < _HIDDEN * np.linalg.norm(points - before.origin, axis=1)
        self._ages = np.where(~inside | hidden, 0.0, self._ages[row, column] + 1).reshape(
            distance.shape
        )


def _doubt(known: Estimate) -> float:
    """Return the relative error of a reference; infinite where it is not known, and
    below any where all is dark.
    """
    relative = relative_error(known)
    return relative if relative is not None else math.inf if known.value else -1.0


def _blocks(some: Bools) -> slice:
    """Return the rows, or columns, from the first of the blocks that have some to the last."""
    places = np.flatnonzero(some) if some.any() else np.zeros(1, dtype=int)
    return slice(places[0] // BLOCK * BLOCK, (places[-1] // BLOCK + 1) * BLOCK)


def _pixel_of(reference: ReferenceScene, points: Array) -> tuple[Index, Index, Bools]:
    """Return row and column of the pixels that show points, and whether these lie in the image."""
    size = reference.width, reference.height
    place = np.floor(film_positions(reference.scene.sensors()[0], points - reference.origin, size))
    inside = np.all((place >= 0) & (place < np.array(size)), axis=1)  # behind the camera it is NaN
    column, row = np.where(inside[:, None], place, 0).astype(np.int64).T
    return row, column, inside


def _shifts(sequence: Sequence) -> dict[int, float]:
    """Return the relative RMSE of frames against the reference so many frames
    before, of the same frames.
    """
    shifts = range(-2, 4)
    frames = range(max(shifts), sequence.frames + min(shifts))
    sums, light = dict.fromkeys(shifts, 0.0), 0.0
    for n in frames:
        frame = sequence.frame(n)
        light += float(sequence.reference(n).mean())
        for shift in shifts:
            error = frame - sequence.reference(n - shift)
            finite = error[np.isfinite(error)]
            sums[shift] += float(np.mean(finite**2)) if finite.size else 0.0
    if not light:
        return {}
    return {shift: math.sqrt(sums[shift] * len(frames)) / light for shift in shifts}


def motion_verdict(measures: Measures, reference_error: float | None = None) -> MotionVerdict:
    """Return the verdict on a sequence from its measures, see the module.

    `reference_error`: of the references, relative to their mean; None where it is not known.
    """
    # The RMSE of these frames is a fact: only what the reference does not know itself
    # stands between it and zero.
    rmse = measures.relative_rmse.value
    limit = _ROUNDING if reference_error is None else max(_ROUNDING, 3 * reference_error)
    if rmse is not None and rmse <= limit:
        return MotionVerdict("exact", f"exact: relative RMSE {rmse:.2g}")

    # Nothing is said of a filter whose numbers have no errors, or large ones.
    lag, persistence, delay = measures.lag.lag, measures.lag.persistence, measures.lag.delay
    beside = measures.flicker_beside_lag.value
    noise = (
        "noise beside it is unknown"
        if beside is None
        else f"noise of {_percent(beside / math.sqrt(2))}"
    )
    if beside is not None and beside <= _ROUNDING:
        noise = "no noise beyond rounding"
    if reason := _undecided(measures):
        return MotionVerdict("cannot be told", f"no lag can be told: {reason}; {noise}")

    # One filter explains the frames: a delay, or a delay and a history.
    persists = persistence.within(_ROUNDING, SURE) is Answer.NO
    filtered = persists or bool(delay)
    apart = measures.lag.delay_margin.exceeds(0.0, SURE) is Answer.YES
    # Frames that are early have light that no response to earlier light explains.
    described = 1.0 if delay is not None and delay < 0 else measures.lag.described
    if filtered and apart and described is not None:
        if delay and not persists and described > _ONE_DELAY:
            words = "late" if delay > 0 else "early"
            return MotionVerdict("late", f"the frames are {words} by {_frames(abs(delay))}")
        if described >= _ONE_LAG:
            constant = measures.lag.time_constant.value
            after = (
                ""
                if constant is None
                else f"; what is missing of a change falls as exp(-n/{constant:.3g})"
            )
            return MotionVerdict("lag", f"the frames lag by {lag.words()} frames{after}")

    # Light is still there, but no one filter keeps it.
    if measures.ghost.value is not None and measures.ghost.exceeds(0.0, SURE) is Answer.YES:
        return MotionVerdict(
            "ghost",
            f"a ghost: {_percent(measures.ghost.value)} of the light that left a place is still "
            "there; the impulse "
            f"response is largest {_oldest(measures)} after it",
        )
    if filtered and described is not None and described < _ONE_LAG:
        return MotionVerdict(
            "not one lag",
            f"not one lag: it describes {_percent(described)} of what the frames keep of earlier "
            "ones; see the impulse "
            "response",
        )
    if filtered or not apart:
        reason = f"the delay is not told from the second best: {_delay_words(measures.lag)}"
        if apart:
            reason = "what the frames hold of earlier ones is rounding"
        return MotionVerdict("cannot be told", f"no lag can be told: {reason}; {noise}")

    # The rest is noise and a factor.
    gain, factor = measures.lag.gain, ""
    if (
        gain.value is not None
        and Estimate(gain.value - 1, gain.error).within(_FACTOR, SURE) is Answer.NO
    ):
        factor = f", and a factor of {gain.value:.5g}"
    return MotionVerdict("noise", f"no lag: {noise}{factor}")


def _undecided(measures: Measures) -> str:
    """Return why the numbers of a lag say nothing; empty where they do."""
    lag = measures.lag
    if lag.lag.value is None:
        return f"the reference changes by {_percent(measures.reference_change)} a frame"
    if lag.lag.error is None or lag.persistence.error is None:
        return f"all light is in one block of {BLOCK} x {BLOCK} pixels, so that nothing says how sure its numbers are"
    if lag.lag.error > _LARGEST_ERROR:
        return f"its error is {_frames(lag.lag.error)}, the reference changes by {_percent(measures.reference_change)}"
    return ""


def _delay_words(lag: Lag) -> str:
    """Return a delay, and by how much the second-best one is worse, in errors of that."""
    margin = lag.delay_margin
    if lag.delay is None:
        return "unknown"
    if margin.value is None or margin.error is None:
        return f"{lag.delay} (nothing says how sure)"
    if margin.error <= _ROUNDING * margin.value:
        return str(lag.delay)
    return f"{lag.delay} (the second best is worse by {margin.value / margin.error:.3g} errors)"


def _oldest(measures: Measures) -> str:
    response = [
        math.nan if each.value is None else each.value for each in measures.lag.response[1:]
    ]
    return (
        _frames(1 + int(np.nanargmax(response))) if np.isfinite(response).any() else "some frames"
    )


def _frames(count: float) -> str:
    return f"{count:.3g} frame{'' if count == 1 else 's'}"


def _percent(value: float) -> str:
    return f"{100 * value:.3g} %"


def _listed(each: Several[object]) -> str:
    shown = ", ".join(map(str, each[:5]))
    return shown if len(each) <= 5 else f"{shown} and {len(each) - 5} more"
