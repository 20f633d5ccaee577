# SPDX-License-Identifier: BSD-3-Clause
"""Costs and errors of methods: a table of studies, the page, the documentation and papers."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import fields

from airlight.realtime.methods.shader.source import is_shader
from airlight.reports.data.records import Scene
from airlight.reports.tables.table import (
    Column,
    Name,
    Row,
    Table,
    Value,
    digits_of,
    fields_of,
    measured,
    number,
    numbers,
    table,
    words,
)
from airlight.validation.metrics.errors import Metrics
from airlight.validation.study.row import Row as CellRow
from airlight.validation.timing import FrameTimes, Timing, TimingRun

#: Times of a frame, by their names in report.json.
TIMES = tuple(each.name for each in fields(FrameTimes) if each.name != "run")
ERRORS = ("relative_rmse", "relative_bias", "p50", "p99", "max", "nonfinite")

COLUMNS = {
    column.key: column
    for column in (
        *words(label="method"),
        *fields_of(FrameTimes, "frame", spread="quartiles"),
        *fields_of(CellRow, "device"),
        *numbers(frame_rate="frames/s", how={"whole": True}),
        *numbers(airlight_rate="airlight/s", how={"whole": True, "minor": True}),
        *fields_of(FrameTimes, *TIMES[1:], minor=True),
        *fields_of(CellRow, "memory", whole=True, minor=True),
        *fields_of(Metrics, *ERRORS[:-1], digits=2, fraction=True),
        *fields_of(CellRow, "flip"),
        *fields_of(Metrics, "nonfinite", alarm=True),
    )
}
TARGETS = (0.01, 0.001)  #: relative RMSE for which the fastest method is named
#: Columns of what `airlight study methods` prints.
BENCH = (
    *("label", "frame", "frame_rate", "airlight", "airlight_rate", "light_moved", "memory"),
    *("relative_rmse", "relative_bias", "p99", "max"),
)


def methods_table(
    title: str, methods: Iterable[CellRow | Row], *keys: str, explanation: str = ""
) -> Table:
    """Return the table of the `methods` of a scene of report.json, or of rows
    that have some of `COLUMNS`.

    `keys` are those of `COLUMNS`; `BENCH` by default. Where a shader was timed, its
    device stands beside its time.
    """
    rows = tuple(entry if isinstance(entry, Row) else method_row(entry) for entry in methods)
    # Times on another device than the rest must say so.
    shown = list(keys or BENCH)
    if any(row.values.get("device") for row in rows):
        shown.insert(shown.index("frame") + 1, "device")
    return Table(title, tuple(COLUMNS.values()), rows, explanation).only(*shown)


def method_row(entry: CellRow, *, shadows: bool = False) -> Row:
    """Return the costs and errors of a method as a row; `shadows` marks
    a method that knows none.
    """
    # Remarks say all that makes a row not comparable with the others.
    users = "user's shader" if is_shader(entry.method) else "user's function"
    remarks = (
        [f"image, {entry.layer}"]
        if entry.kind == "image"
        else [users]
        if entry.kind == "function"
        else []
    )
    if shadows and entry.kind != "image" and not entry.knows_shadows:
        remarks.append("no shadows")
    remarks += [entry.note] if entry.note else []
    remarks += ["timed elsewhere"] if entry.times and entry.times.run is None else []
    values: dict[str, Value] = {"label": entry.label}
    # A row that was refused or left out has no numbers.
    if entry.reason:
        return Row(values, f"{entry.status}: {entry.reason}", tuple(remarks))
    values |= {name: measured(getattr(entry.times, name, None)) for name in TIMES}
    values |= {
        f"{name}_rate": per_second(getattr(entry.times, name, None))
        for name in ("frame", "airlight")
    }
    values |= {name: getattr(entry.error, name, None) for name in ERRORS}
    values |= {
        "device": entry.device,
        "memory": entry.memory,
        "flip": entry.flip.value if entry.flip else None,
    }
    return Row(values, remarks=tuple(remarks))


def runs_of(entries: Iterable[CellRow]) -> list[TimingRun]:
    """Return the runs in which the times of rows were measured, each once; those of
    other programs have none.
    """
    return list(
        dict.fromkeys(entry.times.run for entry in entries if entry.times and entry.times.run)
    )


def run_words(run: TimingRun) -> str:
    """Say when times were measured, and whether the machine changed meanwhile."""
    words = f"measured in turns in one run of {run.rounds} rounds, {run.started}"
    # The run could not judge the machine.
    if run.steady is None or run.between is None or run.within is None:
        return words
    verdict = (
        "stayed as it was" if run.steady else "CHANGED meanwhile: compare ratios, not milliseconds"
    )
    return (
        f"{words}; the machine {verdict} (the anchor, camera rays alone: medians within a factor "
        f"of {run.between:.2f} "
        f"over the run, quartiles of {run.within:.2f} in a round)"
    )


def times_words(entries: Iterable[CellRow]) -> str:
    """Say of what runs the times of a table are; empty where there are none."""
    # One run for the table is the usual case; several are told apart by their methods.
    entries = list(entries)
    runs = runs_of(entries)
    if len(runs) == 1:
        sentences = [f"Times: {run_words(runs[0])}."]
    else:
        sentences = [
            f"Times of {', '.join(e.label for e in entries if e.times and e.times.run == run)}: "
            f"{run_words(run)}."
            for run in runs
        ]
    if any(entry.times and entry.times.run is None for entry in entries):
        sentences.append(
            "What is marked `timed elsewhere` is of another run, on another machine or by other "
            "rules."
        )
    return " ".join(sentences)


def per_second(time: Timing | None) -> float | None:
    """Return how often a second something can be done."""
    return 1000 / time.median_ms if time and time.median_ms > 0 else None


def rate_words(milliseconds: float) -> str:
    """Return how many frames a second there are of so many milliseconds."""
    return f"{digits_of(1000 / milliseconds, COLUMNS['frame_rate'])} frames/s"


def raced(entries: Iterable[CellRow]) -> list[CellRow]:
    """Return the rows whose times can be compared, the fastest first.

    Shaders run on another device, and engines in a run of their own: both are in no race with
    others. Pixels that are not finite are left out of the RMSE: a method that has any must not win
    by it.
    """
    return sorted(
        (
            entry
            for entry in entries
            if not entry.device
            and (entry.times is not None and entry.times.run is not None)
            and (entry.error is not None and entry.error.relative_rmse is not None)
            and not entry.error.nonfinite
        ),
        key=_milliseconds,
    )


def within(error: float, entries: Iterable[CellRow]) -> list[CellRow]:
    """Return the rows of a race with at most a relative RMSE, the fastest first."""
    return [entry for entry in raced(entries) if _rmse(entry) <= error]


def alike(fastest: Sequence[CellRow]) -> list[CellRow]:
    """Return the first of a race and those whose quartiles reach into its own."""
    return [
        entry
        for entry in fastest
        if _frame(entry).low_ms <= _frame(fastest[0]).high_ms or entry is fastest[0]
    ]


def _frame(entry: CellRow) -> Timing:
    assert entry.times is not None
    return entry.times.frame


def _milliseconds(entry: CellRow) -> float:
    return _frame(entry).median_ms


def _rmse(entry: CellRow) -> float:
    assert entry.error is not None
    assert entry.error.relative_rmse is not None
    return entry.error.relative_rmse


def headline(scene: Scene) -> str:
    """Return the result of a scene in a sentence, empty where nothing was measured in one run:
    which methods have the smallest error that any reaches, and the fastest of them.
    """
    entries = raced(scene.methods)
    if not entries:
        return ""
    count = len({entry.method for entry in entries})
    # The strictest error that a method reaches decides.
    for target in sorted(TARGETS):
        near = within(target, entries)
        if not near:
            continue
        names, error = {entry.method for entry in near}, f"{100 * target:g} %"
        if len(names) == 1:
            only = f" the only method of {count}" if count > 1 else ""
            said = f"In {scene.name}, {near[0].method} is{only} within {error}"
            return f"{said}: {_frame_words(near)}."
        return (
            f"In {scene.name}, {len(names)} of {count} methods are within {error}; the fastest: "
            f"{_name_and_time(near)}."
        )
    nearest = min(entries, key=_rmse)
    return (
        f"In {scene.name}, no method of {count} is within {100 * max(TARGETS):g} %; the nearest is "
        f"{nearest.label}: {100 * _rmse(nearest):.2g} %, {_frame_words([nearest])}."
    )


def _frame_words(entries: Sequence[CellRow]) -> str:
    return f"{number(_milliseconds(entries[0]))} ms a frame"


def fastest_table(scenes: Iterable[Scene], *, code: bool = False) -> Table:
    """Return for every scene of a report the fastest method within each
    relative RMSE of `TARGETS`.
    """
    # A column for each error of `TARGETS`.
    columns = [
        Column(f"within_{target:g}", f"within {100 * target:g} %", words=True) for target in TARGETS
    ]
    rows = (
        (
            Name(scene.name) if code else scene.name,
            *(_name_and_time(within(target, scene.methods)) for target in TARGETS),
        )
        for scene in scenes
    )
    explanation = (
        "Relative RMSE of the airlight; median time of a frame with static geometry. The times of "
        "a scene are of one run; methods whose quartiles overlap share the place."
    )
    return table(
        "The fastest method within an error",
        (*words("scene"), *columns),
        rows,
        explanation=explanation,
    )


def _name_and_time(fastest: Sequence[CellRow]) -> str:
    """Return the fastest of a race in words; methods whose quartiles overlap share the place."""
    if not fastest:
        return "none"
    # One configuration of a method is enough for the place.
    shared = dict[str, str]()
    for entry in alike(fastest):
        shared.setdefault(entry.method, entry.label)
    *others, last = shared.values()
    names = f"{', '.join(others)} and {last}" if others else last
    milliseconds = _milliseconds(fastest[0])
    return f"{names}: {number(milliseconds)} ms, {rate_words(milliseconds)}"


#: By kernel, the paper and what it leaves wrong.
_KERNELS = {
    "taylor": "Biri 2006: its polynomial, wrong away from the foot point",
    "taylor-printed": "Biri 2006: its polynomial with the printed coefficients",
}
#: By method, where no parameter says more.
_METHODS = {
    "shadow-planes-2006": "Biri 2006: its stencil rule, wrong where shadows overlap",
    "light-volumes-2010": "Billeter 2010: its mesh of a shadow map",
}
#: By parameter and value.
_VALUES = {
    ("order", "paper"): "Biri 2006: its stencil rule, wrong where shadows overlap",
    ("order", "none"): "Biri 2006 without its stencil: overlapping shadows count twice",
    ("media", "paper"): "Biri 2006: its constant R in bounded media",
    ("media", "printed"): "Biri 2006: its formula of bounded media as printed",
}


def published_as(entry: CellRow) -> str:
    """Return which paper a method of report.json reproduces with its errors, and
    what is wrong; else nothing.
    """
    return published(entry.method, entry.kernel, entry.parameters)


def published(method: str, kernel: str | None, parameters: str) -> str:
    """Return the same of a method with its kernel and its parameters as JSON."""
    values = (_VALUES.get((name, str(value)), "") for name, value in json.loads(parameters).items())
    return (
        next(filter(None, values), "") or _METHODS.get(method, "") or _KERNELS.get(kernel or "", "")
    )
