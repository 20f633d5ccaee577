# SPDX-License-Identifier: BSD-3-Clause
"""Claim: kernels, methods and studies are named by words, in every combination; each
mistake is refused by name.
"""

import re
import sys

import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.frame.image import render_frame
from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.kernels.stepping import quadrature
from airlight.realtime.methods.registry import FOG_METHODS
from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.study.configuration import (
    QUICK,
    STANDARD,
    Configuration,
    chosen_configurations,
    configuration,
    find_kernel,
    parse_settings,
    prepared,
    split_name,
)
from airlight.validation.study.study import parse_study, read_study
from tests.helpers.scenes import tiny_scene


def refused(text):
    return pytest.raises(InputError, match=re.escape(text))


def test_words_become_values_of_the_type_of_the_default():
    chosen = configuration("ray-march", None, {"steps": "17", "shadow": "map", "map": " 64 "})
    assert chosen == Configuration(
        "ray-march", None, (("steps", 17), ("shadow", "map"), ("map", 64))
    )
    assert configuration("ray-march", None, {"steps": np.int64(17)}).parameters == (("steps", 17),)


def test_every_method_has_a_standard_configuration():
    assert {standard.method for standard in STANDARD} == {*FOG_METHODS, "shadow-planes-2006"}
    assert {standard.method for standard in QUICK} == set(FOG_METHODS)
    assert set(QUICK) <= set(STANDARD)
    assert {standard.kernel for standard in STANDARD} - {None} <= set(KERNELS)


def test_chosen_methods_bring_their_standard_configurations():
    assert chosen_configurations(["unshadowed"]) == tuple(
        standard for standard in STANDARD if standard.method == "unshadowed"
    )
    # Those whose standard configurations say their light samples have their defaults
    # too, for scenes without any.
    for_extent = {Configuration("soft-shafts"), Configuration("froxel-fog")}
    assert set(chosen_configurations()) == set(STANDARD) | for_extent
    with refused("did you mean"):
        chosen_configurations(["unshadowed", "unshadwed"])


def test_settings_are_read():
    assert parse_settings(["steps=100", " shadow = map ", "a=b=c"]) == {
        "steps": "100",
        "shadow": "map",
        "a": "b=c",
    }
    with refused("--set: got points=3 and points=5, expected one of them"):
        parse_settings(["points=3", "pattern=ring", "points=5"])
    assert parse_settings(["points=3", " points = 3"]) == {"points": "3"}


def test_kernels_of_ones_own_come_through_the_same_door(variant):
    scene = read_scene(mi.load_dict(tiny_scene(ball=None)))
    own, built_in = (
        render_frame(prepared(scene, configuration("unshadowed", kernel)))
        for kernel in ("airlight.realtime.kernels.taylor:taylor", "taylor")
    )
    np.testing.assert_array_equal(own.airlight, built_in.airlight)


def test_method_of_ones_own_has_no_kernel_unless_it_takes_one(own_module):
    assert configuration(f"{own_module}:f") == Configuration(f"{own_module}:f")
    assert configuration(f"{own_module}:g") == Configuration(f"{own_module}:g", "exact")
    assert chosen_configurations([f"{own_module}:g"]) == (
        Configuration(f"{own_module}:g", "exact"),
    )
    with refused("calls no kernel"):
        configuration(f"{own_module}:f", "taylor")
    with refused("on got 'maybe', expected true or false"):
        configuration(f"{own_module}:f", None, {"on": "maybe"})
    with refused("has no 'h'"):
        configuration(f"{own_module}:h")


@pytest.fixture
def own_module(tmp_path):
    """The path of a file with two methods of one's own."""
    path = tmp_path / "own_configuration_for_tests.py"
    path.write_text(
        "def f(view, on=True):\n    return 1\n\n\ndef g(view, *, kernel):\n    return 1\n"
    )
    return path


def test_number_behind_a_name_sets_the_first_parameter():
    kernel = find_kernel("quadrature-24")
    assert kernel.function is quadrature
    assert kernel.parameters == {"nodes": 24}
    assert find_kernel("taylor-6").parameters == {"degree": 6}
    # The longest name of the registry wins: 'quadrature-theta-8' is no
    # 'quadrature' of size 'theta-8'.
    assert split_name("quadrature-theta-8") == (KERNELS["quadrature-theta"], 8)


@pytest.mark.parametrize(
    "name", ["fog_kernel:kernel", "fog_kernel.py:kernel", "{folder}/fog_kernel.py:kernel"]
)
def test_a_users_kernel_is_found_in_the_current_folder_and_says_where_it_fails(
    tmp_path, monkeypatch, name
):
    folder = tmp_path / "with: colon"
    folder.mkdir()
    (folder / "fog_kernel.py").write_text(
        "from beside_it import two\n\n\ndef kernel(x):\n    return two / x\n"
    )
    (folder / "beside_it.py").write_text("two = 2\n")
    monkeypatch.chdir(folder)
    for module in ("fog_kernel", "beside_it"):
        monkeypatch.delitem(sys.modules, module, raising=False)
    kernel = find_kernel(name.format(folder=folder))
    assert kernel(2.0) == 1.0
    with pytest.raises(InputError, match=r"^kernel .*fog_kernel\.py, line 5: ZeroDivisionError"):
        kernel(0.0)


