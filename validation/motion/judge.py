# SPDX-License-Identifier: BSD-3-Clause
"""Frames that another renderer made of a scene, compared with the reference of each frame, and the
verdict on them.

**Masks.** Every measure is taken over four sets of pixels: all pixels, pixels that were disoccluded
up to eight frames ago, the remaining pixels, and pixels within one pixel of a lamp. A surface point
was disoccluded where it lay outside the frame before, or was hidden there: the surface in its pixel
was nearer by more than 5 %. Shadows that move are no disocclusion.

**Verdict.** A lag is reported where its error is known and below a quarter of a frame, and where
the second-best delay is worse by more than four errors. Frames are late, or early, where the
filter is a delay alone: the persistence is zero within four errors, and the delay describes 95 %
of the improvement by an impulse response. Frames lag where the lag describes 90 % of it. A lag that
describes less is not one lag; the verdict is a ghost where the light that left a place is still
there by more than four errors. Without any of these the error is noise, a factor and an offset. A
number without an error decides nothing: the verdict then says why.
"""

import math
import os
from collections.abc import Mapping
from collections.abc import Sequence as Several
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from airlight.errors import InputError
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.scene.camera import film_positions
from airlight.reference.scene.read import ReferenceScene, read_reference
from airlight.reference.storage.exr import NOTE
from airlight.reference.storage.files import temporary_folder
from airlight.validation.arrays import Array, Bools, Index, Progress
from airlight.validation.engine.judge import lamp_distance
from airlight.validation.engine.observation import (
    PIXELS,
    JudgedLayer,
    expected_layer,
    model_notes,
    pixel_kinds,
    scene_of_size,
    whole_layer,
)
from airlight.validation.estimates.quadrature import known_to, known_words, off_by, relative_error
from airlight.validation.motion.blocks import BLOCK
from airlight.validation.motion.frames_file import FramesRecord, frame_paths, read_frames
from airlight.validation.motion.lag import SURE, Lag
from airlight.validation.motion.measures import AGES, STARTING, Measures, Sequence, measure
from airlight.validation.scenes.changes import UNCHANGED, Changes, move_shapes, shift_film
from airlight.validation.scenes.loading import load_scene
from airlight.validation.statistics.comparison import check_margin
from airlight.validation.statistics.estimate import Answer, Estimate, fact
from airlight.validation.statistics.samples import UNTOLD_SERIES

