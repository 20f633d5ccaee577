# SPDX-License-Identifier: BSD-3-Clause
"""Times of cells that are compared: all of one scene, measured in one run, in turns.

Before the run every method compiles, records and renders a frame for its memory. Then they take
turns, in rounds (`validation.clock.in_turns`), with the anchor of the run at both ends of each
round (`validation.timing.anchored`). A method keeps its recorded functions between its turns, and
prepares its shadow maps, planes or volumes again in each: those of all methods at once are never in
memory. A slow method takes part in fewer rounds, evenly among all.

A user's method may be in a separate process. It takes its turns as the others do: its
process waits meanwhile.
"""

from collections.abc import Callable, Generator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import Any

import numpy as np

from airlight.analytic.clock import Spent
from airlight.errors import InputError
from airlight.realtime.frame.image import render_frame
from airlight.realtime.frame.renderer import FrameRenderer, parts
from airlight.realtime.methods.shader.source import is_shader
from airlight.realtime.scene.read_scene import Scene, read_scene
from airlight.reference.storage.store import date
from airlight.validation.clock import ROUNDS, Piece, in_turns, peak_memory, timed, timing_of
from airlight.validation.study.configuration import prepared
from airlight.validation.study.frame_times import (
    FrameSpent,
    Turn,
    brief_turn,
    camera_rays,
    object_moves,
    shader_turn,
    staged_turn,
    times_of,
    whole_turn,
)
from airlight.validation.study.reference import load_cell
from airlight.validation.study.study import Cell, Measure
from airlight.validation.timing import ANCHORS, FrameTimes, TimingRun, anchored

#: Calls a function with arguments in another process: ``apart(function, *arguments, name=the
#: method's)``. Its result is that of the function, whatever this is; values that a function yields
#: are yielded here, as they are asked for.
Apart = Callable[..., Any]


#: A frame that takes longer is timed stage by stage, in few frames [s]. Its spread matters little,
#: and the usual thirty or more frames would take minutes.
SLOW = 8.0
_PATIENCE = 1.5  # approximate time for the turns of a slow method; one is the least [s]
_BRIEF = 0.2  # on the turns of a method that is timed briefly [s]
# A method with shorter frames has a first turn that does not count: the time of recording would be
# a part of its times [s].
_RECORDED = 1.0


@dataclass(frozen=True)
class CellTimes:
    """The times of a cell, and the memory that its frame takes."""

    times: FrameTimes | None = None
    #: for the state of the method, where it is prepared by itself
    prepare_ms: float | None = None
    memory: float | None = None  #: as of a row [MiB]
    device: str | None = None  #: that draws a shader
    note: str | None = None  #: how they differ from those of others
    lost: str | None = None  #: why a cell that should be timed has no times


@dataclass(frozen=True)
class Ready:
    """The facts of a method before its first turn."""

    took: float  #: by a frame with its preparation [s]
    memory: float | None = None  #: [MiB]
    device: str | None = None


#: The turns of a method as a generator: `Ready` first, then the frames of each turn.
Turns = Generator[Ready | list[FrameSpent], None, None]


