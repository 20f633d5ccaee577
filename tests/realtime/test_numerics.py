# SPDX-License-Identifier: BSD-3-Clause
"""Bounded functions keep the errors that their docstrings state; what is recorded is
recorded once, and ends well.
"""

import gc
import threading
from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.frame.renderer import frame_renderer, run_stages
from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.methods.registry import METHODS
from airlight.realtime.numerics.array_types import array_types
from airlight.realtime.numerics.functions import (
    WIDEST,
    exp2_bounded,
    exp_bounded,
    exp_expm1_bounded,
    sinh_bounded,
)
from airlight.realtime.numerics.recorded import Frozen
from airlight.realtime.scene.animate import read_objects, turned_objects
from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.scenes.loading import load_scene

WHOLE = np.append(
    np.linspace(-87, 88, 1_000_001), np.outer([-1, 1], np.geomspace(1e-30, 1, 10_000))
)


@pytest.mark.parametrize(
    ("function", "exact", "x"),
    [
        (exp_bounded, np.exp, np.linspace(-87, 88, 2_000_001)),
        (exp2_bounded, np.exp2, np.linspace(-125, 125, 1_000_001)),
        (
            sinh_bounded,
            np.sinh,
            np.append(np.linspace(-WIDEST, WIDEST, 100_000), np.geomspace(1e-30, 1, 1000)),
        ),
    ],
    ids=["exp", "exp2", "sinh"],
)
def test_relative_error_over_the_stated_range(variant, function, exact, x):
    x = x.astype(np.float32)
    value = np.array(function(mi.Float(x)), dtype=np.float64)
    # stated in the docstrings
    np.testing.assert_allclose(value, exact(x.astype(np.float64)), rtol=2e-7)


@pytest.mark.parametrize(("precision", "error"), [("single", 5e-7), ("double", 2e-15)])
def test_differences_of_exponentials_over_the_stated_range(variant, precision, error):
    x = WHOLE.astype(np.float32)
    power, less = np.array(exp_expm1_bounded(array_types(precision).scalar(x)), dtype=np.float64)
    np.testing.assert_allclose(less, np.expm1(x.astype(np.float64)), rtol=error)
    np.testing.assert_allclose(power, np.exp(x.astype(np.float64)), rtol=error)


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
    # Names that the function takes from its surroundings are inputs: the list changes,
    # and it is recorded again.
    assert seen == [False] * function.n_recordings
    assert seen


def test_nothing_is_collected_until_the_last_of_two_threads_is_done(variant, collecting):
    """The collector is one for all threads: the first to return must not
    switch it on under the second.
    """
    entered, ends, enabled = threading.Event(), threading.Event(), []

    def first(x):
        entered.set()
        assert ends.wait(30)

    def second(x):
        ends.set()
        thread.join()
        enabled.append(gc.isenabled())

    thread = threading.Thread(target=_call, args=(first,))
    thread.start()
    assert entered.wait(30)
    _call(second)
    assert enabled == [False]


def _call(function):
    """Call a function as `Frozen` does, without Dr.Jit, which has one recording at a time."""
    frozen = Frozen(function)
    frozen._recorded = function
    frozen(1)


@pytest.mark.parametrize("in_loop", [False, True])
def test_an_interrupt_in_a_recording_is_raised_after_it(variant, in_loop):
    """Dr.Jit answers an exception in a recording by aborting a later one:
    a notebook's kernel died.
    """
    interrupts = [KeyboardInterrupt()]

    def raised(x):
        if interrupts:
            raise interrupts.pop()
        return 2 * x

    def recorded(x):
        if not in_loop:
            return raised(x)
        return dr.while_loop(
            (mi.UInt32(0), x), lambda i, x: i < 1, lambda i, x: (i + 1, raised(x))
        )[1]

    function, argument = Frozen(recorded), dr.opaque(mi.Float, 1.0, 5)
    with pytest.raises(KeyboardInterrupt):
        function(argument)
    assert float(function(argument)[0]) == 2
    assert function.n_recordings == 1


def test_an_exception_whose_causes_form_a_circle_is_raised(variant):
    """Dr.Jit raises from an exception one whose context leads back to it: a refusal hung."""
    inner, outer = ValueError("inner"), RuntimeError("outer")
    inner.__context__, outer.__cause__ = outer, inner

    def refused(x):
        raise outer

    with pytest.raises(RuntimeError, match="outer"):
        Frozen(refused)(dr.opaque(mi.Float, 1.0, 5))


def test_a_frame_whose_objects_move_is_recorded_at_most_twice(variant):
    """Dr.Jit records again where the memory of an array is aligned in another way,
    and NumPy's is by chance.

    The second recording is for vertices that are aligned, after Mitsuba's own, which need not be.
    """

    scene = read_scene(load_scene("two-pens", (16, 12)).scene)
    renderer = frame_renderer(scene, METHODS["unshadowed"], kernel=KERNELS["exact"])
    objects = read_objects(scene, ("pens", "flag"))
    for _ in range(8):
        moved = replace(renderer, scene=turned_objects(scene, objects, np.eye(3)))
        dr.eval(run_stages(moved, moved.prepare(moved.scene)))
    assert 1 <= renderer.stages.surface.n_recordings <= 2
    assert 1 <= renderer.stages.render.n_recordings <= 2
