# SPDX-License-Identifier: BSD-3-Clause
"""`airlight.paper`: verdicts on the claims of papers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airlight.errors import InputError, nearest
from airlight.reports.api.inputs import File, Progress, one_error, telling
from airlight.reports.tables.record import Result
from airlight.reports.tables.table import Table

if TYPE_CHECKING:
    from airlight.validation.papers.claims import Claim


@one_error
def paper(
    name: str | None = None,
    *,
    pictures: File | None = None,
    quick: bool = False,
    progress: Progress = None,
) -> "PaperVerdicts":
    """Give a verdict on every claim of the papers.

    Equations, figures, tables and sentences stand next to what was measured. A verdict is
    reproduced, not reproduced, differs (it depends on the machine or on a scene of ours) or
    impossible. This command measures what a verdict needs, or takes it from the cache; all verdicts
    take about an hour.

    Parameters
    ----------
    name
        biri, billeter, ali or bouthors: also the numbers of the paper that have no verdict, such as
        frame rates of graphics cards. By default the verdicts of all papers.
    pictures
        Also draw the pictures of the papers in our scenes into this folder, as PDF
        and PNG with their data.
    quick
        Only the claims that need no image, and small figures.
    progress
        Called with (fraction done, what); True shows a bar.

    Raises
    ------
    InputError
        For an unknown paper.
    """
    from airlight.reference.storage.store import date
    from airlight.reports.machine.environment import activate, describe_environment
    from airlight.reports.report.others import measure_claims
    from airlight.validation.papers.claims import claims, papers

    # The names are known without Mitsuba.
    if name is not None and name not in papers():
        raise InputError(
            f"paper: got {name!r}, expected one of {', '.join(papers())}" + nearest(name, papers())
        )
    chosen = [claim for claim in claims() if name in (None, claim.paper)]
    activate()
    # Measurements come from the cache where code and scenes are the same. With `quick` only rows
    # that need no image are measured.
    with telling(progress, "paper") as tell:
        rows = measure_claims(chosen, quick=quick, progress=tell)
    written: tuple[str, ...] = ()
    if pictures is not None:
        from airlight.reports.figures.papers import write_figures

        with telling(progress, "pictures") as tell:
            written = write_figures(Path(pictures), name, quick=quick, progress=tell)
    return PaperVerdicts(
        measured=date(),
        environment=describe_environment(),
        papers=tuple(rows),
        # Rows that `quick` did not measure are counted, never passed over in silence.
        left_out=len(chosen) - len(rows),
        files=written,
        numbers=name is not None,
    )


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PaperVerdicts(Result):
    """The claims of papers with their verdicts."""

    measured: str  #: date
    environment: Mapping[str, Any]
    papers: "tuple[Claim, ...]"
    left_out: int  #: claims that were not measured
    files: tuple[str, ...] = field(default=(), repr=False)  #: figures that were written
    #: whether tables also have the numbers of a paper that have no verdict
    numbers: bool = field(default=False, repr=False)

    @property
    def title(self) -> str:
        """How many claims have each verdict."""
        from airlight.reports.tables.papers import count_words

        # Numbers without a verdict belong to no count.
        return count_words([row for row in self.papers if row.verdict is not None])

    @property
    def tables(self) -> Sequence[Table]:
        """A table of verdicts for each paper, and its numbers."""
        from airlight.reports.tables.papers import paper_tables

        return paper_tables(self.papers, plain=self.numbers)

    @property
    def lines(self) -> Sequence[str]:
        """The counts, and the figures that were written."""
        more = [f"{self.left_out} more rows need images: leave out --quick."]
        return [f"{self.title}.", *(more if self.left_out else []), *self.files]
