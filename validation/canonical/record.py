# SPDX-License-Identifier: BSD-3-Clause
"""Size, time and errors of the tables of the canonical transport by name, as the command prints them."""

import time
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from analytic.errors import InputError
from realtime.clouds.canonical.fit import fit_on_device, fit_tables
from realtime.clouds.canonical.look_up import on_device
from realtime.clouds.canonical.sets import set_name
from realtime.clouds.canonical.tables import RANKS, Grid, canonical_tables
from realtime.numerics.array_types import array_types
from validation.canonical.errors import TOGETHER, look_up_errors, looked_up_points, random_points
from validation.slab.phases import phase_pair

Progress = Callable[[float, str], None]

FIT_POINTS = 20_000


def canonical_record(
    phase: str,
    albedo: float,
    *,
    check: int = 0,
    fit: bool = False,
    seed: int = 0,
    grid: Grid | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Make the tables of a medium, or take them from the cache, and measure them.

    Parameters
    ----------
    phase
        As `airlight slab` takes it.
    albedo
        In (0, 1].
    check
        Random points at which the tables are compared with the computation.
    fit
        Whether the paper's 22 functions are fitted to the tables.
    seed
        Of the points.
    grid
        Entries of the tables.
    progress
        Called with (share done, what).

    Returns
    -------
    dict
        `phase`, `albedo`, `bytes`, `seconds` that the tables took to make, `kept`: whether they were in the cache,
        `grid`, `sets` with `orders`, `bytes` and `coefficients`; with points `check`, with the fit `fit`: `points`,
        `seconds` and errors by set, those of the tables against the computation, those of the fit against the tables.
    """
    tell = progress or (lambda share, what: None)
    if check < 0:
        raise InputError(f"--check: got {check}, wanted a number of points, for example 200")
    pair = phase_pair(phase)
    made = False

    def making(share: float, what: str) -> None:
        nonlocal made
        made = True
        tell(share * (0.5 if check or fit else 1.0), what)

    tables = canonical_tables(pair.deterministic, albedo, grid=grid, progress=making)
    sets = [
        {
            "orders": set_name(number),
            "bytes": int(products.nbytes + shapes.nbytes),
            "coefficients": sum(RANKS[number]),
        }
        for number, (products, shapes) in enumerate(zip(tables.coefficients, tables.shapes, strict=True))
    ]
    record: dict[str, Any] = {
        "phase": pair.name,
        "albedo": albedo,
        "bytes": int(tables.size),
        "seconds": tables.seconds,
        "kept": not made,
        "grid": asdict(tables.grid),
        "sets": sets,
    }
    types = array_types("single")
    look_up = on_device(tables, types)
    if check:
        began = time.perf_counter()
        points = random_points(
            pair.deterministic,
            albedo,
            check,
            seed=seed,
            progress=lambda share, what: tell(0.5 + (0.25 if fit else 0.5) * share, what),
        )
        rows = look_up_errors(look_up, types, points)
        slabs = -(-check // TOGETHER)
        record["check"] = {
            "points": check,
            "slabs": slabs,
            "seed": seed,
            "seconds": time.perf_counter() - began,
            "sets": rows,
        }
    if fit:
        began = time.perf_counter()
        fitted = fit_tables(look_up, types, progress=lambda share, what: tell(0.75 + 0.25 * share, what))
        points = looked_up_points(look_up, types, FIT_POINTS, seed=seed)
        rows = look_up_errors(fit_on_device(fitted, types), types, points)
        record["fit"] = {"points": FIT_POINTS, "seed": seed, "seconds": time.perf_counter() - began, "sets": rows}
    tell(1.0, "done")
    return record
