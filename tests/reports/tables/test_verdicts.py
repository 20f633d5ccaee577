# SPDX-License-Identifier: BSD-3-Clause
"""What tables decide: is a truth confirmed, what grew too steeply, what is wrong as published, which bar broke."""

import pytest
import typer

from reports.commands.stability import stability
from reports.tables.agreement import verdict
from reports.tables.kernels import kernel_tables
from reports.tables.scaling import cliffs, grown, scaling_tables
from tests.helpers.reports import agreement, growth_record
from validation.kernels.benchmark import KernelBench, KernelCost, Spread, speed_against_error
from validation.metrics.errors import plain


@pytest.mark.parametrize(
    ("equivalent", "interval", "finished", "good"),
    [
        (True, [-0.001, 0.003], True, True),
        (False, [-0.001, 0.03], True, False),
        (False, [-0.001, 0.03], False, None),  # not decided in time
        (False, [0.006, 0.03], False, False),  # outside as a whole
        (False, [None, None], False, False),
    ],
)
def test_a_truth_is_confirmed_refused_or_not_decided(equivalent, interval, finished, good):
    compared = agreement(equivalent, margin=0.005, finished=finished, relative_bias_ci=interval)
    assert verdict(compared) is good


def test_jumps_and_higher_powers_than_before_are_found():
    calm, jump = growth_record(), growth_record(cliff=True)
    assert len(cliffs([jump, calm])) == 1
    assert grown([calm], [growth_record(exponent=0.66)]) == []
    assert len(grown([calm], [growth_record(exponent=0.69)])) == 3  # one for each time
    assert grown([calm], [growth_record(exponent=0.1)]) == []  # that is better
    assert grown([calm], [growth_record(exponent=0.9, size=(160, 120))]) == []  # another image
    costs, exponents = scaling_tables([growth_record(works=(), refused="method x: no")])
    assert costs.rows[0].reason == "refused: method x: no"
    assert exponents.rows == ()


def test_the_cheapest_kernel_is_that_within_the_error():
    spread = Spread(7.5, 7.25, 8.0, 9)
    costs = (
        KernelCost("exact", "exact", None, "isotropic", 0.0, 480_000, spread, spread, 1e-7, 1e-6, 2e-5),
        KernelCost("uniform-8", "uniform", 8, "isotropic", 0.0, 0, spread, spread, 0.1, 0.5, 0.9),
        KernelCost("closed-form", "closed-form", None, "isotropic", 0.0, refused="not today"),
    )
    bench = plain(KernelBench(costs, speed_against_error(costs)))
    cost, largest, _ = kernel_tables(bench["costs"], bench["levels"])
    assert cost.rows[2].reason == "refused: not today"
    cheapest = {row.values["level"]: row.values["cheapest"] for row in largest.rows}
    assert (cheapest[1e-4], cheapest[1e-6]) == ("exact", "none")


@pytest.mark.claim("exact-keeps-its-bar")
def test_stability_fails_where_the_claim_is_broken(variant, monkeypatch, capsys):
    from realtime.kernels.registry import KERNELS

    stability(kernels="taylor", rays=64, json=False)
    assert "BROKEN" not in capsys.readouterr().out
    monkeypatch.setitem(KERNELS, "exact", KERNELS["taylor"])
    with pytest.raises(typer.Exit) as caught:
        stability(kernels="exact", rays=64, json=False)
    assert caught.value.exit_code == 1
    assert "BROKEN: exact, airlight_integral.csv: float32 maximum" in capsys.readouterr().out
