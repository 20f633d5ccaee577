# SPDX-License-Identifier: BSD-3-Clause
"""The adapter of Bevy brings its parts, without the module `pybevy`."""

import runpy
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np

ADAPTER = Path(__file__).resolve().parents[2] / "docs" / "adapters" / "bevy.py"


def test_a_lamp_that_is_off_is_brought_as_it_is():
    """Its colour is no quotient by its brightness."""
    adapter, bevy = runpy.run_path(str(ADAPTER)), MagicMock()
    fog = {"sigma_t": [0.1] * 3, "sigma_s": [0.08] * 3}
    lamp = {"kind": "point", "intensity": [0.0, 0.0, 0.0]}
    scene = adapter["Scene"]({"medium": fog}, np.eye(4), [(lamp, np.eye(4))], [])
    settings = adapter["SETTINGS"] | {"far": 10.0, "range": 40.0}
    adapter["spawn_lights"](bevy, scene, settings, MagicMock())
    assert bevy.PointLight.call_args.kwargs["intensity"] == 0
    assert bevy.color.call_args_list[0].args == ([0.0, 0.0, 0.0],)