def time_cells(
    cells: Sequence[Cell | None],
    scene_of: Callable[[Cell], Scene],
    *,
    apart: Apart | None = None,
    anchor: Callable[[], object] | None = None,
) -> list[CellTimes]:
    """Time frames of cells of one scene, in one run.

    `cells`: at the size of the frames that are timed; None for what is not timed; `scene_of`:
    returns the scene of a cell at that size; `apart`: calls a user's method in a separate process;
    `anchor`: camera rays of the first cell by default.
    """
    # A method that fails has its reason in its place, and the others are timed.
    times = [CellTimes() for _ in cells]
    with ExitStack() as stack:
        pieces: dict[int, Piece[list[FrameSpent]]] = {}
        for place, cell in enumerate(cells):
            if cell is None:
                continue
            # Every method compiles and records before the first is timed. The generator of its
            # turns goes on living: it holds the recorded functions, or the separate process.
            try:
                turns: Turns
                if apart is not None and cell.chosen.own:
                    turns = apart(turns_of_cell, cell, name=cell.chosen.method)
                else:
                    turns = turns_of(prepared(scene_of(cell), cell.chosen), cell.measure)
                ready = _ready(stack.enter_context(closing(turns)))
            except InputError as error:
                times[place] = CellTimes(lost=str(error))
                continue
            times[place] = CellTimes(memory=ready.memory, device=ready.device)
            pieces[place] = _piece(turns, ready, cell.measure, partial(_lose, times, place))
        # The anchor and the work of moving all objects are the same for all methods. Moves are
        # timed only where frames after objects moved are asked for.
        if pieces:
            first = next(cell for cell in cells if cell is not None)
            scene = scene_of(first)
            moves = object_moves(scene) if first.measure.times == "stages" else None
            _run(times, pieces, camera_rays(scene) if anchor is None else anchor, moves)
    return times


def time_frame(
    renderer: FrameRenderer, *, seconds: float = 0.6, slow: float | None = None
) -> FrameTimes:
    """Return the times of the frames of one renderer, in a run of its own.

    Parameters
    ----------
    renderer
        The stages of the frame, from `frame_renderer`.
    seconds
        How long each stage is timed [s].
    slow
        A frame that takes longer with its preparation is timed in few frames [s].
    """
    times = time_alone(renderer, seconds=seconds, slow=slow).times
    assert times is not None
    return times


def time_alone(
    renderer: FrameRenderer, *, seconds: float = 0.6, slow: float | None = None
) -> CellTimes:
    """Time the frames of one renderer, in a run of its own.

    `seconds`: as of `Measure`; `slow`: a frame that takes longer with its preparation is timed
    stage by stage, in few frames [s], `SLOW` by default.
    """
    measure = Measure("stages", seconds, slow=slow)
    with closing(turns_of(renderer, measure)) as turns:
        ready = _ready(turns)
        times = [CellTimes(memory=ready.memory, device=ready.device)]
        piece = _piece(turns, ready, measure, _raise)
        _run(times, {0: piece}, camera_rays(renderer.scene), object_moves(renderer.scene))
    return times[0]


def brief_times(renderer: FrameRenderer) -> CellTimes:
    """Time a frame and its airlight for some tenths of a second, whatever else runs; the
    frame was rendered before.
    """
    started, device, seconds = date(), None, _BRIEF
    if is_shader(renderer.method.name):
        device, turn = shader_turn(renderer, _BRIEF)
        seconds = 0.0  # its turn takes them
    else:
        turn = brief_turn(renderer)
    ((repetitions,),) = in_turns([Piece(turn, seconds)], rounds=1, most=9)
    return _cell_times(
        CellTimes(device=device), list(chain(*repetitions)), [], TimingRun(started, 1)
    )


def turns_of_cell(cell: Cell) -> Turns:
    """Yield what `turns_of` yields, in a process that has loaded nothing."""
    yield from turns_of(prepared(read_scene(load_cell(cell).scene), cell.chosen), cell.measure)


def turns_of(renderer: FrameRenderer, measure: Measure) -> Turns:
    """Yield a `Ready`, then the times of the frames of a turn, as often as they are asked for."""
    if not is_shader(renderer.method.name):
        yield from _turns(renderer, measure)
        return
    device, turn = shader_turn(renderer, _seconds(measure) / ROUNDS)
    yield Ready(0.0, device=device)
    while True:
        yield turn()


