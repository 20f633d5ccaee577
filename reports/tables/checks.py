# SPDX-License-Identifier: BSD-3-Clause
"""Tables of what guards the numbers: faults put into the estimators, light left out."""

from collections.abc import Iterable, Mapping
from typing import Any

from reports.tables.table import Interval, Name, Row, Table, Value, Verdict, numbers, table, words

Entry = Mapping[str, Any]


_SEEN = (
    *numbers(bias="bias seen", interval="95 % interval", how={"percent": True, "sign": True}),
    *numbers("margin", how={"percent": True}),
)


def mutation_table(results: Iterable[Entry]) -> Table:
    """Return for each fault whether it was caught, and the comparison that shows it most clearly.

    Parameters
    ----------
    results
        As `airlight mutations --json` prints them. Those of a report may lack the comparisons.
    """
    columns = (
        *words(name="mutation"),
        *numbers("caught"),
        *numbers("chance", how={"percent": True, "places": 0}),
        *words("by"),
        *numbers(true_bias="true bias", how={"percent": True, "sign": True}),
        *_SEEN,
        *words("estimator"),
        *words(meaning="what it stands for", reason="why not, or by a probe alone", how={"long": True}),
    )
    return table("Faults, and the comparison that shows each most clearly", columns, map(_fault, results))


def _fault(result: Entry) -> Entry:
    clearest = result.get("clearest")
    row = {**result, "caught": Verdict(result["caught"]), "reason": result.get("reason") or ""}
    if clearest:
        row |= {**_seen(clearest), "true_bias": clearest["true_bias"]}
        row["by"] = _comparison(clearest) if result["caught"] else ""
    return row


def control_table(controls: Iterable[Entry]) -> Table:
    """Return what the same comparisons find without a fault."""
    alarms = numbers(chance="false alarms", how={"percent": True, "digits": 2})
    rows = (
        _seen(control)
        | {"control": _comparison(control), "chance": control["chance"], "agrees": Verdict(control["agrees"])}
        for control in controls
    )
    return table("without a mutation", (*words("control"), *_SEEN, *alarms, *numbers("agrees")), rows)


def _seen(comparison: Entry) -> dict[str, Value]:
    interval = Interval(*comparison["interval"])
    return {"bias": comparison["relative_bias"], "interval": interval, "margin": comparison["margin"]}


def _comparison(comparison: Entry) -> str:
    return f"{comparison['scene']}, {comparison['layer']}, {comparison['against']}"


def left_out_table(scenes: Iterable[Entry], *, code: bool = False) -> Table:
    """Return for every scene of a report the shares of light that single scattering leaves out."""
    share = {"percent": True}
    columns = (
        *words("scene"),
        *numbers(medium="of the airlight", medium_interval="95 % interval", how=share),
        *numbers(everything="of all light", everything_interval="95 % interval", how=share),
        *numbers(max_depth="max. edges"),
    )
    explanation = (
        "Shares of all light that paths of up to max. edges bring, with 95 % intervals; the second adds surfaces that "
        "light one another."
    )
    rows = (_left_out(scene, Name(scene["name"]) if code else scene["name"]) for scene in scenes)
    return table("Multiple scattering", columns, rows, explanation=explanation)


def _left_out(scene: Entry, name: Value) -> Row:
    multiple = scene["multiple"]
    if not multiple:
        return Row({"scene": name}, "not measured")
    values: dict[str, Value] = {"scene": name, "max_depth": multiple.get("max_depth")}
    for key in ("medium", "everything"):
        values |= {key: multiple[key]["value"], f"{key}_interval": Interval.of(multiple[key]["interval"])}
    return Row(values)
