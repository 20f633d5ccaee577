# SPDX-License-Identifier: BSD-3-Clause
"""The tables of a sweep, for its page, its digest and the terminal."""

import numpy as np

from airlight.reports.sweep.claims import TARGETS, property_words, written
from airlight.reports.sweep.faults import Check, Fault
from airlight.reports.sweep.samples import FAULTS, UNTOLD
from airlight.reports.sweep.summary import Summary
from airlight.reports.tables.table import (
    Column,
    Measured,
    Name,
    Table,
    numbers,
    table,
    table_of,
    words,
)


def errors_table(said: Summary) -> Table:
    """Return how wrong each configuration is, and in what fraction of the
    scenes it keeps an error.
    """
    columns = (
        *words(label="method"),
        *(
            Column(
                f"within_{target:g}",
                f"within {written(target)}",
                percent=True,
                spread="95 %",
                places=1,
            )
            for target in reversed(TARGETS)
        ),
        *numbers(
            median="median error", most="95 % of scenes below", how={"digits": 2, "fraction": True}
        ),
        *numbers(scenes="scenes", refused="refused", left_out="left out", untold="no reference"),
        Column("lost", "not done", alarm=True),
    )
    rows = []
    for sample in said.samples:
        values = sample.relative_rmse
        row = {
            "label": sample.label,
            "scenes": len(sample.scenes),
            "refused": sample.count("refused"),
            "untold": sample.count(UNTOLD),
            "left_out": sample.count("left out"),
            "lost": sample.count(*FAULTS),
            "median": values[0].value if values else None,
            "most": values[1].value if values else None,
        }
        # Fractions with their intervals; a configuration without a try has none.
        for claim in said.claims:
            if claim.label == sample.label and claim.fraction is not None:
                row[f"within_{claim.target:g}"] = Measured(claim.fraction, claim.low, claim.high)
        rows.append(row)
    explanation = (
        "Error: relative RMSE of the airlight. Each fraction has its interval at 95 % confidence. "
        "Scenes that are "
        "refused, left out for their time or have no reference are in no fraction; those that "
        "failed, hung or have pixels "
        "that are not finite "
        "are not within."
    )
    made = table(
        "In what fraction of the scenes each method is within an error",
        columns,
        rows,
        explanation=explanation,
    )
    # A column of zeros, or of the same count in every row, says nothing.
    counts = ("refused", "left_out", "untold", "lost")
    empty = {key for key in counts if not any(row[key] for row in rows)}
    empty |= {"scenes"} if len({row["scenes"] for row in rows}) == 1 else set()
    return made.only(*(column.key for column in columns if column.key not in empty))


def speed_table(said: Summary) -> Table:
    """Return the cost of each configuration, and in how many scenes it is the
    fastest within an error.
    """
    columns = (
        *words(label="method"),
        *numbers(timed="scenes timed"),
        Column("frame", "frame", "ms", spread="quartiles over scenes"),
        *(
            Column(
                f"fastest_{each.target:g}", f"fastest within {written(each.target)}", percent=True
            )
            for each in said.fastest
        ),
    )
    rows = []
    for sample in said.samples:
        # Quartiles over the scenes, not over the repetitions of a frame.
        known = sample.times[np.isfinite(sample.times)]
        row = {"label": sample.label, "timed": len(known)}
        if len(known):
            first, middle, third = np.quantile(known, (0.25, 0.5, 0.75)).tolist()
            row["frame"] = Measured(middle, first, third)
        row |= {
            f"fastest_{e.target:g}": e.counts[sample.label] / e.scenes if e.scenes else None
            for e in said.fastest
        }
        rows.append(row)
    none = ", ".join(f"{each.none} within {written(each.target)}" for each in said.fastest)
    explanation = (
        f"Of {said.fastest[0].scenes} scenes in which every image was timed with the machine to "
        "itself, its methods in "
        f"turns, in one run; scenes in which no method is within the error: {none}."
    )
    return table(
        "Times, and the fastest method within an error", columns, rows, explanation=explanation
    )


def correlations_table(said: Summary) -> Table:
    """Return the properties that go with the error of each configuration most."""
    columns = (
        *words(label="method", property="property"),
        Column("r", "correlation", sign=True, spread="interval", places=2),
    )
    rows = [
        vars(each)
        | {"property": property_words(each.property), "r": Measured(each.r, each.low, each.high)}
        for chosen in said.strongest.values()
        for each in chosen
    ]
    return table("Correlations with the error", columns, rows)


def refusals_table(said: Summary) -> Table:
    """Return why cells have no numbers, each reason once."""
    columns = (
        *words(status="outcome", how={"minor": True}),
        *words("reason", how={"long": True}),
        *words("methods", how={"minor": True}),
        *numbers("scenes", "cells"),
    )
    rows = []
    for each in said.reasons:
        # Three methods by name; the others are counted.
        shown = ", ".join(each.labels[:3]) + (
            f" and {len(each.labels) - 3} more" if each.labels[3:] else ""
        )
        rows.append(vars(each) | {"methods": shown})
    explanation = "In reasons N stands for a number, SCENE for a scene."
    return table("Refused and not done, by reason", columns, rows, explanation=explanation)


def checks_table(said: Summary) -> Table:
    """Return how many images were checked for each fault and how many have it."""
    how = {
        "faulty_rows": {"alarm": True},
        "faulty_scenes": {"alarm": True},
        "meaning": {"long": True, "minor": True},
    }
    # A check that no row passed through says nothing.
    shown = [each for each in said.checks if each.rows]
    return table_of("Images that were checked", Check, shown, how=how)


def faults_table(said: Summary, most: int = 30) -> Table:
    """Return the images that are wrong, the worst of each kind first."""
    rows = [vars(each) | {"command": Name(each.command)} for each in said.faults[:most]]
    left = len(said.faults) - most
    explanation = f"{left} more are in --json." if left > 0 else ""
    how = {"command": {"long": True, "minor": True}}
    return table_of("Images at fault", Fault, rows, explanation=explanation, how=how)
