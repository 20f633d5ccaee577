# SPDX-License-Identifier: BSD-3-Clause
"""The tables of `airlight maps`: error and flicker against the size of the shadow map."""

from typing import TYPE_CHECKING

from reports.tables.table import Column, Table, number, table

if TYPE_CHECKING:
    from validation.frames.map_size import MapErrors, MapFlicker, Slope


def error_table(title: str, errors: "MapErrors") -> Table:
    """Return the errors by size of the map."""
    columns = (
        Column("map", "map"),
        Column("relative_rmse", "rel. RMSE", digits=2, share=True),
        Column("relative_bias", "rel. bias", digits=2, share=True),
        Column("p50", "p50", digits=2, share=True),
        Column("p99", "p99", digits=2, share=True),
        Column("max", "max", digits=2, share=True),
    )
    rows = [
        (size, one.relative_rmse, one.relative_bias, one.p50, one.p99, one.max)
        for size, one in zip(errors.sizes, errors.metrics, strict=True)
    ]
    return table(f"{title}: error", columns, rows)


def flicker_table(title: str, flicker: "MapFlicker") -> Table:
    """Return how much the image flickers by size of the map."""
    columns = (
        Column("map", "map"),
        Column("texels", "texels a frame", digits=2),
        Column("flicker", "flicker", digits=2, share=True),
        Column("relative_rmse", "rel. RMSE", digits=2, share=True),
    )
    rows = zip(flicker.sizes, flicker.texels, flicker.flicker, flicker.errors, strict=True)
    return table(f"{title}: flicker of a moving light", columns, rows)


def error_sentence(errors: "MapErrors") -> str:
    """Return by what law the errors fall."""
    return f"The relative RMSE {_trend(errors.slope)}."


def flicker_sentence(flicker: "MapFlicker") -> str:
    """Return by what law the flicker falls, and how much the truth itself changes."""
    return f"The flicker {_trend(flicker.slope)}; the truth itself changes by {number(flicker.truth_change, 2)}."


def _trend(slope: "Slope") -> str:
    """Return how errors change with the size of the map, as the predicate of a sentence."""
    from math import isnan

    if isnan(slope.order):
        return "follows no law: too few errors above 0"
    spread = "" if isnan(slope.standard_error) else f" +- {slope.standard_error:.1g}"
    if abs(slope.order) < 0.01:
        return "does not depend on the size"
    if slope.order < 0:
        return f"does not fall: it grows as size^{-slope.order:.2f}{spread}"
    return f"falls as size^-{slope.order:.2f}{spread}"
