# SPDX-License-Identifier: BSD-3-Clause
"""A frame does not hang on how many threads draw it. Workers of a test run have one each:
this has a process apart.
"""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]

PROGRAM = """
from airlight.reports.machine.environment import activate
activate()
import drjit as dr
import numpy as np
import pytest
from airlight.realtime.frame.image import render_frame
from airlight.realtime.parameters import defaults
from airlight.realtime.methods.registry import METHODS
from airlight.realtime.scene.read_scene import read_scene
from tests.helpers.transport_formula import use_formula
from airlight.validation.study.configuration import configuration, prepared
from airlight.validation.scenes.loading import load_scene

# The tables of clouds take minutes to make, and are the same anyone who draws.
use_formula(pytest.MonkeyPatch())
# As many pixels as several blocks of work have, so that each of the threads gets some.
fog, clouds = (read_scene(load_scene(name, (128, 96)).scene) for name in ("sphere-spot", "cumulus"))
for method in METHODS.values():
    scene = clouds if method.renders_clouds else fog
    chosen = configuration(method.name, None, {"map": 128} if "map" in defaults(method) else {})
    frames = []
    for threads in (2, 1):
        dr.set_thread_count(threads)
        assert dr.thread_count() == threads
        frames.append(render_frame(prepared(scene, chosen)))
    two, one_thread = frames
    assert np.isfinite(two.airlight).all() and two.airlight.mean() > 0, method.name
    for layer in ("airlight", "surface", "distance"):
        np.testing.assert_array_equal(getattr(two, layer), getattr(one_thread, layer), f"{method.name}: {layer}")
print("the same")
"""


@pytest.mark.slow
def test_two_threads_draw_what_one_does():
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=ROOT, capture_output=True, text=True, timeout=600
    )
    assert done.stdout == "the same\n", done.stderr
