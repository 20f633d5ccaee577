# SPDX-License-Identifier: BSD-3-Clause
"""The Parquet of a sweep by columns, and the errors of each configuration over
scenes: one sample a scene.

Neither Mitsuba nor a scene is needed.

Cells of one scene are not independent of one another, so they do not count twice: the medium with
the largest error stands for its scene. A configuration is a method with its kernel, its parameters
and the size of its image. Scenes that were drawn at random are a sample of what their ranges hold,
and claims are about these alone; scenes that somebody chose are a sample of nothing, and stand in
for it only where there are no others.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.validation.columns import plain
from airlight.validation.statistics.samples import quantile_interval
from airlight.validation.study.row import COLUMNS, FRAME_MS, NO_REFERENCE, PROPERTY, STATUSES

FILE = "sweep.parquet"  #: in the folder of a sweep

Numbers = NDArray[np.float64]

#: what makes a cell one: the label has method and parameters
_CELL = ("scene", "medium", "label", "width", "height")
_ORDER = ("scene", "method", "label", "medium")


@dataclass(frozen=True)
class Sweep:
    """Rows by columns, one of each cell, sorted: the order in which they
    were finished is chance.
    """

    path: Path
    #: Texts as objects, None for null; numbers with NaN, truth values as 0 and 1.
    columns: Mapping[str, NDArray[Any]] = field(repr=False)
    #: names of the scenes' properties, without what begins their columns
    properties: tuple[str, ...]
    #: rows of cells that were computed again: by newer source code, or to be timed
    superseded: int = 0

    def __len__(self) -> int:
        return len(self.columns["key"])

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.columns[name]

    def property(self, name: str) -> Numbers:
        """Return a property of the scene of every row, NaN where it is not known."""
        return self[PROPERTY + name]

    def pictures(self, keys: Sequence[str]) -> dict[str, bytes]:
        """Return the pictures that the Parquet has of these rows, by key."""
        import pyarrow.compute as pc
        import pyarrow.parquet as pq

        if not keys:
            return {}
        with _reading(self.path):
            # Only these rows are read: pictures are most of the file.
            wanted = pc.field("key").isin(list(keys)) & pc.field("picture").is_valid()
            columns = ["key", "picture"]
            found = pq.read_table(
                self.path, columns=columns, filters=wanted, page_checksum_verification=True
            )
            return dict(zip(found["key"].to_pylist(), found["picture"].to_pylist()))


def read_sweep(path: Path | str) -> Sweep:
    """Read the rows of a sweep, from its Parquet or the folder that holds it.

    A file that is missing, cannot be read, has no rows or is not of this version is refused.
    """
    import pyarrow.parquet as pq

    file = _file_of(Path(path))
    with _reading(file):
        names = pq.read_schema(file).names
        # Another version of airlight has other columns: which one is missing says more than a
        # failure later.
        missing = [column.key for column in COLUMNS if column.key not in names]
        if missing:
            raise InputError(
                f"{file} has no column {missing[0]!r}, expected the columns of a sweep of this "
                "version of airlight; "
                "run the sweep again: what its rows hold is kept"
            )
        # Everything but the pictures, which stay on disk.
        wanted = [name for name in names if name != "picture"]
        table = pq.read_table(file, columns=wanted, page_checksum_verification=True)
        columns = {name: _array(table[name]) for name in table.column_names}
    if not table.num_rows:
        raise InputError(
            f"{file} has no rows: no cell of the sweep has ended; run it to its end, or for longer"
        )
    # An unknown status would be neither a try nor a refusal, and would fall out of every fraction.
    unknown = sorted(set(columns["status"]) - set(STATUSES))
    if unknown:
        raise InputError(
            f"{file} has the status {unknown[0]!r}, expected one of {', '.join(STATUSES)}; run it "
            "again"
        )
    # One row for each cell, in an order that does not depend on which worker was faster.
    rows = _current(columns)
    order = {row: tuple(natural(columns[name][row] or "") for name in _ORDER) for row in rows}
    rows.sort(key=order.__getitem__)
    columns = {name: values[rows] for name, values in columns.items()}
    properties = tuple(
        sorted(name.removeprefix(PROPERTY) for name in columns if name.startswith(PROPERTY))
    )
    return Sweep(file, columns, properties, superseded=table.num_rows - len(rows))


@contextmanager
def _reading(file: Path) -> Iterator[None]:
    """Say in a line what is wrong with a file that Arrow cannot read."""
    import pyarrow as pa

    try:
        yield
    except (pa.ArrowException, OSError) as error:
        words = " ".join(str(error).split())
        raise InputError(
            f"{file} cannot be read as Parquet: {words[:160]}; run the sweep again"
        ) from error


def natural(text: str) -> tuple[str | int, ...]:
    """Return the key that sorts text as a reader does: random:9 before random:10."""
    return tuple(
        int(part) if place % 2 else part for place, part in enumerate(re.split(r"(\d+)", text))
    )


def _current(columns: Mapping[str, NDArray[Any]]) -> list[int]:
    """Return the rows that count: of each cell one.

    The folder of a sweep keeps what earlier source code computed, with faults that were fixed
    since, and a cell may have been computed once for its error and once with the machine to itself
    for its time. The row of the source code that computed the cell last counts; of several such
    rows one that was timed alone, and else the last.
    """
    started = [each or "" for each in columns["origin.started"]]
    source, alone = columns["origin.source"], columns["cost.alone"] == 1
    cells: dict[tuple[Any, ...], list[int]] = {}
    for row, cell in enumerate(zip(*(columns[name].tolist() for name in _CELL))):
        # NaN, where a number is not known, is not equal to itself.
        cells.setdefault(tuple(None if each != each else each for each in cell), []).append(row)
    rows = []
    for several in cells.values():
        # The source code of the newest row counts; of its rows one that was timed alone, else the
        # newest. The key settles equal dates.
        last = max(several, key=lambda row: (started[row], columns["key"][row]))
        same = [row for row in several if source[row] == source[last]]
        rows.append(max(same, key=lambda row: (alone[row], started[row], columns["key"][row])))
    return rows


def _file_of(path: Path) -> Path:
    """Return the Parquet that a path names."""
    file = path / FILE if path.is_dir() else path
    if not file.is_file():
        raise InputError(
            f"{file} is not there; expected the folder of a sweep, `airlight sweep -o DIR`, or its "
            "Parquet"
        )
    return file


def _array(column: Any) -> NDArray[Any]:
    """Return a column of Arrow as an array: texts as objects, all else as
    float64 with NaN for null.
    """
    import pyarrow as pa

    if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
        return np.array(column.to_pylist(), dtype=object)
    return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(), dtype=np.float64)


FAULTS = ("failed", "hung", "aborted")  #: what became of a cell that neither ended nor was refused
UNTOLD = "no reference"  #: of a scene whose reference was not done, so that no method was asked


@dataclass(frozen=True)
class Quantile:
    """A quantile of the errors of a configuration, with its interval; None for infinite ones."""

    probability: float
    value: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Sample:
    """One configuration over the scenes; what has one entry a scene is not written."""

    label: str  #: as tables name it in full
    method: str
    counts: Mapping[str, int]  #: scenes that ended so
    #: its median and its 95 % quantile; none if nothing was measured
    relative_rmse: tuple[Quantile, ...]
    frame_ms: float | None  #: median of the scenes whose time is known [ms]
    timed: int  #: scenes whose time is known
    scenes: tuple[str, ...] = field(repr=False)
    #: of the sweep: where each scene's cell with the largest error stands
    rows: tuple[int, ...] = field(repr=False)
    #: what became of each scene: that of its row, or `UNTOLD`
    statuses: tuple[str, ...] = field(repr=False)
    #: Relative RMSE [1]: infinite where the image has no finite pixel, NaN
    #: where nothing was measured.
    errors: Numbers = field(repr=False)
    #: The same at least and at most, as far as the references of all cells of a scene tell.
    least: Numbers = field(repr=False)
    most: Numbers = field(repr=False)
    nonfinite: Numbers = field(repr=False)  #: pixels with NaN or infinity, in all cells of a scene
    times: Numbers = field(repr=False)  #: of a frame [ms], see `comparable_times`; NaN elsewhere

    @property
    def measured(self) -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
        """Which scenes have an image to compare."""
        return np.array([status == "done" for status in self.statuses], dtype=bool)

    def count(self, *statuses: str) -> int:
        """Return how many scenes ended so."""
        return sum(self.counts.get(status, 0) for status in statuses)


def drawn_at_random(sweep: Sweep) -> bool:
    """Return whether any scene was drawn at random, so that claims are about such scenes alone."""
    return bool(np.isfinite(sweep["seed"]).any())


def samples(sweep: Sweep) -> list[Sample]:
    """Return the sample of every configuration, sorted by method and label."""
    # Columns as arrays, one entry a row.
    labels, scenes, statuses = sweep["label"], sweep["scene"], _statuses(sweep)
    methods, errors = sweep["method"], errors_of(sweep)
    # An error of a reference that is not known may be anything. A black reference has no relative
    # error: what is compared with it is black or not. An infinite error stays one for any reference.
    decided = (sweep["reference.mean"] == 0) | np.isinf(errors)
    reference_errors = np.nan_to_num(sweep["reference.error"], nan=np.inf)
    reference_errors = np.where(decided, 0.0, reference_errors)
    # A scene is within an error only where each of its cells is: the largest ends count.
    ends = errors - reference_errors, errors + reference_errors
    nonfinite = np.nan_to_num(sweep["error.nonfinite"], nan=0.0)
    times = np.where(comparable_times(sweep), sweep[FRAME_MS], np.nan)
    # Random scenes are a sample; chosen ones count only where there are no others (see the module).
    counted = (
        np.isfinite(sweep["seed"]) if drawn_at_random(sweep) else np.ones(len(sweep), dtype=bool)
    )
    # Rows of each configuration by scene.
    groups: dict[tuple[str, str, str], dict[str, list[int]]] = {}
    for row, label in enumerate(labels):
        if counted[row]:
            group = groups.setdefault((label, methods[row], _size(sweep, row)), {})
            group.setdefault(scenes[row], []).append(row)
    groups = dict(
        sorted(
            groups.items(),
            key=lambda item: tuple(map(natural, (item[0][1], item[0][0], item[0][2]))),
        )
    )
    # The size is named only where one configuration has several.
    several = Counter((label, method) for label, method, _ in groups)
    full = [
        f"{label}{size}" if several[label, method] > 1 else label for label, method, size in groups
    ]
    # The worst cell of a scene stands for it.
    badness = [_badness(status, error) for status, error in zip(statuses, errors.tolist())]
    made = []
    for (_, method, _), whole, group in zip(groups, full, groups.values()):
        worst = tuple(max(rows, key=badness.__getitem__) for rows in group.values())
        places = list(worst)
        known = times[places][np.isfinite(times[places])]
        least, most = (
            np.array([np.fmax.reduce(end[rows]) for rows in group.values()]) for end in ends
        )
        made.append(
            Sample(
                label=whole,
                method=method,
                counts=dict(Counter(statuses[places].tolist())),
                relative_rmse=_quantiles(errors[places]),
                frame_ms=float(np.median(known)) if len(known) else None,
                timed=len(known),
                scenes=tuple(group),
                rows=worst,
                statuses=tuple(statuses[places]),
                errors=errors[places],
                least=least,
                most=most,
                nonfinite=np.array([nonfinite[rows].sum() for rows in group.values()]),
                times=times[places],
            )
        )
    return made


def _quantiles(errors: Numbers) -> tuple[Quantile, ...]:
    known = errors[~np.isnan(errors)]
    # The median, and the error that 95 % of the scenes stay below.
    ends = ((each, quantile_interval(known, each)) for each in (0.5, 0.95) if len(known))
    return tuple(Quantile(each, *map(plain, found)) for each, found in ends)


def comparable_times(sweep: Sweep) -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
    """Return which rows have times that may be compared with one another.

    Those that were taken in turns while nothing else of the sweep ran on the host, on the host,
    device and threads that have the most such rows; and of one image those of its last run.
    """
    # Times of several machines cannot be compared: the place with most times counts.
    hosts, devices = sweep["origin.host"], sweep["origin.device"]
    places = list(zip(hosts, devices, np.nan_to_num(sweep["origin.threads"]).tolist()))
    alone = (sweep["cost.alone"] == 1) & (sweep["times.run.rounds"] > 1)
    most = Counter(place for place, timed in zip(places, alone) if timed).most_common(1)
    counts = alone & np.array([bool(most) and place == most[0][0] for place in places], dtype=bool)
    # The dates of one host are in order as text.
    # Methods of one image were timed in one run; a later run replaces all of it, never a part.
    images = list(zip(*(sweep[name].tolist() for name in ("scene", "width", "height", "medium"))))
    last: dict[tuple[Any, ...], str] = {}
    for row in np.flatnonzero(counts):
        last[images[row]] = max(last.get(images[row], ""), sweep["times.run.started"][row] or "")
    started = sweep["times.run.started"]
    return counts & np.array(
        [(when or "") == last.get(image) for image, when in zip(images, started)], dtype=bool
    )


def errors_of(sweep: Sweep) -> Numbers:
    """Return the relative RMSE of every row: NaN where nothing was measured, infinite
    where the image is unusable.

    Where the reference is black, an image that is black too has no error, and any other an infinite
    one. An image without a finite pixel has an infinite error.
    """
    done = sweep["status"] == "done"
    # Without a relative error the reference is black or the image has no finite pixel.
    relative, absolute = sweep["error.relative_rmse"], sweep["error.rmse"]
    unknown = np.where(absolute == 0, 0.0, np.inf)
    return np.where(done, np.where(np.isfinite(relative), relative, unknown), np.nan)


def _size(sweep: Sweep, row: int) -> str:
    width, height = sweep["width"][row], sweep["height"][row]
    return f" at {width:.0f} x {height:.0f}" if np.isfinite(width) and np.isfinite(height) else ""


def _statuses(sweep: Sweep) -> NDArray[np.object_]:
    """Return the status of every row; rows whose scene has no reference are `UNTOLD`."""
    reasons = zip(sweep["status"], sweep["reason"])
    untold = [
        status in FAULTS and (reason or "").startswith(NO_REFERENCE) for status, reason in reasons
    ]
    return np.where(untold, UNTOLD, sweep["status"])


def _badness(status: str, error: float) -> tuple[int, float]:
    """Order the cells of a scene: a fault stands for it before any error, the rest only
    where nothing was measured.
    """
    return (2 if status in FAULTS else 1 if status == "done" else 0), 0.0 if np.isnan(
        error
    ) else error


@dataclass(frozen=True)
class Fastest:
    """In how many scenes each configuration is the fastest within an error."""

    target: float
    counts: Mapping[str, int]  #: by label of a configuration
    none: int  #: scenes in which no configuration is within the error
    scenes: int  #: in which whatever was measured was timed with the machine to itself


def fastest_within(made: Sequence[Sample], target: float) -> Fastest:
    """Return in how many scenes each configuration is the fastest within an error."""
    best: dict[str, tuple[float, str]] = {}
    timed: dict[str, bool] = {}
    for sample in made:
        # A scene counts only if every image of it was timed: otherwise the fastest may be the one
        # that was not.
        rows = zip(sample.scenes, sample.statuses, sample.errors, sample.nonfinite, sample.times)
        for scene, status, error, bad, time in rows:
            if status != "done":
                continue
            timed[scene] = timed.get(scene, True) and bool(np.isfinite(time))
            if error <= target and not bad and time < best.get(scene, (np.inf, ""))[0]:
                best[scene] = (float(time), sample.label)
    scenes = {scene for scene, fully in timed.items() if fully}
    counts = {sample.label: 0 for sample in made}
    for scene, (_, label) in best.items():
        counts[label] += scene in scenes
    return Fastest(target, counts, len(scenes) - sum(counts.values()), len(scenes))
