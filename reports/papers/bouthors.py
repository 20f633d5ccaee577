# SPDX-License-Identifier: BSD-3-Clause
"""What a slab decides of Bouthors 2008 again: Fig. 3, reflectances with what is printed, and which claims hold here.

The data are `bouthors` of `airlight published --json`, see `validation.papers.bouthors`.
"""

from collections.abc import Mapping
from typing import Any

from reports.tables.table import Measured, Row, Table, numbers, table, words

Data = Mapping[str, Any]


def bouthors_tables(data: Data) -> list[Table]:
    """Return the tables: shares by thickness, change with the azimuth, reflectances, rates, claims and verdicts."""
    return [_shares(data), _azimuth(data), _reflectance(data), _rates(data), _verdicts(data)]


def _shares(data: Data) -> Table:
    columns = numbers(
        thickness="thickness [m]",
        sun="sun [degrees]",
        reflectance="reflectance",
        reflected_1_30="of it orders 1-30",
        reflected_31_inf="31-inf",
        transmittance="transmittance",
        transmitted_1_30="of the scattered, orders 1-30",
        transmitted_31_inf="31-inf",
    )
    return table(
        "Fig. 3 of Bouthors 2008 again, right: droplets, r_e 6 um", columns, [Row(row) for row in data["shares"]]
    )


def _azimuth(data: Data) -> Table:
    columns = (*words(orders="orders"), *numbers(ratio="largest over least radiance by azimuth"))
    rows = [Row({"orders": name, "ratio": value}) for name, value in data["azimuth"].items()]
    return table("Fig. 3, left: 100 m deep in 1000 m, the sun at 75 degrees", columns, rows)


def _reflectance(data: Data) -> Table:
    columns = numbers(
        thickness="thickness [m]",
        droplets="reflectance",
        printed="printed extinction, over it",
        modified="peak cut, matched",
        half="peak cut, half",
        matched="HG, g matched",
        printed_g="HG, g 0.99",
    )
    rows = [Row({"thickness": float(name), **values}) for name, values in data["reflectance"].items()]
    return table("Reflectance with what is printed, the sun at the zenith", columns, rows)


def _rates(data: Data) -> Table:
    from validation.papers.bouthors_frames import PUBLISHED

    columns = (
        *words(scene="scene"),
        *numbers(published="published [1/s]", still="frame [ms]", moved="light moved [ms]"),
    )
    rows = []
    for rate in PUBLISHED:
        still, moved = (
            Measured(timing["median_ms"], timing["low_ms"], timing["high_ms"])
            for timing in (data["frames"][rate.scene][name] for name in ("frame", "light_moved"))
        )
        rows.append(Row({"scene": rate.scene, "published": rate.fps, "still": still, "moved": moved}))
    return table("Section 9: frames with the collectors of the last one, 800 x 600", columns, rows)


def _verdicts(data: Data) -> Table:
    from validation.fidelity.bouthors import FRAME_ROWS, SLAB_ROWS
    from validation.fidelity.row import judge

    judged = [judge(row, data) for row in (*SLAB_ROWS, *FRAME_ROWS)]
    columns = (*words(item="where", claim="claim", verdict="verdict"), *numbers("measured", how={"digits": 3}))
    rows = [Row({name: row[name] for name in ("item", "claim", "verdict", "measured")}) for row in judged]
    return table("Which claims of Bouthors 2008 hold here", columns, rows)
