# SPDX-License-Identifier: BSD-3-Clause
"""Errors that vary: of independent runs of one frame, and of the frames under a light that moves.

*Runs.* All are compared with one reference: their error is bias and noise apart. A bias is told
where it is beyond the error of the reference, which under area lights is statistical. Methods that
draw no random numbers are rendered once, and stand beside the others: all of their error is bias.

*Frames.* Each is compared with the reference of its lights. In a sweep the lights circle as in the
animation of the scene; in a step they stand for `BEFORE` frames, then jump. A method that uses its
last frames has them, as in `airlight render --frames`. Methods that draw random numbers are
rendered in several runs: their numbers are means over these, with errors from the spread of the
runs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, cycle, islice

import mitsuba as mi
import numpy as np

from airlight.errors import InputError
from airlight.realtime.frame.image import render_frame
from airlight.realtime.frame.renderer import FrameRenderer
from airlight.realtime.scene.read_scene import Scene, read_scene
from airlight.reference.quadrature.reference import reference_image
from airlight.validation.arrays import Array, Counted
from airlight.validation.clock import Piece, in_turns
from airlight.validation.estimates.quadrature import (
    known_to,
    off_by,
    reference_error,
    relative_error,
)
from airlight.validation.motion.judge import doubt, motion_verdict
from airlight.validation.motion.measures import Measures, mean_measures, measure
from airlight.validation.motion.measures import Sequence as Frames
from airlight.validation.motion.noise import Noise, measure_noise
from airlight.validation.scenes.animation import animate, frame_changes
from airlight.validation.scenes.changes import change_scene
from airlight.validation.scenes.registry import Animation
from airlight.validation.statistics.estimate import INTERVAL, Estimate, fact
from airlight.validation.study.configuration import Configuration, prepared
from airlight.validation.study.frame_times import Turn, brief_turn, timed_image

BEFORE = 8  #: frames at rest before a step


@dataclass(frozen=True)
class MethodNoise:
    """The noise of independent renders by a method."""

    label: str
    noise: Noise
    reference: Array = field(repr=False)  #: (height, width, 3) [W/(m^2 sr)]
    #: of the runs; the reference where it is within two standard errors and the reference's own
    #: error, (height, width, 3) [W/(m^2 sr)]
    mean: Array = field(repr=False)
    deviation: Array = field(repr=False)  #: of a run, (height, width, 3) [W/(m^2 sr)]


def method_noise(
    scene: mi.Scene,
    configurations: Sequence[Configuration],
    *,
    runs: int = 16,
    progress: Counted | None = None,
) -> list[MethodNoise]:
    """Return the noise of each configuration's airlight.

    `scene`: at its own size; `runs`: of a method that draws random numbers, at
    least two. The time of a frame is a median while nothing moves, of one run of all methods in
    turns. Raises InputError for fewer runs and a dark reference.
    """
    if runs < 2:
        raise InputError(f"runs: got {runs}, expected at least two")
    read, image = read_scene(scene), reference_image(scene)
    reference, off = image.airlight, off_by(image, "airlight")
    # By how much a pixel of the reference may be off: standard errors count twice, as in `off_by`.
    drawn = reference_error(image, "airlight")
    own = image.airlight_error + (0.0 if drawn is None else INTERVAL * drawn)
    # All runs of all methods first. A method that draws no random numbers has one run, and so has
    # one whose runs turn out to be the same.
    rendered, turns = [], list[Turn]()
    for number, chosen in enumerate(configurations):
        renderer = prepared(read, chosen)
        count = runs if renderer.method.noisy else 1
        images = []
        for run in range(count):
            if progress is not None:
                progress(number * runs + run, len(configurations) * runs, chosen.label)
            images.append(
                np.asarray(render_frame(replace(renderer, run=run)).airlight, dtype=np.float64)
            )
        turns.append(brief_turn(renderer))
        if all(np.array_equal(each, images[0]) for each in images[1:]):
            images = images[:1]
        mean, deviation = (
            np.mean(images, axis=0),
            np.std(images, axis=0, ddof=min(1, len(images) - 1)),
        )
        # A mean within two standard errors of the reference, and the error of that, is shown as the
        # reference: a picture of the difference shows bias alone.
        biased = np.abs(mean - reference) > 2.0 / math.sqrt(count) * deviation + own
        rendered.append((images, np.where(biased, mean, reference), deviation))
    # All methods take turns, 0.2 s each: their times are compared.
    spent = in_turns([Piece(turn, 0.2) for turn in turns])
    seconds = [
        float(np.median([turn[0].frame.seconds for turn in chain(*rounds)])) for rounds in spent
    ]
    return [
        MethodNoise(
            chosen.label, measure_noise(reference, images, took, off), reference, shown, deviation
        )
        for chosen, (images, shown, deviation), took in zip(
            configurations, rendered, seconds, strict=True
        )
    ]


@dataclass(frozen=True)
class MethodMotion:
    """The quality of a method's frames under a light that moves."""

    label: str
    measures: Measures | None  #: None where the reference is dark
    verdict: str


