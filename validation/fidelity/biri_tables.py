# SPDX-License-Identifier: BSD-3-Clause
"""Tables 1 and 2 of Biri 2006 as far as rows need them: as published, and our exact form; and the constant R.

`airlight published` has more rows: other kernels, cones, and interpolation between the corners of tiles. As published
is `validation.papers.biri.as_published` with the derived polynomial; its printed coefficients have rows of their own.
"""

from typing import Any

from validation.metrics.errors import plain
from validation.papers.biri import PUBLISHED, biri_row
from validation.papers.constant_distance import constant_distance_study

_SECONDS = 0.1  # for each timing [s]
_COMPARED = (320, 240)  # size of the frames that are compared: the default report keeps these truths [pixels]


def biri_tables(scale: float = 1.0) -> dict[str, Any]:
    """Return `rows` and `constant_distance` as they stand in `published.biri` of report.json, as far as needed.

    Parameters
    ----------
    scale
        Of the width and height of the images; 1 for the published sizes.
    """
    rows = []
    for published in PUBLISHED:
        size, compared = (
            tuple(max(16, round(scale * side / 4) * 4) for side in sides) for sides in (published.size, _COMPARED)
        )
        sizes: dict[str, Any] = {"size": size, "error_size": compared}
        as_published: dict[str, Any] = {"cone": published.cone, "published_variant": True}
        variants: tuple[tuple[str, dict[str, Any]], ...] = (("exact", {}), ("taylor", as_published))
        for kernel, how in variants:
            row = biri_row(published, kernel, **how, **sizes, seconds=_SECONDS)
            shares = [None if share is None else float(share) for share in row.shares]
            rows.append(plain(row) | {"shares": shares})
    return {"rows": rows, "constant_distance": plain(constant_distance_study())}
