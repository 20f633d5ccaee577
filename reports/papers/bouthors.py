# SPDX-License-Identifier: BSD-3-Clause
"""Figures of Bouthors 2008 again as tables: what a slab decides, T by direction, images by order, frames, verdicts.

The data are `bouthors` of `airlight published --json`, see `validation.papers.bouthors` and the files beside it.
"""

from collections.abc import Mapping
from typing import Any

from reports.tables.table import Column, Measured, Row, Table, numbers, table, words

Data = Mapping[str, Any]


def bouthors_tables(data: Data) -> list[Table]:
    """Return the tables: of a slab, of its light by direction, of clouds beside the truth, of frames, and verdicts."""
    return [
        _shares(data),
        _azimuth(data),
        _reflectance(data),
        _transport(data),
        _gap_and_lobes(data),
        _results(data),
        *(_by_order(name, rows) for name, rows in data["by_order"].items()),
        _rates(data),
        _verdicts(data),
    ]


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


def _transport(data: Data) -> Table:
    columns = (
        *numbers(thickness="thickness [m]", depth="depth [m]"),
        *words(orders="orders"),
        *numbers(
            table_p95="tables, 95 %", fit_p50="22 functions, 50 %", fit_p95="95 %", how={"percent": True, "digits": 2}
        ),
        *numbers(photons_z="photons, rms of z"),
    )
    names = [column.key for column in columns]
    rows = [Row({name: curve[name] for name in names}) for curve in data["transport"]["curves"]]
    return table("Fig. 8: T by the angle of the view, the sun at 25 degrees, over the computation", columns, rows)


def _gap_and_lobes(data: Data) -> Table:
    columns = (
        *words(figure="figure", where="pixels"),
        *numbers("share", how={"percent": True}),
        *numbers(light="light over the truth's"),
    )
    gap, lobes = data["gap"], data["lobes"]
    rows = [
        Row({"figure": figure, "where": where, "share": share, "light": light})
        for figure, where, share, light in (
            ("11a", "shaded across a gap", gap["share"], gap["shaded"]),
            ("11a", "lit", 1 - gap["share"], gap["lit"]),
            ("11b", "with two collectors", lobes["share"], lobes["two"]),
            ("11b", "with one", 1 - lobes["share"], lobes["one"]),
        )
    ]
    return table("Fig. 11: ring and two-lobes by cloud-collectors beside light paths", columns, rows)


def _results(data: Data) -> Table:
    columns = (*words(scene="scene"), *numbers(light="light over the truth's", rmse="relative RMSE without noise"))
    rows = [Row({"scene": name, **values}) for name, values in data["results"].items()]
    return table("Fig. 12: cloud-collectors beside light paths, 80 x 60", columns, rows)


def _by_order(name: str, by_order: list[dict[str, Any]]) -> Table:
    shown = {"share": "share", "light": "light over the truth's", "rmse": "relative RMSE"}
    medium = {"full": "whole phase", "cut": "peak cut"}
    headings = {f"{kind}_{key}": f"{medium[kind]}, {words}" for kind in medium for key, words in shown.items()}
    columns = (*words(orders="orders"), *(Column(key, heading) for key, heading in headings.items()))
    rows = [
        Row({"orders": row["orders"]} | {f"{kind}_{key}": row[kind][key] for kind in medium for key in shown})
        for row in by_order
    ]
    return table(f"Orders of {name} in the sun alone, over those of light paths in the same medium", columns, rows)


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
    from validation.fidelity.bouthors import PUBLISHED_ROWS
    from validation.fidelity.row import judge

    judged = [judge(row, data) for row in PUBLISHED_ROWS]
    columns = (*words(item="where", claim="claim", verdict="verdict"), *numbers("measured", how={"digits": 3}))
    rows = [Row({name: row[name] for name in ("item", "claim", "verdict", "measured")}) for row in judged]
    return table("Which claims of Bouthors 2008 hold here", columns, rows)
