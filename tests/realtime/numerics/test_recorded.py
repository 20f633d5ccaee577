# SPDX-License-Identifier: BSD-3-Clause
import gc
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from realtime.frame.renderer import frame_renderer, run_stages
from realtime.kernels.registry import KERNELS
from realtime.methods.registry import METHODS
from realtime.numerics.recorded import Frozen
from realtime.scene.animate import read_objects, turned_objects
from realtime.scene.read_scene import read_scene
from validation.scenes.loading import load_scene


@pytest.fixture
def collecting():
    assert gc.isenabled()
    yield
    assert gc.isenabled()


def test_nothing_is_collected_during_a_call(variant, collecting):
    """A scene that is freed while a frame is recorded ends the process."""
    seen = []

    def doubled(x):
        seen.append(gc.isenabled())
        return 2 * x

    function = Frozen(doubled)
    arguments = [dr.opaque(mi.Float, value, 5) for value in (1.0, 2.0, 3.0)]
    assert [float(function(argument)[0]) for argument in arguments] == [2, 4, 6]
    # What the function names of its surroundings is among its inputs: the list changes, and it is recorded anew.
    assert seen == [False] * function.n_recordings
    assert seen


def test_an_exception_whose_causes_form_a_circle_is_raised(variant):
    """Dr.Jit raises from an exception one whose context leads back to it: a refusal hung."""
    inner, outer = ValueError("inner"), RuntimeError("outer")
    inner.__context__, outer.__cause__ = outer, inner

    def refused(x):
        raise outer

    with pytest.raises(RuntimeError, match="outer"):
        Frozen(refused)(dr.opaque(mi.Float, 1.0, 5))


def test_a_frame_whose_objects_move_is_recorded_at_most_twice(variant):
    """Dr.Jit records anew where the memory of an array is aligned in another way, and NumPy's is by chance.

    The second recording is for vertices that are aligned, after Mitsuba's own, which need not be.
    """

    scene = read_scene(load_scene("two-pens", (16, 12)).scene)
    renderer = frame_renderer(scene, METHODS["unshadowed"], kernel=KERNELS["exact"].function)
    objects = read_objects(scene, ("pens", "flag"))
    for _ in range(8):
        moved = replace(renderer, scene=turned_objects(scene, objects, np.eye(3)))
        dr.eval(run_stages(moved, moved.prepare(moved.scene)))
    assert 1 <= renderer.stages.surface.n_recordings <= 2
    assert 1 <= renderer.stages.render.n_recordings <= 2
