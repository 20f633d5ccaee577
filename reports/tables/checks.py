# SPDX-License-Identifier: BSD-3-Clause
"""Tables of what guards the numbers: baselines that moved, faults put into the estimators, light left out."""

from collections.abc import Iterable, Mapping
from typing import Any

from reports.tables.table import Column, Interval, Name, Row, Table, Value, Verdict, table, words

Entry = Mapping[str, Any]


def move_table(moves: Iterable[Any]) -> Table:
    """Return what is not as the baselines say; of `validation.frames.baseline_files.Move`."""
    columns = (
        *words("scene", "configuration", "what"),
        Column("baseline", "baseline", digits=6),
        Column("now", "now", digits=6),
        Column("allowed", "allowed", digits=2),
    )
    return table("", columns, [(one.scene, one.label, one.what, one.old, one.new, one.allowed) for one in moves])


_SEEN = (
    Column("bias", "bias seen", percent=True, sign=True),
    Column("interval", "95 % interval", percent=True, sign=True),
    Column("margin", "margin", percent=True),
)


def mutation_table(results: Iterable[Entry]) -> Table:
    """Return for each fault whether it was caught, and the comparison that shows it most clearly.

    Parameters
    ----------
    results
        As `airlight mutations --json` prints them. Those of a report may lack the comparisons.
    """
    columns = (
        Column("name", "mutation", words=True),
        Column("caught", "caught"),
        Column("chance", "chance", percent=True, places=0),
        Column("by", "by", words=True),
        Column("true_bias", "true bias", percent=True, sign=True),
        *_SEEN,
        Column("estimator", "estimator", words=True),
        Column("meaning", "what it stands for", words=True, long=True),
        Column("reason", "why not, or by a probe alone", words=True, long=True),
    )
    return table("Faults, and the comparison that shows each most clearly", columns, [_fault(one) for one in results])


def _fault(result: Entry) -> Row:
    values: dict[str, Value] = {"name": result["name"], "caught": Verdict(result["caught"])}
    values |= {key: result.get(key) for key in ("estimator", "meaning")}
    values["reason"] = result.get("reason") or ""
    clearest = result.get("clearest")
    if clearest:
        values |= _seen(clearest) | {"chance": result["chance"], "true_bias": clearest["true_bias"]}
        values["by"] = _comparison(clearest) if result["caught"] else ""
    return Row(values)


def control_table(controls: Iterable[Entry]) -> Table:
    """Return what the same comparisons find without a fault."""
    columns = (
        Column("control", "control", words=True),
        *_SEEN,
        Column("chance", "false alarms", percent=True, digits=2),
        Column("agrees", "agrees"),
    )
    rows = [
        Row(_seen(one) | {"control": _comparison(one), "chance": one["chance"], "agrees": Verdict(one["agrees"])})
        for one in controls
    ]
    return table("without a mutation", columns, rows)


def _seen(one: Entry) -> dict[str, Value]:
    return {"bias": one["relative_bias"], "interval": Interval(*one["interval"]), "margin": one["margin"]}


def _comparison(one: Entry) -> str:
    return f"{one['scene']}, {one['layer']}, {one['against']}"


def left_out_table(scenes: Iterable[Entry], *, code: bool = False) -> Table:
    """Return for every scene of a report the shares of light that single scattering leaves out."""
    columns = (
        Column("scene", "scene", words=True),
        Column("medium", "of the airlight", percent=True),
        Column("medium_interval", "95 % interval", percent=True),
        Column("everything", "of all light", percent=True),
        Column("everything_interval", "95 % interval", percent=True),
        Column("max_depth", "max. edges"),
    )
    rows = []
    for scene in scenes:
        multiple = scene["multiple"]
        values: dict[str, Value] = {"scene": Name(scene["name"]) if code else scene["name"]}
        if multiple:
            values["max_depth"] = multiple.get("max_depth")
            for key in ("medium", "everything"):
                ends = multiple[key]["interval"]
                values[key] = multiple[key]["value"]
                values[f"{key}_interval"] = None if ends is None or None in ends else Interval(*ends)
        rows.append(Row(values, "" if multiple else "not measured"))
    explanation = (
        "Shares of all light that paths of up to max. edges bring, with 95 % intervals; the second adds surfaces that "
        "light one another."
    )
    return table("Multiple scattering", columns, rows, explanation=explanation)
