# SPDX-License-Identifier: BSD-3-Clause
import gc

import pytest


@pytest.fixture
def collecting():
    assert gc.isenabled()
    yield
    assert gc.isenabled()


def test_nothing_is_collected_during_a_call(variant, collecting):
    """A scene that is freed while a frame is recorded ends the process."""
    import drjit as dr
    import mitsuba as mi

    from realtime.frame.recorded import Frozen

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


def test_an_error_lets_the_collector_go_on(variant, collecting):
    import mitsuba as mi

    from realtime.frame.recorded import Frozen

    def refused(x):
        raise ValueError("no")

    with pytest.raises(RuntimeError):
        Frozen(refused)(mi.Float(1.0, 2.0))


def test_a_collector_that_was_off_stays_off(variant):
    import mitsuba as mi

    from realtime.frame.recorded import Frozen

    gc.disable()
    try:
        Frozen(lambda x: x + 1)(mi.Float(1.0, 2.0))
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_many_recordings_print_nothing(variant, collecting, capfd):
    """Of a scene with bounded media whose objects move Dr.Jit records every frame, and said so each time."""
    import mitsuba as mi

    from realtime.frame.recorded import Frozen

    function = Frozen(lambda x, number: x + number)
    for number in range(14):
        function(mi.Float([1.0, 2.0]), number)
    assert function.n_recordings == 14
    assert "recorded" not in "".join(capfd.readouterr())
