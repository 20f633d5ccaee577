# SPDX-License-Identifier: BSD-3-Clause
"""The truth against Monte Carlo: whether a comparison confirms it, and the table of all comparisons."""

from collections.abc import Iterable, Mapping
from typing import Any

from reports.tables.table import Interval, Table, Verdict, numbers, table, words

_PERCENT = {"percent": True, "sign": True, "places": 3}
COLUMNS = (
    *words(name="the truth of", estimator="checked by"),
    *numbers("samples", how={"after": " M", "places": 0, "minor": True}),
    *numbers(relative_bias="bias", interval="95 % interval", how=_PERCENT),
    *numbers(uncorrected_bias="uncorrected", how={**_PERCENT, "minor": True}),
    *numbers("margin", how={"percent": True}),
    *numbers(detectable_bias="detectable", how={"percent": True, "digits": 2, "minor": True}),
    *numbers("rejected", "masked", epsilon="shadow-ray epsilon", z_mean="z: mean", z_std="z: st. deviation"),
    *numbers(expected_rejections="expected", how={"digits": 2}),
    *words("effort"),
    *numbers(agrees="agree"),
)
BENCH = (
    *("name", "estimator", "samples", "relative_bias", "interval", "margin"),
    *("detectable_bias", "uncorrected_bias", "agrees"),
)


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
    rows = (_values(name, comparison) for name, comparison in compared)
    return table(title, COLUMNS, rows, explanation=explanation).only(*(keys or BENCH))


def _values(name: str, comparison: Mapping[str, Any]) -> Mapping[str, Any]:
    width, height, batches, samples = (comparison[key] for key in ("width", "height", "batches", "samples"))
    return {
        **comparison,
        **comparison["statistics"],
        "name": name,
        "samples": width * height * batches * samples / 1e6,
        "interval": Interval.of(comparison["statistics"]["relative_bias_ci"]),
        "effort": f"{width} x {height} pixels, {batches} x {samples} spp",
        "agrees": Verdict(verdict(comparison)),
    }
