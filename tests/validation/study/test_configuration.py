# SPDX-License-Identifier: BSD-3-Clause
import re

import mitsuba as mi
import numpy as np
import pytest

from analytic.errors import InputError
from realtime.frame.renderer import render_frame
from realtime.kernels.registry import KERNELS
from realtime.methods.registry import FOG_METHODS
from realtime.scene.read_scene import read_scene
from tests.helpers.scenes import tiny_scene
from validation.study.configuration import (
    QUICK,
    STANDARD,
    Configuration,
    chosen_configurations,
    configuration,
    parse_settings,
    prepared,
)


def refused(text):
    return pytest.raises(InputError, match=re.escape(text))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (("raymarch",), "did you mean 'ray-march'?"),
        (("unshadowed", "quadratur"), "did you mean 'quadrature'?"),
        (("ray-march", "taylor"), "calls no kernel"),
        (("ray-march", None, {"step": 7}), "did you mean 'steps'?"),
    ],
)
def test_what_no_configuration_has_is_refused_by_name(given, words):
    with refused(words):
        configuration(*given)


def test_words_become_values_of_the_type_of_the_default():
    chosen = configuration("ray-march", None, {"steps": "17", "shadow": "map", "map": " 64 "})
    assert chosen == Configuration("ray-march", None, (("steps", 17), ("shadow", "map"), ("map", 64)))
    assert configuration("ray-march", None, {"steps": np.int64(17)}).parameters == (("steps", 17),)


def test_every_method_has_a_standard_configuration():
    assert {standard.method for standard in STANDARD} == set(FOG_METHODS)
    assert {standard.method for standard in QUICK} == set(FOG_METHODS)
    assert set(QUICK) <= set(STANDARD)
    assert {standard.kernel for standard in STANDARD} - {None} <= set(KERNELS)


def test_chosen_methods_bring_their_standard_configurations():
    assert chosen_configurations(["unshadowed"]) == tuple(
        standard for standard in STANDARD if standard.method == "unshadowed"
    )
    # Those whose standard configurations say their light points have their defaults too, for scenes without any.
    for_extent = {Configuration("soft-shafts"), Configuration("froxel-fog")}
    assert set(chosen_configurations(list(FOG_METHODS))) == set(STANDARD) | for_extent
    with refused("did you mean"):
        chosen_configurations(["unshadowed", "unshadwed"])


def test_settings_are_read():
    assert parse_settings(["steps=100", " shadow = map ", "a=b=c"]) == {"steps": "100", "shadow": "map", "a": "b=c"}
    assert parse_settings([]) == {}


def test_a_setting_given_twice_is_refused_unless_both_say_the_same():
    with refused("--set: got points=3 and points=5, wanted one of them"):
        parse_settings(["points=3", "pattern=grid", "points=5"])
    assert parse_settings(["points=3", " points = 3"]) == {"points": "3"}


def test_kernels_of_ones_own_come_through_the_same_door(variant):
    scene = read_scene(mi.load_dict(tiny_scene(ball=None)))
    own, built_in = (
        render_frame(prepared(scene, configuration("unshadowed", kernel)))
        for kernel in ("realtime.kernels.taylor:taylor", "taylor")
    )
    np.testing.assert_array_equal(own.airlight, built_in.airlight)


def test_method_of_ones_own_has_no_kernel_unless_it_takes_one(own_module):
    assert configuration(f"{own_module}:f") == Configuration(f"{own_module}:f")
    assert configuration(f"{own_module}:g") == Configuration(f"{own_module}:g", "exact")
    assert chosen_configurations([f"{own_module}:g"]) == (Configuration(f"{own_module}:g", "exact"),)
    with refused("calls no kernel"):
        configuration(f"{own_module}:f", "taylor")
    with refused("on got 'maybe', wanted true or false"):
        configuration(f"{own_module}:f", None, {"on": "maybe"})
    with refused("has no 'h'"):
        configuration(f"{own_module}:h")


@pytest.fixture
def own_module(tmp_path):
    """The path of a file with two methods of one's own."""
    path = tmp_path / "own_configuration_for_tests.py"
    path.write_text("def f(view, on=True):\n    return 1\n\n\ndef g(view, *, kernel):\n    return 1\n")
    return path
