# SPDX-License-Identifier: BSD-3-Clause
"""How many rays an image needs where airlight is interpolated, between tiles and along epipolar lines."""

from collections.abc import Iterable, Mapping
from typing import Any

from reports.tables.table import Row, Table, numbers, table, words

Record = Mapping[str, Any]  #: a result of `airlight bench --interpolation --json`

ERROR = 1e-3  #: relative RMSE for which the fewest rays are named
_SHARE = {"digits": 3, "share": True}
_COLUMNS = (
    *words(way="corners of"),
    *numbers("tolerance"),
    *numbers(corners="rays at corners", computed="other rays", rays="all rays", how=_SHARE),
    *numbers(relative_rmse="rel. RMSE", how={"digits": 2, "share": True}),
)


def interpolation_tables(records: Iterable[Record]) -> list[Table]:
    """Return a table for each scene and method: of every way, the fewest rays within `ERROR`, and the least error."""
    return [_table(record) for record in records]


def _table(record: Record) -> Table:
    by_way: dict[str, list[Record]] = {}
    for found in record["ways"]:
        by_way.setdefault(_name(found), []).append(found)
    rows = []
    for way, several in by_way.items():
        within = [found for found in several if found["relative_rmse"] <= ERROR]
        best = min(within, key=lambda found: found["rays"]) if within else several[0]
        remarks = () if within else ("no tolerance is enough",)
        rows.append(Row({"way": way} | {column.key: best[column.key] for column in _COLUMNS[1:]}, remarks=remarks))
    explanation = (
        f"The fewest rays with which the image errs by a relative RMSE of {100 * ERROR:g} % from that of all rays, by "
        "tolerance. Rays as shares of the pixels: at the corners of cells, and of pixels that are not interpolated."
    )
    title = "{scene}, {}, {} x {}".format(record["label"], *record["size"], scene=record["scene"])
    return table(title, _COLUMNS, rows, explanation=explanation)


def _name(found: Record) -> str:
    return "tiles of 4 x 4" if found["lines"] is None else f"{found['lines']} lines of {found['samples']} samples"
