# SPDX-License-Identifier: BSD-3-Clause
"""The tables of `airlight maps`: error and flicker against the size of the shadow map."""

import math
from typing import TYPE_CHECKING

from reports.tables.table import Table, number, numbers, table

if TYPE_CHECKING:
    from validation.study.maps import MapErrors, MapFlicker, Slope

_SHARES = {"digits": 2, "share": True}


def error_table(title: str, errors: "MapErrors") -> Table:
    """Return the errors by size of the map."""
    shares = numbers(relative_rmse="rel. RMSE", relative_bias="rel. bias", p50="", p99="", max="", how=_SHARES)
    rows = ({"map": size, **vars(metrics)} for size, metrics in zip(errors.sizes, errors.metrics, strict=True))
    return table(f"{title}: error", (*numbers("map"), *shares), rows)


def flicker_table(title: str, flicker: "MapFlicker") -> Table:
    """Return how much the image flickers by size of the map."""
    texels = numbers(texels="texels a frame", how={"digits": 2})
    columns = (*numbers("map"), *texels, *numbers("flicker", relative_rmse="rel. RMSE", how=_SHARES))
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
    if math.isnan(slope.order):
        return "follows no law: too few errors above 0"
    spread = "" if math.isnan(slope.standard_error) else f" +- {slope.standard_error:.1g}"
    if abs(slope.order) < 0.01:
        return "does not depend on the size"
    if slope.order < 0:
        return f"does not fall: it grows as size^{-slope.order:.2f}{spread}"
    return f"falls as size^-{slope.order:.2f}{spread}"
