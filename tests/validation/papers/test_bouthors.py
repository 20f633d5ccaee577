# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the verdicts on what a slab decides of Bouthors 2008 follow from what was measured."""

from copy import deepcopy

from realtime.clouds.slab_orders.phases import HenyeyGreensteinPhase
from realtime.clouds.slab_orders.slab import slab_light
from reports.papers.bouthors import bouthors_tables
from validation.fidelity.bouthors import PUBLISHED_ROWS
from validation.fidelity.row import judge
from validation.papers.bouthors import _reflectance, _shares

DATA = {
    "shares": [
        {
            "thickness": thickness,
            "sun": sun,
            "reflectance": 0.5,
            "transmittance": 0.5,
            "reflected_1_30": 0.6,
            "reflected_31_inf": 0.001 if thickness < 200 else 0.4,
            "transmitted_1_30": 0.07,
            "transmitted_31_inf": 0.93,
        }
        for thickness in (50.0, 100.0, 300.0, 1000.0)
        for sun in (0.0, 75.0)
    ],
    "frames": {
        scene: {name: {"median_ms": 90.0, "low_ms": 88.0, "high_ms": 93.0} for name in ("frame", "light_moved")}
        for scene in ("stratocumulus", "cumulus", "cumulus-detail")
    },
    "transport": {
        "sun": 25.0,
        "angles": [2.5, 90.0],
        "curves": [
            {"thickness": 100.0, "depth": 0.0, "orders": "2", "table_p95": 0.01, "photons_z": 1.1}
            | {"fit_p50": 0.3, "fit_p95": 0.9},
            {"thickness": 100.0, "depth": 0.0, "orders": "31-inf"}
            | dict.fromkeys(("table_p95", "photons_z", "fit_p50", "fit_p95")),
        ],
    },
    "results": {"stratocumulus": {"light": 0.97, "rmse": 0.1}, "cumulus": {"light": 1.13, "rmse": 0.24}},
    "by_order": {
        name: [
            {"orders": orders} | {kind: {"share": 0.1, "light": 0.9, "rmse": 0.2} for kind in ("full", "cut")}
            for orders in ("2", "2-inf")
        ]
        for name in ("stratocumulus", "cumulus")
    },
    "gap": {"share": 0.4, "shaded": 0.8, "lit": 1.01, "lost": 0.02},
    "lobes": {"share": 0.1, "weaker": 0.7, "two": 0.9, "one": 1.0},
    "azimuth": {"2": 9.0, "19-30": 1.2, "31-inf": 1.01},
    "reflectance": {
        name: {"droplets": 0.1, "printed": 1.26, "modified": 1.0, "half": 0.9, "matched": 1.001, "printed_g": 0.05}
        for name in ("50", "300", "1000")
    },
}


def test_verdicts_follow_from_the_numbers_and_turn_with_them():
    verdicts = {row.item: judge(row, DATA)["verdict"] for row in PUBLISHED_ROWS}
    assert verdicts["9, stratocumulus"] == verdicts["9, cumulus"] == "reproduced"
    assert verdicts["9, cumulus-detail"] == "reproduced"
    for item in ("orders 31 and above, 100 m", "transmittance", "left, orders 19 to 30"):
        assert verdicts[f"Fig. 3, {item}"] == "reproduced"
    assert verdicts["Fig. 3, reflectance"] == verdicts["eq. 4, reflectance at 50 m"] == "refuted"
    assert verdicts["A, half the density, 50 m"] == "refuted"
    assert verdicts["A, matched density, 50 m"] == "reproduced"
    assert verdicts["Fig. 8"] == "refuted"
    for item in ("Fig. 11a", "Fig. 11a, importance", "Fig. 11b", "Fig. 12, stratocumulus"):
        assert verdicts[item] == "reproduced"
    assert verdicts["Fig. 12, cumulus"] == "differs"
    other = deepcopy(DATA)
    other["transport"]["curves"][0]["fit_p50"] = 0.05
    other["gap"] |= {"shaded": 1.1, "lost": 0.07}
    other["lobes"]["two"] = 1.2
    other["azimuth"] |= {"19-30": 1.0, "31-inf": 2.0}
    for row in other["shares"]:
        row |= {"reflected_31_inf": 0.2, "transmitted_1_30": 0.0, "reflected_1_30": 0.3}
    other["frames"]["stratocumulus"]["light_moved"] = {"median_ms": 120.0, "low_ms": 115.0, "high_ms": 130.0}
    turned = {row.item: judge(row, other)["verdict"] for row in PUBLISHED_ROWS}
    assert turned["9, stratocumulus"] == "differs"
    assert turned["Fig. 8"] == "reproduced"
    for item in ("Fig. 11a", "Fig. 11a, importance", "Fig. 11b"):
        assert turned[item] == "differs"
    assert turned["Fig. 3, reflectance"] == "reproduced"
    for item in ("orders 31 and above, 100 m", "transmittance", "left, orders 19 to 30", "left, orders 31 and above"):
        assert turned[f"Fig. 3, {item}"] == "refuted"


def test_the_tables_show_every_row():
    tables = bouthors_tables(DATA)
    assert [len(each.rows) for each in tables] == [8, 3, 3, 2, 4, 2, 2, 2, 3, len(PUBLISHED_ROWS)]


def test_shares_and_reflectance_are_those_of_the_slab():
    phase, tau = HenyeyGreensteinPhase(0.7), 3.0
    light, _ = slab_light(tau, 1.0, phase, 1.0, sets=[(1, 30), (31, float("inf"))])
    shares = _shares(tau, 0.0, phase)
    assert abs(_reflectance(tau, phase) / light.reflectance - 1) < 1e-6
    assert abs(shares["transmittance"] / light.transmittance - 1) < 1e-6
    assert abs(shares["reflected_1_30"] * light.reflectance / light.sets[0].reflected.value - 1) < 1e-6
    assert abs(shares["reflected_1_30"] + shares["reflected_31_inf"] - 1) < 1e-9
