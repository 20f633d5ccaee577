# SPDX-License-Identifier: BSD-3-Clause
"""Advice: what methods would cost and err by in a scene, and which one to take."""

import shlex
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from reports.tables.table import Column, Interval, Table, table

if TYPE_CHECKING:
    from validation.advise.choose import Advice, Candidate
    from validation.advise.model import AdviceModel

_COLUMNS = (
    Column("method", "method", words=True),
    Column("kernel", "kernel", words=True),
    Column("settings", "parameters", words=True),
    Column("error", "error", digits=2, meaning="relative RMSE of the airlight, as likely too high as too low"),
    Column("error_bound", "error below", digits=2, meaning="which it stays below in the share of scenes"),
    Column("covered", "in", percent=True, digits=2, meaning="share of scenes, as many as its own number can promise"),
    Column("cost_ms", "frame", "(ms)", digits=3),
    Column("cost", "in four of five scenes", "(ms)", digits=3),
    Column("refused", "refuses because", words=True, long=True),
)


def advice_data(scene: str, advice: "Advice", model: "AdviceModel", size: str | None = None) -> dict[str, Any]:
    """Return advice as plain data, as `airlight advise --json` prints it."""
    about = dict(model.about)
    return {
        "scene": scene,
        "error": advice.error,
        "share": advice.share,
        "holds": advice.holds,
        "best": None if advice.best is None else _data(advice.best),
        "command": None if advice.best is None else _command(scene, advice.best, size),
        "candidates": [_data(each) for each in advice.candidates],
        "beyond": list(advice.beyond),
        "fitted_to": about,
    }


def _data(candidate: "Candidate") -> dict[str, Any]:
    chosen = candidate.chosen
    numbers = {
        name: getattr(candidate, name)
        for name in ("error", "error_bound", "covered", "chance", "cost_ms", "cost_low", "cost_high")
    }
    return {
        "method": chosen.method,
        "kernel": chosen.kernel,
        "parameters": dict(chosen.parameters),
        **(dict.fromkeys(numbers) if candidate.refused else numbers),
        "refused": candidate.refused or None,
    }


def _command(scene: str, candidate: "Candidate", size: str | None) -> str:
    chosen = candidate.chosen
    words = ["airlight", "render", scene, "--method", chosen.method]
    words += ["--kernel", chosen.kernel] if chosen.kernel else []
    for name, value in chosen.parameters:
        words += ["--set", f"{name}={value}"]
    return shlex.join([*words, *(["--size", size] if size else [])])


def candidates_table(data: Mapping[str, Any]) -> Table:
    """Return the table of all candidates, the one to take first."""
    rows = []
    for each in data["candidates"]:
        settings = ", ".join(f"{name}={value}" for name, value in each["parameters"].items())
        cost = None if each["refused"] else Interval(each["cost_low"], each["cost_high"])
        rows.append({**each, "settings": settings, "cost": cost})
    keep = [column.key for column in _COLUMNS]
    columns = tuple(each for each in _COLUMNS if each.key != "refused" or any(row["refused"] for row in rows))
    title = f"{data['scene']}: methods that shall hold {data['error']:g} in {data['share']:.0%} of scenes"
    return table(title, columns, [{key: row[key] for key in keep if key in {c.key for c in columns}} for row in rows])


def advice_lines(data: Mapping[str, Any]) -> list[str]:
    """Return which one to take, in sentences."""
    best, about = data["best"], data["fitted_to"]
    lines = []
    if best is None:
        lines.append("every method refuses the scene")
    elif data["holds"]:
        lines.append(f"take: {data['command']}")
    else:
        lines.append(
            f"none is predicted to hold {data['error']:g}; the likeliest does in {best['chance']:.0%} of scenes like "
            f"it: {data['command']}"
        )
    if data["beyond"]:
        lines.append(f"this scene is beyond all that were swept in: {', '.join(data['beyond'])}; trust it less")
    judgement = about.get("judgement") or {}
    held, close = judgement.get("held"), judgement.get("close")
    words = f"fitted to {about.get('scenes', 0)} scenes"
    if held is not None and close is not None:
        words += (
            f"; in scenes held out {held:.1%} of the choices that promised an error held it, and {close:.1%} were "
            "within 1.3 times of the fastest"
        )
    lines.append(words + "; see docs/advise.md")
    return lines
