# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.sweep`: many scenes, every method, on one machine or on a Dask
cluster; and what the rows say.
"""

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airlight.errors import InputError
from airlight.reports.api.inputs import File, Progress, exclude, one_error, telling
from airlight.reports.tables.record import Result
from airlight.reports.tables.table import Table

if TYPE_CHECKING:
    from airlight.reports.cluster.connect import Place
    from airlight.reports.cluster.run import Group, Task
    from airlight.reports.sweep.summary import Summary
    from airlight.validation.study.keys import Made
    from airlight.validation.study.rows import RowStore
    from airlight.validation.study.study import Cell, Study

_EVERY = 300.0  # between two times that the Parquet is written while rows come [s]


@dataclass(frozen=True)
class Problem:
    """A cell that failed, hung, aborted or was lost."""

    scene: str
    label: str
    status: str
    reason: str | None

    @property
    def words(self) -> str:
        """The problem in a line."""
        return f"{self.status}: {self.scene}, {self.label}: {self.reason}"


@dataclass(frozen=True, repr=False, kw_only=True)
class SweepRun(Result):
    """The outcome of the cells of a sweep."""

    study: str
    scenes: int
    cells: int
    cached: int
    computed: int
    timed_alone: int
    counts: Mapping[str, int]  #: cells that ended so
    left: int
    problems: tuple[Problem, ...]
    output: str  #: folder
    parquet: str | None

    @property
    def failures(self) -> Sequence[str]:
        """The cells that failed, hung or aborted, and how many are left."""
        left = [f"{self.left} cells are left"] if self.left else []
        return [each.words for each in self.problems] + left

    @property
    def title(self) -> str:
        """How many cells of how many scenes."""
        return f"{self.output}: {self.cells} cells of {self.scenes} scenes"

    @property
    def lines(self) -> Sequence[str]:
        """The counts, the problems and what to do next."""
        lines = [
            self.title,
            f"  {self.cached} were there, {self.computed} computed, {self.left} left",
        ]
        lines += [f"  {self.timed_alone} timed alone"] if self.timed_alone else []
        lines += [f"  {status}: {number}" for status, number in sorted(self.counts.items())]
        # Problems are listed one a line; the numbers of the others are in the rows.
        lines += [f"  {each.words}" for each in self.problems]
        if self.parquet:
            lines += [
                f"  rows in {self.parquet}",
                f"  what they say: airlight sweep --from {self.output}",
            ]
        return lines


@one_error
def sweep(
    study: File | int | None = None,
    *,
    cluster: str | None = None,
    output: File | None = None,
    from_: File | None = None,
    progress: Progress = None,
) -> "SweepRun | SweepFindings":
    """Run every method over many scenes: a row of numbers each.

    A study names scenes, methods, kernels, parameters, media and sizes; every combination is a cell
    and becomes one row of DIR/sweep.parquet and DIR/sweep.jsonl. A process for each processor
    computes them unless `--cluster` says otherwise.

    Finished rows are kept: a run that was interrupted goes on where it was, and the same study
    twice computes nothing but cells that failed, hung or aborted.

    `--from DIR` writes the findings: DIR/sweep.html, figures, and claims with their confidence as
    JSON; -o names another folder.

    The exit status is 1 if a cell failed, hung or aborted, or was left undone.

    Parameters
    ----------
    study
        A TOML file: what to sweep over, see docs/many-scenes.md; or a number of
        random scenes, 100 by default.
    cluster
        Let workers compute: local[:N] processes, tcp://HOST:PORT or tls://HOST:PORT of a Dask
        scheduler, or its scheduler file. A tcp scheduler authenticates nobody and its workers run
        what they are sent: use it only on a network that you trust; tls takes the certificates of
        Dask's configuration.
    output
        Folder of the rows; sweep-NAME by default.
    from_
        Write the page, figures and claims of this sweep from its Parquet file,
        without computing cells.
    progress
        Called with (fraction done, what); True shows a bar.
    """
    from airlight.reports.machine.environment import activate, require

    # An optional dependency is asked for before an hour of work, not after it.
    require("pyarrow", "sweep", "a sweep")
    if from_ is not None:
        exclude("from", "computes no cells", {"the study": study, "cluster": cluster})
        from airlight.reports.sweep.page import write_sweep

        said, page = write_sweep(Path(from_), None if output is None else Path(output))
        return SweepFindings(page=page, said=said)
    from airlight.reports.cluster.connect import parse_place
    from airlight.validation.study.rows import RowStore
    from airlight.validation.study.settings import Measure
    from airlight.validation.study.study import default_study, read_study

    # A number stands for so many random scenes, 100 by default; anything else is a study file.
    place = parse_place(cluster)
    number = str(100 if study is None else study)
    chosen = default_study(int(number)) if number.isdecimal() else read_study(Path(number))
    # Stages of frames belong to reports: a sweep would time none of these.
    usual, asked = Measure(), chosen.measure
    dropped = ["times = 'stages'"] if asked.times == "stages" else []
    dropped += [
        name
        for name in ("timed_size", "seconds", "slow")
        if getattr(asked, name) != getattr(usual, name)
    ]
    dropped += chosen.asked_of("half", "points", "checks", "growth", "stability")
    if dropped:
        raise InputError(
            f"study {number}: got {', '.join(dropped)}, but a sweep measures methods alone, each "
            "scene in the sizes of the study, and frames as wholes: leave them out, or airlight "
            f"report {number}"
        )
    folder = Path(output or f"sweep-{chosen.name}")
    variant = activate()
    # The store keeps every row as it comes: an interrupted sweep continues from there.
    with RowStore(folder) as store:
        ran = _run(chosen, store, place, variant=variant, progress=progress)
        # Parquet needs columns, and no row says which.
        if not len(store):
            return ran
        store.write_json()
        return replace(ran, parquet=str(store.write_parquet()))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class SweepFindings(Result):
    """The findings of a sweep, which were written as a page."""

    page: Path
    said: "Summary"  #: every number

    @property
    def title(self) -> str:
        """The page."""
        return str(self.page)

    @property
    def claims(self) -> Sequence[str]:
        """The most important sentences."""
        return [f"{each.kind}: {each.text}" for each in self.said.headlines]

    @property
    def tables(self) -> Sequence[Table]:
        """The errors and the speed of each configuration."""
        from airlight.reports.sweep.tables import errors_table, speed_table

        return [errors_table(self.said), speed_table(self.said)]

    @property
    def lines(self) -> Sequence[str]:
        """Where the page is, and how much it is about."""
        said = self.said
        count = f"{said.scenes} scenes, {len(said.samples)} configurations, {len(said.sweep)} cells"
        return [f"{self.page}: {count}"]

    def to_dict(self) -> dict[str, Any]:
        """Return every number."""
        from airlight.validation.columns import plain

        return plain(self.said)


def _run(
    study: "Study", store: "RowStore", place: "Place", *, variant: str, progress: Any
) -> SweepRun:
    """Compute what is missing, add it to the store, and return what came of it."""
    from airlight import __version__
    from airlight.reports.cluster.cells import cell_groups, row_without_numbers, timing_groups
    from airlight.validation.study.keys import made_here, scene_identities

    # A row is found again by the version, the machine's variant and the content of its scene.
    made, scenes = made_here(__version__, variant), scene_identities(study.scenes)
    problems: list[Problem] = []

    # First pass: errors of each cell. A cell that failed becomes a row that says why, so that the
    # table has every cell.
    def with_errors(outcome: Any) -> list[dict[str, Any]]:
        (cell, key), done = outcome.task.arguments, outcome.status == "done"
        # A row that says why has a date too: of several rows of a cell the newest counts.
        now = {"origin.started": datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")}
        row = outcome.value if done else row_without_numbers(cell, key, outcome) | now
        return [row | {"study": study.name, "attempts": outcome.attempts}]

    def with_times(outcome: Any) -> list[dict[str, Any]]:
        """Return the rows of an image with their times; without a process that timed
        them they are as they were.
        """
        columns = outcome.value if outcome.status == "done" else {}
        return [store.row(key) | values for key, values in columns.items()]

    how: dict[str, Any] = {"made": made, "problems": problems, "progress": progress}
    # Images that nobody times are rendered once: their kernels compile longer than they run.
    # Errors do not depend on how long a kernel takes, so that kernels are compiled quickly where
    # nothing is timed with them.
    quick = study.measure.times != "with"
    groups = list(cell_groups(study, made, store=store, scenes=scenes))
    counts = _part(study, store, place, groups, with_errors, quick=quick, **how)
    # of rows that are there by now
    # Second pass: times. On this machine one process at a time measures, or the processes would
    # slow each other down.
    groups = list(timing_groups(study, made, store=store, scenes=scenes))
    timed = _part(
        study, store, 1 if isinstance(place, int) else place, groups, with_times, quick=False, **how
    )
    # Cells that neither pass ran were in the store already.
    total = study.scene_count * study.cells_by_scene
    return SweepRun(
        study=study.name,
        scenes=study.scene_count,
        cells=total,
        cached=total - counts.total(),
        computed=counts.total() - counts["lost"],
        timed_alone=timed["done"],
        counts=dict(counts),
        left=counts["lost"] + timed["lost"],
        problems=tuple(problems),
        output=str(store.folder),
        parquet=None,
    )


def _part(
    study: "Study",
    store: "RowStore",
    place: "Place",
    groups: "list[Group]",
    rows_from: Callable[[Any], list[dict[str, Any]]],
    *,
    made: "Made",
    problems: list[Problem],
    progress: Any,
    quick: bool,
) -> Counter[str]:
    """Run groups, and add the rows of each outcome; return what came of their cells."""
    from airlight.reports.cluster.connect import connected
    from airlight.reports.cluster.run import run_groups

    counts, written = Counter[str](), time.monotonic()
    # Workers are started only for work.
    if not groups:
        return counts
    total = sum(len(_cells(task)) for group in groups for task in group.tasks)
    with connected(place, quick=quick) as cluster, telling(progress, f"sweep {study.name}") as tell:
        # Outcomes come in the order in which they end. A lost cell has no row, so that the next
        # sweep tries it again.
        for outcome in run_groups(cluster, groups, made=made, retries=study.retries):
            cells = _cells(outcome.task)
            rows = [] if outcome.status == "lost" else rows_from(outcome)
            for row in rows:
                store.add(row)
                counts[row["status"]] += 1
            if not rows:
                counts[outcome.status] += len(cells)
            # A method may refuse a scene by name: this is an answer and no problem.
            if outcome.status not in ("done", "refused"):
                what = (
                    cells[0].chosen.label if len(cells) == 1 else f"times of {len(cells)} methods"
                )
                problems.append(Problem(cells[0].scene, what, outcome.status, outcome.reason))
            # The Parquet is for anyone who looks while the sweep runs; writing it whole for each
            # row would take longer than the rows.
            if time.monotonic() - written > _EVERY:
                store.write_parquet()
                written = time.monotonic()
            tell(counts.total() / total, f"{counts.total()} of {total} cells, {cells[0].scene}")
    return counts


def _cells(task: "Task") -> "list[Cell]":
    """Return the cells of a task: one that is rendered, or those of an image that are timed."""
    first = task.arguments[0]
    return list(first.values()) if isinstance(first, dict) else [first]