_ROUNDING = 1e-6  # relative error of exact frames in files of float32
_RECENT = 8  # frames since a point was disoccluded


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
        """The measures of all pixels."""
        return self.masks["all"]

    @property
    def lines(self) -> list[str]:
        """Return the numbers as text, a line for each group."""
        # All pixels come first; `validation.motion.measures` says what each number is.
        measures, lag = self.measures, self.measures.lag
        width, height = self.size
        lines = [
            f"scene            {self.scene}, {width} x {height}, {self.frames} frames; reference: "
            f"{self.expected}, pixel {self.pixel}, {known_words(self.known)}",
            f"values           {measures.values}, {measures.nonfinite} not finite; the reference "
            f"changes by {_percent(measures.reference_change)} a frame",
            f"relative RMSE    {measures.relative_rmse.percent()}, relative bias "
            f"{measures.bias.percent()}",
            f"flicker          {measures.flicker.percent()} a frame, "
            f"{measures.flicker_beside_lag.percent()} beside the lag",
            f"lag              {lag.lag.words()} frames: delay {_delay_words(lag)}, persistence "
            f"{lag.persistence.words()}, gain {lag.gain.words()}",
            f"ghost            {measures.ghost.percent()} of the light that left in {AGES} frames",
        ]
        if measures.pop_frame is not None:
            # It is a pop where the error changes by three times the median change or more, and
            # where it stays as it is in most frames.
            size = "most others have none: a pop"
            if measures.pop is not None:
                words = "a pop" if measures.pop >= 3.0 else "no pop"
                size = f"{measures.pop:.3g} times the median: {words}"
            lines.append(f"largest change   of the error in frame {measures.pop_frame}, {size}")
        # A mask without measures (no pixel, or dark) has no entry, and so no line.
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
    changes: Changes = UNCHANGED,
    progress: Progress | None = None,
) -> MotionComparison:
    """Compare the frames of a renderer with the references of a scene that changes.

    `pattern`: the EXR files, # for each digit of their numbers; `about`: `frames.json`, see
    `validation.motion.frames_file`; the rest as of `validation.engine.judge.compare_scene`. Raises
    InputError for what cannot be read, frames of two sizes, and changes that the scene does not
    have.
    """
    # The first file says which layer is judged and what a pixel of it is. All other files must
    # agree with it. A size that the scene cannot have is refused before anything is computed.
    check_margin(margin)
    record = read_frames(about)
    if not record.resets and record.frames <= STARTING:
        raise InputError(
            f"{about}: {record.frames} frames without resets: the first {STARTING} only start the "
            'filter, as an earlier history is in them; expected more frames, or "resets": [0]'
        )
    paths = frame_paths(pattern, record, str(about))
    first, judged = whole_layer(paths[0], name=layer or record.layer, holds=holds)
    kinds = pixel_kinds(first, pixel or record.pixel)
    loaded = scene_of_size(scene, judged.size, paths[0], changes)
    # Notes are what a reader of the numbers must know; they fail nothing. The scene goes: shadow
    # rays look at all shapes that are alive.
    named, notes = loaded.name, model_notes(loaded)
    del loaded
    with temporary_folder() as folder:
        # The measures read each frame and each reference several times. They lie in a folder, so
        # that memory holds one frame at a time. All frames are read before the first reference,
        # which takes the time: a frame of another size is refused at once.
        frames = _Frames(folder, scene, record, judged, kinds[0], changes)
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
        # A mask whose references are all dark has no measures, and is left out.
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
    if record.scene is not None and Path(record.scene).stem != Path(scene).stem:
        notes += (f"{about} is of the scene {record.scene}: its frames are judged by {scene}",)
    if len(kinds) > 1:
        notes += (
            'judged at pixel centres: the files do not say; expected "pixel": '
            f"{' or '.join(PIXELS)}",
        )
    if repeated := masks["all"].repeated:
        notes += (
            f"frames {_listed(repeated)} repeat the frame before them, though the reference "
            "changed",
        )
    if NOTE in first.attributes:
        notes += (f"{paths[0]}: {first.attributes[NOTE]}",)
    measures = masks["all"]
    lag = measures.lag.lag.value
    verdict = motion_verdict(measures, relative_error(frames.known))
    # Two things fail a comparison: values that are not finite, which no measure counts, and a
    # bias that is not shown to keep the margin. A bias whose error is unknown shows nothing.
    failures = []
    if any(frames.nonfinite):
        wrong = [f"{n} ({path.name})" for n, path in enumerate(paths) if frames.nonfinite[n]]
        failures.append(
            f"{sum(frames.nonfinite)} values are NaN or infinite, in frames {_listed(wrong)}"
        )
    # The reference's own error may add to a bias: a margin holds both. The bias of exact frames
    # needs no error of its own, since their RMSE is never smaller.
    rmse = measures.relative_rmse.value
    if margin is not None:
        left = margin - frames.off
        exact = verdict.kind == "exact" and rmse is not None and rmse <= left
        if not exact and measures.bias.within(left) is not Answer.YES:
            why = "" if measures.bias.error is not None else f": {UNTOLD_SERIES}"
            failures.append(f"the relative bias is not shown to be within +-{margin:.3g}{why}")
    return MotionComparison(
        scene=named,
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
        self,
        folder: Path,
        scene: str,
        record: FramesRecord,
        judged: JudgedLayer,
        pixel: str,
        changes: Changes,
    ) -> None:
        self._folder, self._scene, self._record, self._judged, self._pixel = (
            folder,
            scene,
            record,
            judged,
            pixel,
        )
        self._changes = changes  # of all frames; those of a frame go before
        self.known = fact(0.0)  # of the frame that is known worst
        self.off = 0.0  # by how much the mean of a frame's reference may be off, over that mean
        self.nonfinite: list[int] = []  # values of each frame that are NaN or infinite
        shape = (record.frames, *judged.values.shape[:2])
        self._uncovered, self._beside = np.zeros((2, *shape), dtype=bool)
        # of the last frame, since a point was disoccluded
        self._ages = np.full(shape[1:], math.inf)
        # Camera rays of the last frame, and the distance along each to its surface [m].
        self._last_scene: ReferenceScene | None = None
        self._last_distance = np.zeros(shape[1:])
        # For each frame the first frame of the same state, whose reference both share.
        self._same_as: list[int] = []

    def take(self, n: int, path: Path) -> None:
        """Keep a frame, which must have the size of the first."""
        values = whole_layer(path, name=self._judged.name, holds=self._judged.holds)[1].values
        if values.shape != self._judged.values.shape:
            sizes = [
                " x ".join(str(side) for side in each.shape[1::-1])
                for each in (values, self._judged.values)
            ]
            raise InputError(f"frame {n}: {path} has {sizes[0]} pixels, the first frame {sizes[1]}")
        self.nonfinite.append(int((~np.isfinite(values)).sum()))
        # Exposure is undone here: all that follows is in W/(m^2 sr), as the references are.
        np.save(
            self._folder / f"frame-{n}.npy", values.astype(np.float64) / 2 ** self._record.stops(n)
        )

    def expect(self, n: int) -> None:
        """Keep the reference and the masks of a frame; refuse changes that the scene does
        not have, by its number.
        """
        record = self._record
        if n and record.shown(n) == record.shown(n - 1):
            # Nothing changed: the frame shares the reference of the frame before, and every point
            # has been visible for one frame more.
            self._same_as.append(self._same_as[-1])
            self._ages = self._ages + 1
            self._beside[n] = self._beside[n - 1]
        else:
            # Each frame starts from the scene as it is in its file: `frames.json` says all that
            # differs from it, not what differs from the frame before.
            try:
                changes, moves, jitter = record.shown(n)
                loaded = load_scene(self._scene, self._judged.size, {**self._changes, **changes})
                move_shapes(loaded.scene, moves)
                shift_film(loaded.scene, *jitter)
                image = reference_image(loaded.scene, pixel=self._pixel, model=loaded.model)
            except InputError as error:
                raise InputError(f"frame {n}: {error}") from error
            self._same_as.append(n)
            # One error stands for the references of all frames: the largest relative one.
            known = known_to(image, self._judged.holds, emitted=self._judged.emitted)
            self.known = max(self.known, known, key=doubt)
            if known.value:
                off, _ = off_by(image, self._judged.holds, emitted=self._judged.emitted)
                self.off = max(self.off, off)
            np.save(self._folder / f"reference-{n}.npy", expected_layer(image, self._judged))
            self._beside[n] = lamp_distance(loaded, image) <= 1.0  # [pixels]
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
            lambda n: read(f"reference-{self._same_as[n]}.npy"),
            lambda n: selected[n, rows, columns],
            self._record.resets,
        )

    def _uncover(self, distance: Array, here: ReferenceScene) -> None:
        """Tell how many frames ago the point of each pixel was disoccluded; this frame
        differs from the one before.
        """
        before, self._last_scene = self._last_scene, here
        distance_before, self._last_distance = self._last_distance, distance
        # Only a camera or an object that moves uncovers points: a light that moves uncovers none.
        moving = self._record.objects or any(
            name.startswith("camera.") for name in self._record.changes
        )
        if before is None or not moving:
            return
        # The surface point of each pixel of this frame [m]. Where a ray meets no surface, the
        # point is so far away that its direction alone decides.
        far = 1e6 * (1.0 + float(np.abs(here.origin).max()))
        points = (
            here.origin
            + np.where(np.isfinite(distance), distance, far).reshape(-1, 1) * here.direction
        )
        # Each point is looked up in the frame before. It was hidden there if the surface in that
        # pixel was nearer by more than 5 %. A point that was visible is one frame older than the
        # pixel that showed it.
        row, column, inside = _pixel_of(before, points)
        reach = np.linalg.norm(points - before.origin, axis=1)
        hidden = distance_before[row, column] < 0.95 * reach
        self._ages = np.where(~inside | hidden, 0.0, self._ages[row, column] + 1).reshape(
            distance.shape
        )


