# SPDX-License-Identifier: BSD-3-Clause
"""Configurations that are a paper as it was published, with what is wrong in it: peers of a table, not failures."""

from collections.abc import Mapping
from typing import Any

#: By kernel, the paper and what it leaves wrong.
_KERNELS = {
    "taylor": "Biri 2006: its polynomial, wrong away from the foot point",
    "taylor-printed": "Biri 2006: its polynomial with the printed coefficients",
}
#: By parameter and value.
_VALUES = {
    ("order", "paper"): "Biri 2006: its stencil rule, wrong where shadows overlap",
    ("order", "none"): "Biri 2006 without its stencil: overlapping shadows count twice",
    ("media", "paper"): "Biri 2006: its constant R in bounded media",
    ("media", "printed"): "Biri 2006: its formula of bounded media as printed",
}


def published_as(entry: Mapping[str, Any]) -> str:
    """Return which paper a method of report.json reproduces with its errors, and what is wrong; else nothing."""
    values = (_VALUES.get((name, value), "") for name, value in entry.get("parameters", {}).items())
    return next(filter(None, values), "") or _KERNELS.get(entry.get("kernel") or "", "")
