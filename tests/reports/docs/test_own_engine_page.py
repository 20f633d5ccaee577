# SPDX-License-Identifier: BSD-3-Clause
"""Protects the examples of docs/own-engine.md: what they render from `airlight describe` alone is called right."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from reports.commands.main import run

EXAMPLES = Path(__file__).parents[3] / "docs" / "examples"
#: By renderer: its module, and the variable that names a Python that has it.
MODULES = {"cycles": ("bpy", "AIRLIGHT_CYCLES_PYTHON"), "luxcore": ("pyluxcore", "AIRLIGHT_LUXCORE_PYTHON")}


def interpreter(renderer):
    """Return the Python that an environment variable names, or this one if it has the module."""
    module, variable = MODULES[renderer]
    named = os.environ.get(variable)
    if named:
        return named
    if importlib.util.find_spec(module) is None:
        pytest.skip(f"no {module} here; {variable} can name a Python that has it")
    return sys.executable


def rendered(renderer, scene, folder, capsys, *options):
    """Render a scene by the script of the documentation, and return what `compare --json` prints without options."""
    described, gltf, image = (folder / f"{scene}.{ending}" for ending in ("json", "glb", "exr"))
    assert run(["describe", scene, "--size", "80x60", "--json", "--gltf", str(gltf)]) == 0
    described.write_text(capsys.readouterr().out)
    script = str(EXAMPLES / f"render_{renderer}.py")
    command = [interpreter(renderer), script, str(described), str(gltf), str(image), *options]
    done = subprocess.run(command, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    layer = ["--layer", "ViewLayer.Volume Direct"] if "--layers" in options else []
    assert run(["compare", "--scene", scene, str(image), *layer, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
@pytest.mark.claim("engine-renderers", "engine-pixels", "engine-verdict")
@pytest.mark.parametrize(
    ("renderer", "scene", "options"),
    [
        ("cycles", "open-fog", ["--samples", "128"]),
        ("cycles", "sphere-spot", ["--samples", "128"]),
        ("cycles", "sphere-spot", ["--samples", "128", "--layers"]),
        ("luxcore", "open-fog", ["--samples", "1024"]),
    ],
)
def test_what_the_examples_render_is_called_right(renderer, scene, options, variant, tmp_path, capsys):
    interpreter(renderer)
    compared = rendered(renderer, scene, tmp_path, capsys, *options)
    assert compared["verdict"]["right"], compared["verdict"]["reasons"]
    assert compared["hints"] == compared["failures"] == []
    assert compared["expected"] == ("airlight" if "--layers" in options else "total")
    assert abs(compared["factor"] - 1) < 0.005


@pytest.mark.claim("engine-renderers")
@pytest.mark.parametrize("renderer", MODULES)
def test_the_examples_are_python_and_named_by_the_page(renderer):
    """They run elsewhere: here they are only compiled, and the page names them."""
    script = EXAMPLES / f"render_{renderer}.py"
    compile(script.read_text(), str(script), "exec")
    assert f"examples/{script.name}" in (EXAMPLES.parent / "own-engine.md").read_text()
