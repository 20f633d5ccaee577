# SPDX-License-Identifier: BSD-3-Clause
"""The figures of Ali 2016 as rows need them: R1 to R4 with their errors and times, variants, flicker."""

from typing import Any

from validation.metrics.errors import plain
from validation.papers.ali import ShaftsStudy, shafts_study

_SIZE = (400, 300)  # a quarter of the pixels of `airlight published`: rows compare renderings with one another


def ali_figures(size: tuple[int, int] = _SIZE, *, seconds: float = 0.3, points: int = 64) -> dict[str, Any]:
    """Return `rows` by name and `flicker` by name, ready for JSON.

    Parameters
    ----------
    size
        Of the frames [pixels].
    seconds
        For the timings of each row [s].
    points
        Light points of the truth.
    """
    return study_data(shafts_study(size, seconds=seconds, points=points))


def study_data(study: ShaftsStudy) -> dict[str, Any]:
    """Return a study as plain data, without its images."""
    rows = {
        row.name: {
            "parameters": dict(row.parameters),
            "error": row.error,
            "edges": row.edges,
            "timing": plain(row.timing) if row.timing is not None else None,
        }
        for row in study.rows
    }
    return {"size": list(study.size), "rows": rows, "flicker": dict(study.flicker)}
