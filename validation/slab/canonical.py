# SPDX-License-Identifier: BSD-3-Clause
"""The tables of the canonical transport of a phase function by name: their size, and how long they took."""

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from realtime.clouds.canonical.sets import set_name
from realtime.clouds.canonical.tables import RANKS, Grid, canonical_tables
from validation.slab.phases import phase_pair


def canonical_record(
    phase: str, albedo: float, *, grid: Grid | None = None, progress: Callable[[float, str], None] | None = None
) -> dict[str, Any]:
    """Make the tables of a medium, or take them from the cache.

    Returns
    -------
    dict
        `phase`, `albedo`, `bytes`, `seconds` that the tables took to make, `kept`: whether they were in the cache,
        `grid`, and `sets` with `orders`, `bytes` and `coefficients`.
    """
    pair = phase_pair(phase)
    made = False

    def making(share: float, what: str) -> None:
        nonlocal made
        made = True
        if progress is not None:
            progress(share, what)

    tables = canonical_tables(pair.deterministic, albedo, grid=grid, progress=making)
    sets = [
        {"orders": set_name(number), "bytes": int(products.nbytes + shapes.nbytes), "coefficients": sum(RANKS[number])}
        for number, (products, shapes) in enumerate(zip(tables.coefficients, tables.shapes, strict=True))
    ]
    return {
        "phase": pair.name,
        "albedo": albedo,
        "bytes": int(tables.size),
        "seconds": tables.seconds,
        "kept": not made,
        "grid": asdict(tables.grid),
        "sets": sets,
    }
