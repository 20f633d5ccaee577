# SPDX-License-Identifier: BSD-3-Clause
"""The truth against Monte Carlo: whether a comparison confirms it, and the table of all comparisons."""

from collections.abc import Iterable, Mapping
from typing import Any

from reports.tables.table import Column, Interval, Row, Table, Value, Verdict

COLUMNS = (
    Column("name", "the truth of", words=True),
    Column("estimator", "checked by", words=True),
    Column("samples", "samples", after=" M", places=0),
    Column("bias", "bias", percent=True, sign=True, places=3),
    Column("interval", "95 % interval", percent=True, sign=True, places=3),
    Column("margin", "margin \N{PLUS-MINUS SIGN}", percent=True),
    Column("detectable", "detectable", percent=True, digits=2),
    Column("epsilon", "shadow-ray epsilon"),
    Column("uncorrected", "uncorrected", percent=True, sign=True, places=3),
    Column("z_mean", "z: mean", sign=True),
    Column("z_std", "z: st. deviation"),
    Column("rejected", "rejected"),
    Column("expected", "expected", digits=2),
    Column("masked", "masked"),
    Column("effort", "effort", words=True),
    Column("agrees", "agree"),
)
BENCH = ("name", "estimator", "samples", "bias", "interval", "margin", "detectable", "uncorrected", "agrees")


def verdict(compared: Mapping[str, Any]) -> bool | None:
    """Return whether a comparison confirms the truth; None where it ran out of time before it could tell.

    Out of time is what stopped before the intervals were as narrow as wanted. It can still speak against the truth: by
    an interval that lies outside the margin as a whole.
    """
    statistics = compared["statistics"]
    if statistics["equivalent"]:
        return True
    interval = statistics.get("relative_bias_ci")
    if compared.get("finished", True) or interval is None or None in interval:
        return False
    low, high = interval
    return None if low <= statistics["margin"] and high >= -statistics["margin"] else False


def agreement_table(
    title: str, compared: Iterable[tuple[str, Mapping[str, Any]]], *keys: str, explanation: str = ""
) -> Table:
    """Return the table of comparisons of the truth, each with the name of what it compares.

    Parameters
    ----------
    title, explanation
        See `reports.tables.table.Table`.
    compared
        Names, and the values of `agreement` in report.json.
    keys
        Of `COLUMNS`; `BENCH` by default.
    """
    rows = tuple(Row(_values(name, one)) for name, one in compared)
    return Table(title, COLUMNS, rows, explanation).only(*(keys or BENCH))


def _values(name: str, one: Mapping[str, Any]) -> dict[str, Value]:
    statistics = one["statistics"]
    interval = statistics["relative_bias_ci"]
    return {
        "name": name,
        "estimator": one["estimator"],
        "samples": one["width"] * one["height"] * one["batches"] * one["samples"] / 1e6,
        "bias": statistics["relative_bias"],
        "interval": None if interval is None or None in interval else Interval(*interval),
        "margin": statistics["margin"],
        "detectable": statistics["detectable_bias"],
        "epsilon": one.get("epsilon"),
        "uncorrected": one["uncorrected_bias"],
        "z_mean": statistics.get("z_mean"),
        "z_std": statistics.get("z_std"),
        "rejected": statistics.get("rejected"),
        "expected": statistics.get("expected_rejections"),
        "masked": one.get("masked"),
        "effort": f"{one['width']} \N{MULTIPLICATION SIGN} {one['height']} pixels, {one['batches']} "
        f"\N{MULTIPLICATION SIGN} {one['samples']} spp",
        "agrees": Verdict(verdict(one)),
    }
