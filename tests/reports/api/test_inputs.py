# SPDX-License-Identifier: BSD-3-Clause
"""Arguments from Python mean what the words of a command mean, and what neither can
say is refused in one line.
"""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import airlight
from airlight.errors import InputError
from airlight.realtime.errors import NoDriverError
from airlight.reference.storage import exr
from airlight.reports.api.configurations import asked_configurations
from airlight.reports.api.inputs import (
    changes_of,
    configuration_of,
    kernel_name,
    one_error,
    output_files,
    pixels_of,
    telling,
)
from airlight.reports.machine.environment import MissingError
from airlight.validation.study.configuration import configuration
from tests.helpers.api import third


def test_changes_by_name_are_those_of_words():
    words = ["medium.sigma_t=0.1,0.2,0.3", "medium.albedo=0.5"]
    assert changes_of({"medium.sigma_t": (0.1, 0.2, 0.3), "medium.albedo": 0.5}) == changes_of(
        words
    )
    assert changes_of({"medium.sigma_t": [0.1, 0.2, 0.3]}) == changes_of(words[0])
    assert changes_of(()) == changes_of(None) == changes_of({}) == {}


def test_a_size_is_two_whole_numbers_or_words():
    assert (
        pixels_of("16x12") == pixels_of((16, 12)) == pixels_of(np.array([16.0, 12.0])) == (16, 12)
    )
    assert pixels_of(None) is None
    for wrong in [(16.5, 12), (16,), 16, ("wide", 12), (float("inf"), 12)]:
        with pytest.raises(
            airlight.InputError, match=r"^size: got .*, expected \(width, height\) in pixels"
        ):
            pixels_of(wrong)


def test_a_kernel_is_a_name_or_a_function_that_another_process_can_import():
    assert kernel_name("exact") == "exact"
    assert kernel_name(None) is None
    assert kernel_name(third) == "tests.helpers.api:third"
    for wrong in (lambda *rays: 0.0, 3):
        with pytest.raises(
            airlight.InputError, match=r"^kernel: got .*, expected a name or a function at the top"
        ):
            kernel_name(wrong)


def test_a_configuration_has_its_own_kernel_and_parameters(variant):
    chosen = configuration("shadow-planes", "taylor", {"points": 8})
    assert configuration_of(chosen, None, {}) is chosen
    assert configuration_of("shadow-planes", "taylor", {"points": 8}) == chosen
    with pytest.raises(
        airlight.InputError, match=r"its own kernel and parameters; leave out kernel, points$"
    ):
        configuration_of(chosen, "exact", {"points": 3})


def test_a_configuration_of_a_report_is_not_measured_without_its_settings(variant):
    march = configuration("ray-march", None, {"steps": 8})
    assert asked_configurations([march], (), {}) == ([march], True)
    for kernels, settings in ((["taylor"], {}), ((), {"steps": 4})):
        with pytest.raises(InputError, match="a configuration has its own kernel and parameters"):
            asked_configurations([march], kernels, settings)


def test_files_have_one_of_the_endings_and_none_is_no_file(tmp_path):
    assert output_files(None) == output_files(()) == []
    assert output_files(tmp_path / "a.EXR", ".exr (values)") == [tmp_path / "a.EXR"]
    with pytest.raises(
        airlight.InputError, match=r"expected a name that ends in \.exr \(values\) or \.png"
    ):
        output_files([tmp_path / "a.exr", tmp_path / "a.jpg"], ".exr (values)", ".png")


@pytest.mark.parametrize(
    ("raised", "seen", "words"),
    [
        (InputError("no light"), airlight.InputError, "^no light$"),
        (
            NoDriverError("EGL 1.4"),
            MissingError,
            r"^shaders need OpenGL 4\.3, and it does not start \(EGL 1\.4\)",
        ),
        (NoDriverError("no moderngl"), MissingError, "^shaders need the package moderngl"),
        (ZeroDivisionError("a fault"), ZeroDivisionError, "^a fault$"),
    ],
    ids=lambda value: type(value).__name__,
)
@pytest.mark.claim("input-errors")
def test_a_function_raises_our_exceptions_and_leaves_those_of_faults(raised, seen, words):
    @one_error
    def function():
        raise raised

    with pytest.raises(seen, match=words):
        function()


