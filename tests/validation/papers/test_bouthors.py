# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the verdicts on what a slab decides of Bouthors 2008 follow from what was measured."""

from copy import deepcopy

from realtime.clouds.slab_orders.phases import HenyeyGreensteinPhase
from realtime.clouds.slab_orders.slab import slab_light
from reports.papers.bouthors import bouthors_tables
from validation.fidelity.bouthors import FRAME_ROWS, SLAB_ROWS
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
    "azimuth": {"2": 9.0, "19-30": 1.2, "31-inf": 1.01},
    "reflectance": {
        name: {"droplets": 0.1, "printed": 1.26, "modified": 1.0, "half": 0.9, "matched": 1.001, "printed_g": 0.05}
        for name in ("50", "300", "1000")
    },
}


def test_verdicts_follow_from_the_numbers_and_turn_with_them():
    verdicts = {row.item: judge(row, DATA)["verdict"] for row in (*SLAB_ROWS, *FRAME_ROWS)}
    assert verdicts["9, stratocumulus"] == verdicts["9, cumulus"] == "reproduced"
    assert verdicts["9, cumulus-detail"] == "reproduced"
    for item in ("orders 31 and above, 100 m", "transmittance", "left, orders 19 to 30"):
        assert verdicts[f"Fig. 3, {item}"] == "reproduced"
    assert verdicts["Fig. 3, reflectance"] == verdicts["eq. 4, reflectance at 50 m"] == "refuted"
    assert verdicts["A, half the density, 50 m"] == "refuted"
    assert verdicts["A, matched density, 50 m"] == "reproduced"
    other = deepcopy(DATA)
    other["azimuth"] |= {"19-30": 1.0, "31-inf": 2.0}
    for row in other["shares"]:
        row |= {"reflected_31_inf": 0.2, "transmitted_1_30": 0.0, "reflected_1_30": 0.3}
    other["frames"]["stratocumulus"]["light_moved"] = {"median_ms": 120.0, "low_ms": 115.0, "high_ms": 130.0}
    turned = {row.item: judge(row, other)["verdict"] for row in (*SLAB_ROWS, *FRAME_ROWS)}
    assert turned["9, stratocumulus"] == "differs"
    assert turned["Fig. 3, reflectance"] == "reproduced"
    for item in ("orders 31 and above, 100 m", "transmittance", "left, orders 19 to 30", "left, orders 31 and above"):
        assert turned[f"Fig. 3, {item}"] == "refuted"


def test_the_tables_show_every_row():
    shares, azimuth, reflectance, rates, verdicts = bouthors_tables(DATA)
    assert (len(shares.rows), len(azimuth.rows), len(reflectance.rows), len(rates.rows)) == (8, 3, 3, 3)
    assert len(verdicts.rows) == len(SLAB_ROWS) + len(FRAME_ROWS)


def test_shares_and_reflectance_are_those_of_the_slab():
    phase, tau = HenyeyGreensteinPhase(0.7), 3.0
    light, _ = slab_light(tau, 1.0, phase, 1.0, sets=[(1, 30), (31, float("inf"))])
    shares = _shares(tau, 0.0, phase)
    assert abs(_reflectance(tau, phase) / light.reflectance - 1) < 1e-6
    assert abs(shares["transmittance"] / light.transmittance - 1) < 1e-6
    assert abs(shares["reflected_1_30"] * light.reflectance / light.sets[0].reflected.value - 1) < 1e-6
    assert abs(shares["reflected_1_30"] + shares["reflected_31_inf"] - 1) < 1e-9
