# SPDX-License-Identifier: BSD-3-Clause
"""The tables of `airlight bench`, for a terminal and for a README."""

import time
from collections.abc import Sequence
from typing import Any

from reports.tables.terminal import number, print_table

_HEADERS = (
    "method",
    "frame ms",
    "quartiles",
    "frames/s",
    "airlight ms",
    "airlight/s",
    "light moved ms",
    "rel. RMSE",
    "rel. bias",
    "p99",
    "max",
)
_TRUTH_HEADERS = (
    "the truth of",
    "checked by",
    "samples",
    "bias",
    "95 % interval",
    "margin",
    "detectable",
    "uncorrected",
    "agree",
)
_TRUTH_TITLE = "Monte Carlo against the quadrature truth; volpath corrected for its shadow-ray epsilon"


def print_bench(found: list[dict[str, Any]], *, markdown: bool = False) -> None:
    """Print what `bench` found: a table for each scene, and one for the truth.

    Parameters
    ----------
    found
        One dictionary for each scene, with `name`, `size`, `methods` and `agreement` as in report.json.
    markdown
        Print Markdown, with the date and the machine.
    """
    show = print_markdown if markdown else print_table
    if markdown:
        print_heading()
    for scene in found:
        for one in scene["methods"]:
            if one["refused"]:
                print(f"{scene['name']}, {one['label']}: refused: {one['refused']}")
            if one["note"]:
                print(f"{scene['name']}, {one['label']}: {one['note']}")
        rows = [_row(one) for one in scene["methods"] if not one["refused"]]
        show(_HEADERS, rows, f"{scene['name']}, {scene['size'][0]} x {scene['size'][1]}")
    rows = [_agreement_row(scene["name"], one) for scene in found for one in scene["agreement"].values()]
    if rows:
        show(_TRUTH_HEADERS, rows, _TRUTH_TITLE)


def _row(one: dict[str, Any]) -> tuple[str, ...]:
    frame, airlight, error = one["times"]["frame"], one["times"]["airlight"]["median_ms"], one["error"]
    return (
        one["label"],
        number(frame["median_ms"]),
        f"{number(frame['low_ms'])}..{number(frame['high_ms'])}",
        rate(frame["median_ms"]),
        number(airlight),
        rate(airlight),
        number(one["times"]["light_moved"]["median_ms"]),
        number(error["relative_rmse"], 2),
        number(error["relative_bias"], 2),
        number(error["p99"], 2),
        number(error["max"], 2),
    )


#: What `rate_cells` returns: what is made anew, in frames a second, and the quartiles of the first rate.
RATES = (
    "light moved: all anew",
    "of published",
    "light moved: camera rays kept",
    "colours changed: surface and airlight anew",
    "quartiles ms of all anew",
)


def rate_cells(row: Any, published: float | None) -> tuple[str, ...]:
    """Return the cells of `RATES`.

    `row` has the timings `light_moved`, `light_moved_camera_kept` and `colours_changed`; `published` is
    None where nothing comparable was.
    """
    light_moved = row.light_moved
    of_published = f"{1000 / light_moved.median_ms / published:.2g} x" if published else "-"
    quartiles = f"{number(light_moved.low_ms)}..{number(light_moved.high_ms)}"
    kept = rate(row.light_moved_camera_kept.median_ms), rate(row.colours_changed.median_ms)
    return rate(light_moved.median_ms), of_published, *kept, quartiles


def rate(milliseconds: float) -> str:
    """Return how often a second something that takes so long can be done."""
    value = 1000 / milliseconds
    return f"{value:.0f}" if value >= 10 else f"{value:.1f}"


def _agreement_row(name: str, one: dict[str, Any]) -> tuple[str, ...]:
    statistics = one["statistics"]
    low, high = statistics["relative_bias_ci"]
    samples = one["width"] * one["height"] * one["batches"] * one["samples"]
    return (
        f"{name}, {one['layer']}",
        one["estimator"],
        f"{samples / 1e6:.0f} M",
        f"{100 * statistics['relative_bias']:+.3f} %",
        f"{100 * low:+.3f} .. {100 * high:+.3f} %",
        f"+-{100 * statistics['margin']:g} %",
        f"{100 * statistics['detectable_bias']:.2g} %",
        f"{100 * one['uncorrected_bias']:+.3f} %",
        "yes" if statistics["equivalent"] else "NO",
    )


def print_heading() -> None:
    """Print the date and the machine, the first line of tables in Markdown."""
    from reports.machine.environment import describe_environment, machine_in_words

    print(f"{time.strftime('%Y-%m-%d')}, {machine_in_words(describe_environment())}.")


def print_markdown(headers: Sequence[str], rows: Sequence[Sequence[str]], title: str) -> None:
    """Print a table as Markdown."""
    print(f"\n**{title}**\n")
    print("| " + " | ".join(headers) + " |")
    print("| --- |" + " ---: |" * (len(headers) - 1))
    for row in rows:
        print("| " + " | ".join(row) + " |")