def test_progress_is_told_shown_or_left(capsys):
    told = []
    for progress in (lambda *given: told.append(given), None, False):
        with telling(progress, "frames") as tell:
            tell(0.5, "frame 1")
    assert told == [(0.5, "frame 1")]
    assert capsys.readouterr() == ("", "")
    with telling(True, "frames") as tell:
        tell(0.5, "frame 1")
    assert capsys.readouterr().out == ""  # a bar is on the error stream


def test_files_are_merged_for_a_scene_that_is_loaded_by_its_name(monkeypatch):
    made = {"airlight:scene": "open-fog", "airlight:estimator": "volpath"}
    image = exr.Image({"airlight": np.ones((3, 4, 3))}, None, made)
    monkeypatch.setattr(exr, "read_exr", lambda path: image)
    monkeypatch.setattr(
        "airlight.validation.estimates.merge.merged_references", lambda files: image
    )
    loaded = SimpleNamespace(name="open-fog")
    assert airlight.reference(loaded, merge="a.exr").scene == "open-fog"
    with pytest.raises(airlight.InputError, match="of the scene open-fog, got hall"):
        airlight.reference(SimpleNamespace(name="hall"), merge="a.exr")


OF_SCENE = {"reference": "open-fog", "test": np.ones((3, 4, 3))}


@pytest.mark.parametrize(
    ("function", "arguments", "words"),
    [
        (airlight.compare, OF_SCENE | {"fit": "sigma_t,,g"}, "none of them"),
        (
            airlight.compare,
            OF_SCENE | {"sequence": "f.json"},
            "save the images",
        ),
        (
            airlight.reference,
            {"scene": "open-fog", "estimator": "volpaht"},
            "did you mean 'volpath'",
        ),
        (
            airlight.reference,
            {"scene": object(), "cluster": "local:2"},
            "by its name or path; give that",
        ),
        (
            airlight.reference,
            {"scene": "a", "estimator": "volpath", "seconds": 3, "cluster": "local"},
            "is chance",
        ),
        (
            airlight.render,
            {"scene": "open-fog", "samples": 0},
            "samples: got 0, expected 1 or more",
        ),
        (airlight.render, {"scene": "open-fog", "frames": 0}, "frames: got 0, expected 1 or more"),
        (
            airlight.render,
            {"scene": "open-fog", "samples": 1.5},
            r"samples: got 1\.5, expected a whole number",
        ),
        (
            airlight.reference,
            {"scene": "open-fog", "estimator": "volpath", "seed": "3"},
            "seed: got '3', expected a whole number",
        ),
        (
            airlight.render,
            {"scene": "open-fog", "run": -1},
            "run: got -1, expected a whole number from 0",
        ),
        (airlight.render, {"scene": "open-fog", "frame": 2**31}, "frame: got 2147483648"),
        (
            airlight.render,
            {"scene": "open-fog", "animate": "light"},
            "animate: got no number of frames",
        ),
        (airlight.list, {"what": "scene"}, "did you mean 'scenes'"),
        (
            airlight.report,
            {"scenes": object()},
            "scenes: got object, expected the name or the path",
        ),
        (
            airlight.reference,
            {"scene": Path("no.xml"), "cluster": "nowhere"},
            "--cluster: got 'nowhere'",
        ),
    ],
)
@pytest.mark.claim("input-errors")
def test_what_only_python_can_ask_is_refused_too(variant, function, arguments, words):
    with pytest.raises(airlight.InputError, match=words) as raised:
        function(**arguments)
    assert "\n" not in str(raised.value)
