# SPDX-License-Identifier: BSD-3-Clause
"""The examples of docs/own-method.md, taken from the page and run."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from reports.commands.main import run
from tests.helpers.scenes import bounded_medium, tiny_scene
from validation.configurations.methods import configuration

PAGE = Path(__file__).parents[3] / "docs" / "own-method.md"


@pytest.fixture
def fog(tmp_path):
    """The page's examples as files; the first one's path."""
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    for name, block in zip(("fog", "plain"), blocks, strict=True):
        (tmp_path / f"{name}.py").write_text(block, encoding="utf-8")
    return tmp_path / "fog.py"


@pytest.mark.claim("own-method")
def test_the_worked_example_is_measured_like_a_built_in_method(fog, variant):
    """Steps in the angle without shifts are `ray-march`; twice as many come closer to the truth."""
    import mitsuba as mi

    from realtime.scene.read_scene import read_scene
    from validation.estimates.quadrature import truth_image
    from validation.frames.benchmark import measure

    loaded = mi.load_dict(tiny_scene())
    scene, truth = read_scene(loaded), truth_image(loaded)

    def measured(method, **parameters):
        measurement = measure(scene, configuration(method, None, parameters), truth=truth, seconds=0.01)
        assert (measurement.refused, measurement.note) == (None, None)
        assert measurement.times.airlight.median_ms > 0
        return measurement

    own, built_in = measured(f"{fog}:interleaved", steps=16, jitter="no"), measured("ray-march", steps=16)
    # The same sum in another order, in float32.
    np.testing.assert_allclose(own.frame.airlight, built_in.frame.airlight, rtol=2e-5)
    shifted, finer = (measured(f"{fog}:interleaved", steps=steps).error.relative_rmse for steps in (16, 64))
    assert finer < 0.5 * shifted < 0.05


def test_the_worked_example_refuses_by_name_what_it_cannot_do(fog, variant):
    import mitsuba as mi

    from realtime.scene.read_scene import read_scene
    from validation.frames.benchmark import measure

    ball = bounded_medium({"type": "sphere", "center": [0.1, 0.1, 0.7], "radius": 0.41}, 0.8, (0.5, 0.5, 0.5))
    scene = tiny_scene(fog=None, ball=ball)
    scene["sensor"] = {key: entry for key, entry in scene["sensor"].items() if key != "medium"}
    measurement = measure(read_scene(mi.load_dict(scene)), configuration(f"{fog}:interleaved"), truth=None)
    refusal = "interleaved: wanted one medium without bounds, no soft spots and no lights with extent"
    assert measurement.refused == refusal


@pytest.mark.claim("own-method")
def test_the_worked_example_works_in_the_command(fog, capsys, monkeypatch):
    monkeypatch.chdir(fog.parent)
    for name in ("fog.py:interleaved", "fog:interleaved"):
        arguments = ["--method", name, "--set", "steps=8", "--size", "32x24", "--json"]
        assert run(["render", "open-fog", *arguments]) == 0
        assert json.loads(capsys.readouterr().out)["method"] == f"{name} (steps=8)"
    assert run(["render", "open-fog", "--method", "fog:interleaved", "--set", "jitter=perhaps"]) == 2
    assert "jitter got 'perhaps', wanted true or false" in capsys.readouterr().err
    assert run(["render", "open-fog", "--method", "fog:interleaved", "--set", "step=8"]) == 2
    assert "did you mean 'steps'?" in capsys.readouterr().err


@pytest.mark.claim("own-method")
def test_the_plain_example_returns_what_it_says(fog, variant):
    import mitsuba as mi

    from realtime.frame.renderer import render_frame
    from realtime.scene.read_scene import read_scene
    from validation.configurations.methods import prepared

    scene = read_scene(mi.load_dict(tiny_scene()))
    frame = render_frame(prepared(scene, configuration(f"{fog.parent / 'plain.py'}:uniform_fog")))
    wanted = 0.1 * (1 - np.exp(-0.31 * frame.distance[..., None])) * np.array([0.9, 0.8, 0.7])
    np.testing.assert_allclose(frame.airlight, wanted, rtol=1e-5)  # float32


def test_arrays_may_be_made_when_the_module_is_imported(tmp_path):
    """In a process of its own: here Mitsuba's variant is set before."""
    (tmp_path / "early.py").write_text(
        "import mitsuba as mi\nHALF = mi.Float(0.5)\n\n\ndef fog(view):\n    return HALF\n"
    )
    launcher = Path(__file__).parents[3] / "airlight.py"
    command = [
        sys.executable,
        str(launcher),
        "render",
        "open-fog",
        "--size",
        "16x12",
        "--method",
        "early:fog",
        "--json",
    ]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert (ran.returncode, ran.stderr) == (0, "")
    assert json.loads(ran.stdout)["method"] == "early:fog"
