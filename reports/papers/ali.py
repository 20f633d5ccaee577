# SPDX-License-Identifier: BSD-3-Clause
"""Fig. 5.8 of Ali 2016 again, with errors and times, the variants, and which of its conclusions hold here.

The data are `ali` of `airlight published --json`, see `validation.fidelity.ali_figures`.
"""

from collections.abc import Mapping
from typing import Any

from reports.tables.table import Row, Table, numbers, table, words

Data = Mapping[str, Any]


def ali_tables(data: Data) -> list[Table]:
    """Return the tables: pictures with errors and times, and the conclusions with their verdicts."""
    return [_pictures(data), _verdicts(data)]


def _pictures(data: Data) -> Table:
    columns = (
        *words(name="picture"),
        *numbers(ms="ms, light moved", fps="frames a second"),
        *numbers(error="rel. RMSE in the penumbra", edges="edges kept", flicker="flicker", how={"digits": 2}),
    )
    rows = []
    for name, row in data["rows"].items():
        timing = row["timing"]
        values = {"name": name, "error": row["error"], "edges": row["edges"], "flicker": data["flicker"].get(name)}
        if timing is not None:
            values |= {"ms": timing["median_ms"], "fps": 1000 / timing["median_ms"]}
        rows.append(Row(values))
    wide, high = data["size"]
    explanation = (
        "Reconstructed from captions: the source prints no equation. The error is that of airlight plus surface; edges "
        "and flicker are over those of the truth."
    )
    return table(f"Fig. 5.8 of Ali 2016 again, in fence, {wide} x {high}", columns, rows, explanation=explanation)


def _verdicts(data: Data) -> Table:
    from validation.fidelity.ali import ROWS
    from validation.fidelity.row import judge

    judged = [judge(row, data) for row in ROWS]
    columns = (*words(item="where", claim="claim", verdict="verdict"), *numbers("measured", how={"digits": 3}))
    rows = [Row({name: row[name] for name in ("item", "claim", "verdict", "measured")}) for row in judged]
    return table("Which conclusions of Ali 2016 hold here", columns, rows)
