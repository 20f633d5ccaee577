# SPDX-License-Identifier: BSD-3-Clause
"""`airlight export`: the text is printed or written whole; its head says how exact it is."""

import json
import re

import pytest

import airlight
from airlight.reports.api.export import MEASURED
from airlight.reports.commands.main import run


@pytest.mark.claim("exported-kernels")
def test_the_text_that_is_printed_is_the_file_that_is_written(tmp_path, capsys):
    asked = ["export", "exact", "--phase", "hg", "--language", "hlsl", "--test"]
    assert run(asked) == 0
    printed = capsys.readouterr().out
    target = tmp_path / "airlight.hlsl"
    assert run([*asked, "-o", str(target)]) == 0
    assert capsys.readouterr().out == f"wrote {target}\n"
    assert target.read_text() == printed
    assert "airlight export exact --language hlsl --phase hg)" in printed
    assert len(re.findall(r"worst = max\(worst, abs\(al_integral", printed)) == 8
    assert run(["export", "exact", "--phase", "hg", "--language", "hlsl"]) == 0
    assert "al_test()" not in capsys.readouterr().out


@pytest.mark.claim("exported-kernels")
def test_the_head_states_the_error_that_was_measured_and_none_where_none_was(capsys):
    errors = json.loads(MEASURED.read_text(encoding="utf-8"))["errors"]
    exact = airlight.export("exact", phase="rayleigh")
    assert exact.error == errors["exact"]["rayleigh"]["error"]
    assert (
        f"Largest relative error of J: {exact.error:.1e} on {errors['exact']['rayleigh']['rays']} "
        in exact.code
    )
    assert "that keeps the bounds of Vulkan at most" in exact.code
    nodes = airlight.export("quadrature-16", phase="rayleigh")
    assert f"{nodes.error:.1e}" in nodes.code
    assert "Vulkan" not in nodes.code  # that was simulated for `exact` alone
    other = airlight.export("quadrature-6", phase="rayleigh")
    assert other.error is None
    assert "not measured for this kernel and phase function; see al_test" in other.code
    assert repr(other) == "Exported(quadrature-6, rayleigh, glsl)"


@pytest.mark.parametrize("phase", ["hg:0.5", "mie:6", "tabulated"])
def test_a_phase_function_that_is_no_function_of_g_is_refused(phase, capsys):
    assert run(["export", "--phase", phase]) == 2
    assert (
        f"phase: got {phase!r}, expected isotropic, rayleigh, hazy, murky, hg"
        in capsys.readouterr().err
    )
