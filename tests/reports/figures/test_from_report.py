# SPDX-License-Identifier: BSD-3-Clause
"""Figures and tables that are made from a report: of a small one, written by hand."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image as Picture

from airlight.errors import InputError
from airlight.reference.storage.exr import Image, write_exr
from airlight.reports.data.records import load_report
from airlight.reports.figures import report as figures
from airlight.reports.plotting.pictures import error_map, exposure, tone_mapped
from tests.helpers.reports import (
    RUN,
    checked,
    engine,
    entry,
    environment,
    errors,
    refused,
    report_of,
    scene,
    settings,
    timing,
)
from tests.helpers.reports import reference as reference_of

_SIZE = (24, 32)  # height, width
_WRONG = {"sound": 1e-6, "march (steps=8)": 0.02}


def method(label, error, **changes):
    times = {stage: timing(12.5) for stage in ("frame", "surface", "airlight")}
    times |= {"light_moved": timing(20.0), "objects_moved": timing(25.0), "run": RUN}
    return entry(label, error=errors(error, relative_bias=-error), times=times) | changes


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    reference = 0.5 + np.random.default_rng(3).random((*_SIZE, 3))
    write_exr(folder / "reference.exr", Image({"airlight": reference}))
    methods = []
    for name in ("reference.png", "reference-airlight.png"):
        Picture.new("RGB", (32, 24)).save(folder / name)
    for label, error in _WRONG.items():
        wrong = reference * (1 + error)
        wrong[2:6, 20:24] *= 1.5 if error > 1e-3 else 1.0
        write_exr(folder / f"{label[:5]}.exr", Image({"airlight": wrong}))
        methods.append(method(label, error, files={"exr": f"{label[:5]}.exr"}))
    methods += [
        engine("engine", 0.1) | {"layer": "airlight"},
        refused("refused_one", "no such media"),
    ]
    files = {
        "exr": "reference.exr",
        "picture": "reference.png",
        "airlight": "reference-airlight.png",
    }
    studied = scene(
        "a_scene", methods, size=[32, 24], reference=reference_of(relative_error=4e-11), files=files
    )
    data = report_of(
        [studied],
        created="2031-01-02 03:04:05 +0000",
        settings=settings(sizes=[[32, 24]], measure={}),
        environment=environment(processor="a slide rule"),
    )
    checked(data)
    (folder / "report.json").write_text(json.dumps(data))
    return folder


@pytest.mark.slow
@pytest.mark.claim("figures-repeat", tolerance="none: equal bytes")
def test_drawing_again_only_reads_and_gives_the_same_bytes_without_mitsuba(report, tmp_path):
    """In another process, by the command; and what is embedded are TrueType fonts, no date."""
    program = (
        "import sys; from airlight.reports.commands.main import run\n"
        f"assert run(['report', '--from', {str(report)!r}, '-o', 'OUT', '--figures', 'single']) == "
        "0\n"
        "assert not {'mitsuba', 'drjit'} & set(sys.modules), 'drawing started Mitsuba'\n"
    )
    drawn = []
    for name in ("first", "again"):
        code = program.replace("OUT", str(tmp_path / name))
        subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(__file__).parents[3])
        drawn.append(
            {
                path.name: path.read_bytes()
                for path in (tmp_path / name).iterdir()
                if path.suffix == ".pdf"
            }
        )
    assert drawn[0] == drawn[1]
    assert set(drawn[0]) == {"frame-speed.pdf", "strip.pdf"}
    for pdf in drawn[0].values():
        assert pdf.startswith(b"%PDF")
        assert b"/Type3" not in pdf
        assert b"CreationDate" not in pdf
    assert "a\\_scene" in (tmp_path / "first" / "methods-table.tex").read_text()


def test_tables_and_charts_name_the_size_of_timed_frames(report):
    """Images of 32 x 24 pixels are compared, frames of 320 x 240 timed."""
    (studied,) = load_report(report)[0].scenes
    assert "frames timed at 320" in figures.latex_table([studied])
    assert "frames timed" not in figures.latex_table([replace(studied, timed=studied.size)])
    label = figures.draw_speed([studied], "single").axes[0].get_xlabel()
    assert label == "time of a frame of 320 x 240 [ms]"


def test_the_strip_shows_where_methods_are_wrong(report):
    data, place = load_report(report)
    _, methods, images = figures._strip(data, place, None, None)
    assert [entry.label for entry in methods] == list(_WRONG)
    first, other = figures.worst_squares(images, 4)
    assert first == (20, 2)  # where one method is half as bright again
    assert abs(other[0] - 20) >= 4 or abs(other[1] - 2) >= 4
    with pytest.raises(InputError, match="did you mean 'a_scene'"):
        figures._strip(data, place, "a_scen", None)
    with pytest.raises(InputError, match="got 'nothing'"):
        figures._strip(data, place, None, ["nothing"])


@pytest.mark.parametrize(("size", "insets"), [((1, 1), 1), ((5, 1), 2), ((4, 7), 1)])
def test_the_strip_of_a_tiny_image_has_the_insets_that_it_has_room_for(report, size, insets):
    data, place = load_report(report)
    _, (method, *_), _ = figures._strip(data, place, None, None)
    images = [np.full((*size, 3), value) for value in (1.0, 1.5)]
    side = min(4, *size)
    assert len(figures.worst_squares(images, side)) == insets
    figures.draw_strip("tiny", [method], images, "double")


def test_the_panels_of_the_strip_are_the_images_under_their_names(report):
    """Every picture and every error map against the data, in the order of the titles."""
    data, place = load_report(report)
    scene, methods, images = figures._strip(data, place, None, None)
    figure = figures.draw_strip(scene, methods, images, "double")
    titled = [axes for axes in figure.axes if axes.get_title() and axes.images]
    assert titled[0].get_title() == "reference\nairlight\na_scene"
    assert [axes.get_title().split("\n")[0] for axes in titled] == [
        "reference",
        *(m.label.split(" (")[0] for m in methods),
    ]
    factor = exposure(images[0])
    large = [
        axes.images[0].get_array()
        for axes in figure.axes
        if axes.images and axes.images[0].get_array().shape[:2] == _SIZE
    ]
    # The reference has a scale in place of an error map.
    pictures, errors = [large[0], *large[1::2]], large[2::2]
    for shown, image in zip(pictures, images, strict=True):
        np.testing.assert_array_equal(shown, tone_mapped(image, factor))
    for shown, image in zip(errors, images[1:], strict=True):
        np.testing.assert_array_equal(shown, error_map(images[0], image))
    assert not np.array_equal(errors[0], errors[1])
