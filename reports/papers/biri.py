# SPDX-License-Identifier: BSD-3-Clause
"""Tables 1 and 2 of Biri 2006 beside our own figures.

The data are `published.biri` of report.json, as `airlight published --json` prints them.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from reports.papers.rates import COLUMNS, rates, size_words
from reports.tables.methods import per_second
from reports.tables.table import Row, Table, measured, numbers, table, words

Data = Mapping[str, Any]


def biri_data(rows: Sequence[Any], study: Sequence[Any] = ()) -> dict[str, Any]:
    """Return what was measured as JSON-ready data.

    Parameters
    ----------
    rows
        From `validation.papers.biri.biri_rows`.
    study
        From `validation.papers.constant_distance.constant_distance_study`, or none.
    """
    from validation.metrics.errors import plain
    from validation.papers.biri import STAGES

    return {
        "stages": list(STAGES),
        "rows": [
            plain(row) | {"shares": [None if share is None else float(share) for share in row.shares]} for row in rows
        ],
        "constant_distance": plain(study),
    }


def biri_tables(data: Data) -> list[Table]:
    """Return the tables: shares of the stages, frames a second."""
    study = data.get("constant_distance") or []
    return [_share_table(data), _rate_table(data["rows"]), *([_study_table(study)] if study else [])]


def biri_notes(data: Data) -> list[str]:
    """Return what there is to know of the published figures, each once."""
    published = [row["published"] for row in data["rows"]]
    return list(dict.fromkeys(f"{entry['where']}: {entry['note']}." for entry in published if entry["note"]))


def biri_variant(row: Data) -> str:
    """Return the kernel of a row, and the parameters that differ from their defaults, or that it is as published."""
    if row.get("white"):
        return f"{row['kernel']}, as published"
    return ", ".join([row["kernel"], *(f"{name}={row[name]}" for name in ("cone", "tolerance") if row.get(name))])


def _name(row: Data) -> str:
    return f"{row['published']['scene']}, {size_words(row)} ({biri_variant(row)})"


def _share_table(data: Data) -> Table:
    stages = [f"stage_{place}" for place in range(1, len(data["stages"]) + 1)]
    headings = {key: f"{place} {name}" for place, (key, name) in enumerate(zip(stages, data["stages"]), start=1)}
    shown = numbers(**headings, how={"percent": True})
    columns = (*words(name="share of a frame"), *shown, *numbers("sum", how={"unit": "ms"}))
    rows: list[Row] = []
    for row, published in _with_published(data["rows"]):
        if published:
            name = f"{published['scene']}: Table 1, {published['where']}"
            shares = {key: share / 100 for key, share in zip(stages, published["shares"])}
            rows.append(Row({"name": name, **shares}, published=True))
        known = {key: None if share is None else share / 100 for key, share in zip(stages, row["shares"])}
        rows.append(Row({"name": _name(row), **known, "sum": sum(row["stages_ms"])}))
    title = "Table 1 of Biri 2006 again: share of each stage in their sum, after the light moved"
    explanation = "One kernel does stages 3 and 5; without a share the spread of the timings hides which does what."
    return table(title, columns, rows, explanation=explanation)


def _with_published(rows: Sequence[Data]) -> Iterator[tuple[Data, Data | None]]:
    """Yield every row, with what was published of the shares in its scene before the first of that scene."""
    shown = set()
    for row in rows:
        published = row["published"]
        first = bool(published["shares"]) and published["scene"] not in shown
        shown |= {published["scene"]} if first else set()
        yield row, published if first else None


def _rate_table(rows: Sequence[Data]) -> Table:
    columns = (
        *words(name="frames a second"),
        *numbers("triangles"),
        *COLUMNS,
        *numbers(rays="camera rays alone", how={"whole": True}),
        *numbers(relative_rmse="rel. RMSE", relative_bias="rel. bias", p99="", how={"digits": 2, "share": True}),
        *numbers(frame_rmse="rel. RMSE of the frame", how={"digits": 2, "share": True}),
    )
    table_rows = []
    for row in rows:
        published = row["published"]
        beside = rates(row, published["fps"], comparable=list(row["size"]) == list(published["size"]))
        alone = per_second(measured(row.get("rays")))
        table_rows.append({**row["error"], **beside, "name": _name(row), "triangles": row["triangles"], "rays": alone})
        table_rows[-1]["frame_rmse"] = (row.get("frame_error") or {}).get("relative_rmse")
    return table("Table 2 of Biri 2006 again: frames a second, and the error of the airlight", columns, table_rows)


def _study_table(rows: Sequence[Data]) -> Table:
    columns = (
        *numbers(size="radius over the lamp's distance", optical_depth="optical depth", how={"digits": 2}),
        *numbers(relative_rmse="rel. RMSE", relative_bias="rel. bias", how={"digits": 2, "share": True}),
        *numbers(scale="best factor", how={"digits": 3}),
        *numbers(shape="rel. RMSE left by it", how={"digits": 2, "share": True}),
        *numbers(polynomial="rel. RMSE of the polynomial", printed="as printed", how={"digits": 2, "share": True}),
    )
    explanation = "A sphere of fog in clear air, lit from above; against the true depth of both legs."
    title = "The constant R of Biri 2006, section 4.2: error by size and optical depth of the medium"
    return table(title, columns, rows, explanation=explanation)