def _turns(renderer: FrameRenderer, measure: Measure) -> Turns:
    """Yield what `turns_of` yields for a method of Dr.Jit."""
    turn: Turn
    if measure.times != "stages":
        turn = brief_turn(renderer)
        turn()  # compiles and records
        yield Ready(timed(turn)[1].seconds)
        while True:
            yield turn()
    took: list[float] = []

    def frame() -> None:
        took.append(timed(lambda: render_frame(renderer))[1].seconds)

    # The first frame compiles. The second one says what a frame takes, and its memory; of a
    # slow one the first does.
    slow = SLOW if measure.slow is None else measure.slow
    memory = peak_memory(frame)
    if took[-1] < slow:
        memory = peak_memory(frame)
    # A slow frame, and one that does not fit into memory at once, is timed stage by stage.
    recorded = took[-1] < _RECORDED
    in_stages = took[-1] > slow or len(parts(renderer)) > 1
    turn = staged_turn(renderer) if in_stages else whole_turn(renderer)
    if recorded:  # the turn records functions of its own, in a first turn that does not count
        turn()
    yield Ready(took[-1], memory)
    while True:
        yield turn()


def _ready(turns: Turns) -> Ready:
    """Let a method compile and record, and return its facts."""
    ready = next(turns)
    assert isinstance(ready, Ready)
    return ready


def _piece(
    turns: Turns, ready: Ready, measure: Measure, lose: Callable[[Exception], None]
) -> Piece[list[FrameSpent]]:
    """Return the turns of a method as a piece of work; a method that fails in a turn
    is lost and has no more.
    """

    def turn() -> list[FrameSpent]:
        try:
            spent = next(turns, list[FrameSpent]())
        except InputError as error:
            lose(error)
            return []
        assert isinstance(spent, list)
        return spent

    # A shader draws for its time by itself, and is asked once a round.
    rounds = int(np.clip(_PATIENCE / max(ready.took, 1e-9), 1, ROUNDS))
    return Piece(turn, 0.0 if ready.device else _seconds(measure), rounds)


def _seconds(measure: Measure) -> float:
    """Return the time for all turns of a method [s]."""
    # `Measure.seconds` is for one time. A turn has five: frame, surface and airlight, and half as
    # long for each of four.
    return 5.0 * measure.seconds if measure.times == "stages" else _BRIEF


def _lose(times: list[CellTimes], place: int, error: Exception) -> None:
    times[place] = replace(times[place], lost=str(error))


def _raise(error: Exception) -> None:
    raise error


def _run(
    times: list[CellTimes],
    pieces: dict[int, Piece[list[FrameSpent]]],
    anchor: Callable[[], object],
    moves: Callable[[], object] | None,
) -> None:
    """Let pieces of work take turns, and put the times of their frames in their places."""

    def anchors() -> list[Spent]:
        return [timed(anchor)[1] for _ in range(ANCHORS)]

    def move() -> list[Spent]:
        return [timed(moves)[1]] if moves is not None else []

    # Both are the same for all methods, and are warmed up as these are.
    anchors(), move()
    started, end = date(), Piece(anchors, 0.0)
    turned: list[Piece[Any]] = [end, Piece(move, 0.0), *pieces.values(), end]
    # The anchor is first and last in each round: a machine that changes within it shows.
    first, moved, *of_pieces, last = in_turns(turned)
    ends = [
        repetition for of_end in (first, last) for of_round in of_end for repetition in of_round
    ]
    run = anchored(
        started, ROUNDS, [timing_of(each) for each in ends], timing_of(list(chain(*ends)))
    )
    # Results are by round and repetition; a turn of a method is a list of frames.
    spent_moving = [spent for of_round in moved for repetition in of_round for spent in repetition]
    for place, rounds in zip(pieces, of_pieces, strict=True):
        spent = [each for of_round in rounds for repetition in of_round for each in repetition]
        if times[place].lost is None:  # a method that failed in a turn has its reason there
            times[place] = _cell_times(times[place], spent, spent_moving, run)


def _cell_times(
    ready: CellTimes, spent: list[FrameSpent], moves: list[Spent], run: TimingRun
) -> CellTimes:
    """Return the facts of a method before its first turn, with the times of its frames."""
    prepares = [each.prepare for each in spent if each.prepare is not None]
    prepare_ms = timing_of(prepares).median_ms if prepares else None
    return replace(ready, times=times_of(spent, moves, run), prepare_ms=prepare_ms)
