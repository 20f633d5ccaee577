# SPDX-License-Identifier: BSD-3-Clause
"""Figures and tables that are made from a report: of a small one, written by hand."""

import csv
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from reference.storage.exr import Image, read_exr, write_exr
from reports.figures import frame_speed as figure_frame_speed
from reports.figures import strip as figure_strip
from reports.figures.files import plot
from tests.helpers.reports import (
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
from tests.helpers.reports import truth as truth_of

_SIZE = (24, 32)  # height, width
_WRONG = {"sound": 1e-6, "march (steps=8)": 0.02}


def method(label, error, **changes):
    times = {stage: timing(12.5) for stage in ("frame", "surface", "airlight")}
    times |= {"light_moved": timing(20.0), "objects_moved": timing(25.0)}
    return entry(label, error=errors(error, relative_bias=-error), times=times) | changes


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    folder = tmp_path_factory.mktemp("report")
    truth = 0.5 + np.random.default_rng(3).random((*_SIZE, 3))
    write_exr(folder / "reference.exr", Image({"airlight": truth}))
    methods = []
    for name in ("reference.png", "reference-airlight.png"):
        (folder / name).write_bytes(b"a picture")
    for label, error in _WRONG.items():
        wrong = truth * (1 + error)
        wrong[2:6, 20:24] *= 1.5 if error > 1e-3 else 1.0
        write_exr(folder / f"{label[:5]}.exr", Image({"airlight": wrong}))
        methods.append(method(label, error, files={"exr": f"{label[:5]}.exr"}))
    methods += [engine("engine", 0.1), refused("refused_one", "no such media")]
    files = {"exr": "reference.exr", "picture": "reference.png", "airlight": "reference-airlight.png"}
    studied = scene("a_scene", methods, size=[32, 24], truth=truth_of(relative_bound=4e-11), files=files)
    data = report_of(
        [studied],
        created="2031-01-02 03:04:05 +0000",
        settings=settings(image=[32, 24], timed=[32, 24]),
        environment=environment(processor="a slide rule"),
    )
    checked(data)
    (folder / "report.json").write_text(json.dumps(data))
    return folder


def rows_of(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def drawn(module, folder):
    """Draw in one column, coarsely; return the bytes of PDF and PNG."""
    coarse = folder / "coarse.mplstyle"
    coarse.write_text("savefig.dpi: 50\n")
    plot(module, folder, column="single", extra=(str(coarse),))
    return [(folder / f"{module.NAME}{suffix}").read_bytes() for suffix in (".pdf", ".png")]


def test_frame_speed_keeps_medians_quartiles_and_errors(report, tmp_path):
    figure_frame_speed.compute(tmp_path, report=report)
    rows = rows_of(tmp_path / "frame-speed.csv")
    assert [row["label"] for row in rows] == list(_WRONG)  # neither the refused one nor the one without times
    shown = {name: float(rows[1][name]) for name in ("frame_ms", "frame_ms_low", "frame_ms_high", "relative_rmse")}
    assert shown == {"frame_ms": 12.5, "frame_ms_low": 11.25, "frame_ms_high": 15.0, "relative_rmse": 0.02}
    origin = json.loads((tmp_path / "frame-speed.json").read_text())
    assert origin["report"]["created"].startswith("2031-01-02")
    assert origin["environment"]["processor"] == "a slide rule"  # the machine that measured, not this one


@pytest.mark.claim("figures-repeat", tolerance="none: equal bytes")
def test_drawing_again_only_reads_and_gives_the_same_bytes_without_mitsuba(report, tmp_path):
    """In another process, by the command; and what is embedded are TrueType fonts, no date."""
    data, again = tmp_path / "data", tmp_path / "again"
    figure_frame_speed.compute(data, report=report)
    first = drawn(figure_frame_speed, data)
    options = ["--from", str(data), "-o", str(again), "--column", "single", "--style", str(data / "coarse.mplstyle")]
    program = (
        "import sys; from reports.commands.main import run\n"
        f"assert run(['figures', *{options!r}]) == 0\n"
        "assert not {'mitsuba', 'drjit'} & set(sys.modules), 'drawing started Mitsuba'\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True, cwd=Path(__file__).parents[3])
    assert [(again / f"frame-speed{suffix}").read_bytes() for suffix in (".pdf", ".png")] == first
    pdf, png = first
    assert pdf.startswith(b"%PDF")
    assert png.startswith(b"\x89PNG")
    assert b"/FontFile2" in pdf
    assert b"/Type3" not in pdf
    assert b"CreationDate" not in pdf


def test_the_strip_shows_where_methods_are_wrong(report, tmp_path):
    figure_strip.compute(tmp_path, report=report / "report.json")  # the file or its folder
    rows = rows_of(tmp_path / "strip.csv")
    assert [row["label"] for row in rows] == ["reference", *_WRONG]
    side = int(rows[0]["side"])
    corner = int(rows[0]["x0"]), int(rows[0]["y0"])
    assert (corner, side) == ((20, 2), 4)  # where one method is half as bright again
    assert abs(int(rows[0]["x1"]) - 20) >= side or abs(int(rows[0]["y1"]) - 2) >= side
    kept = read_exr(tmp_path / rows[1]["file"]).layers["airlight"]
    assert np.array_equal(kept, read_exr(report / "sound.exr").layers["airlight"])
    assert drawn(figure_strip, tmp_path)
