# SPDX-License-Identifier: BSD-3-Clause
import json

import pytest
import typer

from reports.commands.stability import stability as command
from reports.tables.drawing import text
from reports.tables.kernels import kernel_tables
from reports.tables.stability import in_epsilons
from validation.kernels.benchmark import KernelBench, KernelCost, Spread, speed_against_error
from validation.kernels.errors import Errors
from validation.metrics.errors import plain

SPREAD = Spread(7.5, 7.25, 8.0, 9)
ERRORS = Errors(3, 0, 2.0**-23, 1e-6, 2.0**-20, 2.0**-22, 0, 0, 0, None)


def test_errors_are_printed_in_the_manner_of_boost():
    assert in_epsilons(plain(ERRORS), "single") == "Max = 8ε (Mean = 2ε)"
    assert in_epsilons(plain(Errors(0, 3, None, None, None, None, 0, 0, 0, None)), "double") == "-"


def test_costs_and_levels_are_printed():
    costs = (
        KernelCost("exact", "exact", None, "isotropic", 0.0, 480_000, SPREAD, SPREAD, 1e-7, 1e-6, 2e-5),
        KernelCost("uniform-8", "uniform", 8, "isotropic", 0.0, 0, SPREAD, SPREAD, 0.1, 0.5, 0.9),
        KernelCost("closed-form", "closed-form", None, "isotropic", 0.0, refused="not today"),
    )
    bench = plain(KernelBench(costs, speed_against_error(costs)))
    printed = "".join(text(table) for table in kernel_tables(bench["costs"], bench["levels"]))
    assert "closed-form: refused: not today" in printed
    exact, uniform = (next(line for line in printed.splitlines() if name in line) for name in ("exact", "uniform-8"))
    assert exact.split()[:3] == ["exact", "7.5", "7.25..8"]
    assert uniform.split()[1] == "~7.5"
    cheapest = [line.split() for line in printed.splitlines() if line.strip().startswith(("0.0001 ", "1e-06 "))]
    assert [line[:2] for line in cheapest] == [
        ["0.0001", "exact"],
        ["1e-06", "none"],
        ["0.0001", "exact"],
        ["1e-06", "exact"],
    ]


def test_command_prints_rays_that_can_be_run_again(variant, capsys):
    command(kernels="taylor-1", rays=64, json=False)
    printed = capsys.readouterr().out
    assert "=== taylor-1 ===" in printed
    assert "refuses tabulated: kernel taylor" in printed
    assert "tag,phase,g,t,h,x0,x1,sigma_t,value" in printed.splitlines()
    assert "BROKEN" not in printed


def test_command_prints_json_with_the_bar(variant, capsys):
    command(kernels="taylor-1", rays=64, json=True)
    data = json.loads(capsys.readouterr().out)
    assert data["bar"]["single_max"] == 3e-5
    assert [kernel["kernel"] for kernel in data["kernels"]] == ["taylor-1"]
    assert [rays["name"] for rays in data["kernels"][0]["sets"]] == [*data["certified"], "generated"]


@pytest.mark.claim("exact-keeps-its-bar")
def test_command_fails_where_the_claim_is_broken(variant, monkeypatch, capsys):
    from realtime.kernels.registry import KERNELS

    monkeypatch.setitem(KERNELS, "exact", KERNELS["taylor"])
    with pytest.raises(typer.Exit) as caught:
        command(kernels="exact", rays=64, json=False)
    assert caught.value.exit_code == 1
    assert "BROKEN: exact, airlight_integral.csv: float32 maximum" in capsys.readouterr().out


def test_numbers_of_a_study_fit_json():
    text = json.dumps(plain(Errors(1, 0, float("nan"), float("inf"), 1.0, 1.0, 0, 0, 0, None)), allow_nan=False)
    assert [value for value in json.loads(text).values() if value is None]