def method_motion(
    scene: mi.Scene,
    animation: Animation,
    configurations: Sequence[Configuration],
    *,
    stimulus: str = "sweep",
    frames: int = 24,
    turn: int = 120,
    runs: int = 4,
    progress: Counted | None = None,
) -> list[MethodMotion]:
    """Return the quality of each configuration.

    `scene`: at its own size; `animation`: that of the scene, of which the lights
    move; `turn`: frames of a whole turn of a sweep; `runs`: of a method that draws random numbers.
    Raises InputError for a scene whose lights do not move, and too few frames or runs.
    """
    if runs < 2:
        raise InputError(f"runs: got {runs}, expected at least two")
    if stimulus not in ("sweep", "step"):
        raise InputError(f"stimulus: got {stimulus!r}, expected sweep or step")
    least = BEFORE + 2 if stimulus == "step" else 3
    if frames < least:
        raise InputError(f"frames: got {frames}, expected at least {least} for a {stimulus}")
    # Lights alone move: their references need no other geometry and no other camera.
    read = read_scene(scene)
    moves = Animation(moves=("light",), about=animation.about)
    places = (
        list(islice(cycle(animate(read, moves, turn)), frames))
        if stimulus == "sweep"
        else _step(read, moves, frames)
    )
    total = frames * (1 + len(configurations))
    report = None if progress is None else lambda number, what: progress(number, total, what)
    references, known = light_references(scene, places, moves, report)
    everywhere = np.ones(references[0].shape[:2], dtype=bool)
    rows = []
    for number, chosen in enumerate(configurations):
        if progress is not None:
            progress(frames * (1 + number), total, chosen.label)
        # Each run is a whole sequence of frames, with its own history and random numbers.
        renderer = prepared(read, chosen)
        several = []
        for run in range(runs if renderer.method.noisy else 1):
            images = method_frames(replace(renderer, run=run), places)
            several.append(
                measure(
                    Frames(frames, images.__getitem__, references.__getitem__, lambda n: everywhere)
                )
            )
        measured = [each for each in several if each is not None]
        mean = mean_measures(measured) if measured else None
        # The verdict is that on the numbers beside it.
        own = relative_error(known)
        words = motion_verdict(mean, own).words if mean else "the reference is dark"
        rows.append(MethodMotion(chosen.label, mean, words))
    return rows


def light_references(
    scene: mi.Scene,
    places: Sequence[Scene],
    moves: Animation,
    progress: Callable[[int, str], None] | None = None,
) -> tuple[list[Array], Estimate]:
    """Return the airlight of the reference of each frame, (height, width, 3) [W/(m^2 sr)], and the
    mean of that which is known worst; in the end the scene is as it was.

    `places`: the scene of each frame, of which `moves` says what moves,
    the first as it is now; `progress`: called with the number of a frame and what. Raises
    InputError for area lights, and where nothing moves.
    """
    if places[0].area_lights:
        raise InputError(
            "the scene has area lights, which its references cannot follow; expected a scene "
            "without"
        )
    changes = [frame_changes(each, moves) or {} for each in places]
    if not changes[0]:
        raise InputError(
            "the scene has no light that could circle; expected a point, spot or directional light"
        )
    # One scene is changed in place from frame to frame. The last change brings it back to the
    # first frame, as the caller gave it.
    references, known = list[Array](), fact(0.0)
    for number, change in enumerate([*changes, changes[0]]):
        change_scene(scene, change)
        if number < len(places):
            if progress is not None:
                progress(number, "references")
            image = reference_image(scene)
            references.append(image.airlight)
            known = max(known, known_to(image, "airlight"), key=doubt)
    return references, known


def method_frames(renderer: FrameRenderer, places: Sequence[Scene]) -> list[Array]:
    """Return the airlight of a method in each frame, which has the cache of the frame before,
    (height, width, 3) [W/(m^2 sr)].
    """
    caches, images = None, []
    for place, last in zip(places, (None, *places), strict=False):
        moved = {"camera_moved": False, "geometry_moved": False, "light_moved": place is not last}
        frame, caches, _ = timed_image(renderer, place, caches, **moved)
        images.append(np.asarray(frame.airlight, dtype=np.float64))
    return images


def _step(read: Scene, moves: Animation, frames: int) -> list[Scene]:
    # The jump is a twelfth of a turn.
    before, after = islice(animate(read, moves, 12), 2)
    return [before] * BEFORE + [after] * (frames - BEFORE)