NO_KERNELS = (
    "gone:function",
    "airlight.realtime.kernels:gone",
    "airlight.realtime.kernels.:x",
    ":x",
    "airlight.realtime.kernels:",
    "math:pi",
)
NO_NAMES = ("quadratur", "quadrature-", "quadrature-x", "quadrature-1.5", "-4", "", "quadrature--4")


@pytest.mark.parametrize("name", [*NO_KERNELS, *NO_NAMES])
def test_what_is_no_kernel_is_refused_by_name(name):
    with pytest.raises(
        InputError, match=f"^kernel.*{name}" if name in NO_KERNELS else "expected one of exact"
    ):
        find_kernel(name)


SCENES = {"scenes": ["sphere-spot", "windows"]}


def test_every_combination_is_a_cell():
    study = parse_study(
        SCENES
        | {
            "sizes": ["32x24", "16x12"],
            "methods": ["ray-march", "light-volumes", "shadow-planes"],
            "kernels": ["exact", "taylor"],
            "maps": [64, 128],
            "media": [{}, {"medium.sigma_t": 0.17}],
            "parameters": {"ray-march": {"steps": [4, 9], "shadow": ["ray", "map"]}},
        }
    )
    labels = {chosen.label for chosen in study.configurations}
    assert "ray-march (steps=4, shadow=ray)" in labels  # without a map, whose size it does not know
    assert {
        "light-volumes (taylor, map=128)",
        "shadow-planes (taylor)",
        "ray-march (steps=9, shadow=map, map=64)",
    } <= labels
    assert len(study.configurations) == 2 * (1 + 2) + 2 * 2 + 2
    images = list(study.images())
    assert len(images) == 2 * 2 * 2
    cells = [cell for image in images for cell in image]
    assert len(set(cells)) == len(cells) == study.scene_count * study.cells_by_scene
    assert all(len({cell.image for cell in image}) == 1 for image in images)
    assert {cell.medium for cell in cells} == {(), ("medium.sigma_t=0.17",)}


def test_a_scene_at_half_the_width_may_be_checked_by_one_estimator():
    one = {"margins": {"single-scatter": 0.01}, "samples": {"single-scatter": 8}}
    study = parse_study({"scenes": ["fence"], "half": ["fence"], "checks": one})
    assert study.of("fence").checks.samples == {"single-scatter": 8}


def test_a_file_with_its_own_scenes_and_random_ones(tmp_path):
    (tmp_path / "hall.xml").write_text("<scene/>")
    (tmp_path / "study.toml").write_text(
        'scenes = ["hall.xml", "random:7"]\n[random]\ncount = 2\nfirst = 3\n'
    )
    study = read_study(tmp_path / "study.toml")
    assert study.name == "study"
    assert list(study.scene_names()) == [
        str(tmp_path / "hall.xml"),
        "random:7",
        "random:3",
        "random:4",
    ]


@pytest.mark.claim("sweep-studies", tolerance="none")
@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"scenes": ["spere-spot"]}, "'spere-spot', expected .* did you mean 'sphere-spot'"),
        ({"half": ["fense"]}, "half: got 'fense', expected .* did you mean 'fence'"),
        ({"scenes": ["cumulus"]}, "cumulus scatters light many times"),
        ({"scenes": ["windows", "windows"]}, "scenes: 'windows' is there twice"),
        ({"sceens": ["windows"]}, "got sceens, expected one of .* did you mean 'scenes'"),
        ({"methods": ["unshadowed"], "kernels": ["exakt"]}, "exakt"),
        (
            {"methods": ["froxel-fog"], "kernels": ["exact"]},
            "kernels: none of the methods calls one",
        ),
        ({"methods": ["ray-march"], "parameters": {"ray-march": {"stepz": 3}}}, "stepz.*steps"),
        (
            {
                "methods": ["light-volumes"],
                "maps": [64],
                "parameters": {"light-volumes": {"map": 3}},
            },
            "give one of them",
        ),
        (
            {"media": [{"light.intensity": 3}]},
            "media: got 'light.intensity', expected medium.sigma_t",
        ),
        ({"timed": 3}, 'timed: it is of times = "alone", got times = "with"'),
        ({"scenes": ["random:1000000001"]}, "'random:1000000001', expected .* from 0 to 1e.09"),
        ({"random": {"count": 3, "first": 999_999_999}}, "3 scenes from random:999999999 on"),
        ({"flip": [True]}, "flip: got .True., expected true, false"),
        ({"flip": 1}, "flip: got 1, expected true, false"),
        ({"stability": 2_000_000}, "stability: got 2000000, expected .* to 1.04858e.06"),
        (
            {"checks": {"margins": {"singlescatter": 0.01}, "samples": {"singlescatter": 8}}},
            "got checks.margins.singlescatter, expected .* did you mean 'single-scatter'",
        ),
        ({"checks": {"margins": {"volpath": 0}}}, "margins.volpath: got 0, expected a number from"),
        ({"checks": {"multiple": [8, 4, 2]}}, "multiple: got .8, 4, 2., expected two"),
        ({"checks": {"multiple": [1, 4]}}, "multiple: got 1, expected a whole number from 2"),
        (
            {"half": ["fence"], "checks": {"samples": {"single-scatter": 128, "volpath": 128}}},
            "checks.samples.volpath: got 128, expected at most 64 beside `half`",
        ),
    ],
)
def test_mistakes_are_refused_by_name(data, message):
    with pytest.raises(InputError, match=message):
        parse_study(data)
