# SPDX-License-Identifier: BSD-3-Clause
"""A shader on the command line: what it costs has its device, a fault has its line, and a
missing driver its status.
"""

import json

import pytest

from airlight.realtime.methods.shader.client import ShaderHost
from airlight.reports.commands import main as cli
from airlight.reports.machine import driver_check
from airlight.reports.machine.opengl import opengl_status, require_opengl
from airlight.reports.report.claims import own_fault
from tests.helpers.shaders import EXAMPLES, need_opengl

MARCHER = str(EXAMPLES / "marcher.glsl")


def test_a_frame_is_timed_on_the_device_that_drew_it(variant, capfd):
    need_opengl()
    assert (
        cli.run(["render", "omni-box", "--method", MARCHER, "--size", "8x6", "--timed", "--json"])
        == 0
    )
    said = json.loads(capfd.readouterr().out)["result"]
    assert said["times"]["frame"]["median_ms"] > 0
    assert "threads" not in said["device"]  # of Dr.Jit


def test_a_mistake_is_one_line_and_a_missing_driver_says_what_to_install(
    variant, tmp_path, capfd, monkeypatch
):
    need_opengl()
    shader = tmp_path / "fog.glsl"
    shader.write_text("vec3 airlight(Ray ray) {\n    return vec3(x);\n}\n")
    asked = ["render", "open-fog", "--method", str(shader), "--size", "8x6"]
    assert cli.run(asked) == 2
    found = capfd.readouterr().err
    assert (
        found
        == f"airlight: error: method {shader}: fog.glsl, line 2: `x' undeclared: return vec3(x);\n"
    )
    assert own_fault(str(shader), found.removeprefix("airlight: error: ")) is not None
    assert own_fault(str(shader), "the medium has bounds: fog.glsl renders") is None
    require_opengl.cache_clear()
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_DIRS", str(tmp_path))
    assert cli.run(asked) == 3
    assert "libegl1 libgl1 libgl1-mesa-dri" in capfd.readouterr().err


def test_a_driver_is_judged_when_it_is_first_met_and_a_wrong_one_is_refused(
    variant, own_cache, monkeypatch
):
    need_opengl()
    error, _ = driver_check.driver_error(ShaderHost("OpenGL"))
    assert error < 5e-6  # as measured on llvmpipe, with room for other versions of it
    assert f"{error:.1e}" in opengl_status().reason
    monkeypatch.setattr(
        driver_check, "driver_error", lambda host: pytest.fail("it was judged before")
    )
    assert opengl_status().works
    (next(iter(own_cache.glob("shader-driver*")))).unlink()
    monkeypatch.setattr(driver_check, "driver_error", lambda host: (4e-5, 848))
    assert (
        "errs by 4.0e-05 at most on certified integrals, more than 3e-05" in opengl_status().reason
    )