def doubt(known: Estimate) -> float:
    """Return the relative error of a reference: infinite where it is not known, and -1, less than
    any other, where all is dark.
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
    """Return the relative RMSE of frames against the reference of an earlier frame, by how many
    frames earlier. All shifts are judged by the same frames: those that have each reference.
    """
    shifts = range(-2, 4)
    frames = range(max(shifts), sequence.frames + min(shifts))
    sums, light, count = dict.fromkeys(shifts, 0.0), 0.0, 0
    for n in frames:
        # Values that are not finite count nowhere.
        frame = sequence.frame(n)
        finite = np.isfinite(frame)
        light, count = light + float(sequence.reference(n)[finite].sum()), count + int(finite.sum())
        for shift in shifts:
            error = frame[finite] - sequence.reference(n - shift)[finite]
            sums[shift] += float(np.sum(error**2))
    if not light:
        return {}
    return {shift: math.sqrt(sums[shift] * count) / light for shift in shifts}


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

    # One filter explains the frames: a delay, or a delay and a history. The limits are fractions
    # of the improvement that an impulse response makes.
    one_lag, one_delay = 0.9, 0.95
    persists = persistence.within(_ROUNDING, SURE) is Answer.NO
    filtered = persists or bool(delay)
    apart = measures.lag.delay_margin.exceeds(0.0, SURE) is Answer.YES
    # Frames that are early have light that no response to earlier light explains.
    described = 1.0 if delay is not None and delay < 0 else measures.lag.described
    if filtered and apart and described is not None:
        if delay and not persists and described > one_delay:
            words = "late" if delay > 0 else "early"
            return MotionVerdict("late", f"the frames are {words} by {_frames(abs(delay))}")
        if described >= one_lag:
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
    if filtered and described is not None and described < one_lag:
        return MotionVerdict(
            "not one lag",
            f"not one lag: it describes {_percent(described)} of what the frames keep of earlier "
            "ones; see the impulse "
            "response",
        )
    # A filter is left that no sentence above names, or no delay stands out from the second best.
    if filtered or not apart:
        reason = f"the delay is not told from the second best: {_delay_words(measures.lag)}"
        if apart:
            reason = "what the frames hold of earlier ones is rounding"
        return MotionVerdict("cannot be told", f"no lag can be told: {reason}; {noise}")

    # The rest is noise and a factor. A gain nearer to 1 than 1e-5 is not worth a word.
    gain, factor = measures.lag.gain, ""
    if (
        gain.value is not None
        and Estimate(gain.value - 1, gain.error).within(1e-5, SURE) is Answer.NO
    ):
        factor = f", and a factor of {gain.value:.5g}"
    return MotionVerdict("noise", f"no lag: {noise}{factor}")


def _undecided(measures: Measures) -> str:
    """Return why the numbers of a lag say nothing; empty where they do."""
    lag = measures.lag
    if lag.lag.value is None:
        return f"the reference changes by {_percent(measures.reference_change)} a frame"
    if lag.lag.error is None or lag.persistence.error is None:
        return (
            f"all light is in one block of {BLOCK} x {BLOCK} pixels, so that nothing says how sure "
            "its numbers are"
        )
    # Half a frame is the distance to the next whole delay. An error of half of that is the largest
    # with which a lag is reported [frames].
    if lag.lag.error > 0.25:
        return (
            f"its error is {_frames(lag.lag.error)}, the reference changes by "
            f"{_percent(measures.reference_change)}"
        )
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
    words = ", ".join(map(str, each[:5]))
    return words if len(each) <= 5 else f"{words} and {len(each) - 5} more"
