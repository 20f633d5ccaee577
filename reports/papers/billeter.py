# SPDX-License-Identifier: BSD-3-Clause
"""Figures 6 and 7 and Table 1 of Billeter 2010 beside our own figures.

The data are `published.billeter` of report.json, as `airlight published --json` prints them.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from reports.papers.rates import COLUMNS, rates, size_words
from reports.tables.table import Row, Table, Value, numbers, table, words

Data = Mapping[str, Any]

SIZE = (1024, 1024)  #: of the published images [pixels]; only at this size are rates compared
#: Of Table 1.
PASSES = ("surface", "shadow map", "laplacian", "edge map", "tessellate", "vertices", "prepare", "volume")


def billeter_data(figures: Sequence[Any], views: Sequence[Any]) -> dict[str, Any]:
    """Return what was measured as JSON-ready data.

    Parameters
    ----------
    figures
        From `validation.papers.billeter_images.figure_rows`.
    views
        From `validation.papers.billeter_tessellation.table_rows`.
    """
    from validation.metrics.errors import plain

    return {
        "figures": plain(figures),
        "table": [
            plain(row)
            | {
                "published": {
                    "what": row.published.what,
                    "fps": row.published_fps,
                    "passes": plain(row.published.passes.get((row.map, row.evaluation), {})),
                    "as_read": list(row.published.as_read.get((row.map, row.evaluation), ())),
                },
                "scene": row.published.scene,
            }
            for row in views
        ],
    }


def billeter_tables(data: Data) -> list[Table]:
    """Return the tables: images, views of Table 1, and its passes."""
    images = [_image_table(data["figures"])] if data["figures"] else []
    return images + ([_view_table(data["table"]), _pass_table(data["table"])] if data["table"] else [])


def _image(row: Data) -> str:
    entry = row["entry"]
    values = ", ".join(f"{name}={value}" for name, value in (("map", entry["map"]), *entry["parameters"]))
    return f"{entry['where']}, {entry['scene']}, {size_words(row)}: {entry['method']} ({values})"


def _view(row: Data) -> str:
    return f"{row['scene']}, {size_words(row)}, map {row['map']}: {row['evaluation']}"


def _rates(row: Data, published: float | None) -> dict[str, Value]:
    return rates(row, published, comparable=tuple(row["size"]) == SIZE)


def _not_measured(row: Data) -> str:
    return f"not measured: {row['missing']}" if row.get("missing") else ""


def _image_table(rows: Sequence[Data]) -> Table:
    named = {"error_rmse": "rel. RMSE", "error_p99": "p99"}
    columns = (*words(name="frames a second"), *COLUMNS, *numbers(**named, how={"digits": 2, "share": True}))
    table_rows = []
    for row in rows:
        values: dict[str, Value] = {"name": _image(row), **_rates(row, row["entry"]["fps"])}
        error = row["error"] or {}
        values |= {"error_rmse": error.get("relative_rmse"), "error_p99": error.get("p99")}
        table_rows.append(Row(values, _not_measured(row)))
    title = "Figures 6 and 7 of Billeter 2010 again: frames a second, and the error of the airlight"
    explanation = "The error is against the truth."
    return table(title, columns, table_rows, explanation=explanation)


def _view_table(rows: Sequence[Data]) -> Table:
    error = numbers(relative_rmse="rel. RMSE to the static mesh", how={"digits": 2, "share": True})
    columns = (*words(name="frames a second"), *numbers("triangles"), *COLUMNS, *error)
    table_rows = []
    for row in rows:
        values: dict[str, Value] = {"name": _view(row), "triangles": row["triangles"] or None}
        values |= _rates(row, row["published"]["fps"])
        values["relative_rmse"] = (row.get("against_static") or {}).get("relative_rmse")
        table_rows.append(Row(values, _not_measured(row)))
    what = dict.fromkeys(f"{row['scene']} for {row['published']['what']}" for row in rows)
    return table(f"Table 1 of Billeter 2010 again, {'; '.join(what)}: frames a second", columns, table_rows)


def _pass_table(rows: Sequence[Data]) -> Table:
    columns = (*words(name="ms of each pass"), *numbers(*PASSES))
    table_rows = []
    for row in rows:
        published = row["published"]["passes"]
        if published:
            name = f"{row['scene']}, map {row['map']}, {row['evaluation']}: published"
            if row["published"].get("as_read"):
                name += f" ({', '.join(row['published']['as_read'])} as read)"
            table_rows.append(Row({"name": name} | {step: published.get(step) for step in PASSES}, published=True))
        if row["passes"]:
            table_rows.append(Row({"name": _view(row)} | {step: row["passes"].get(step) for step in PASSES}))
    return table("Table 1 of Billeter 2010 again: the passes", columns, table_rows)
