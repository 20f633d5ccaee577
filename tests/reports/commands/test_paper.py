# SPDX-License-Identifier: BSD-3-Clause
"""Claim: `airlight paper` measures each experiment once, prints verdicts, and
tables and JSON where asked.
"""

import json

import numpy as np
import pytest

from airlight.reports.commands import main as cli
from airlight.reports.figures.papers import PaperFigure
from airlight.reports.plotting.figure import new_figure
from airlight.validation.papers import claims as papers


@pytest.fixture
def experiments(own_cache, monkeypatch):
    """Experiments that give the same number for every figure; returns which were run."""
    ran = []

    def run(self):
        (name,) = (name for name, each in papers.experiments().items() if each is self)
        ran.append(name)
        names = [
            part
            for each in papers.claims()
            if each.experiment == name
            for part in each.figure.split(" / ")
        ]
        return dict.fromkeys(names, 1.0)

    monkeypatch.setattr(papers.Experiment, "run", run)
    return ran


def test_verdicts_tables_and_json(variant, experiments, capfd):
    assert cli.run(["paper", "bouthors"]) == 0
    out = capfd.readouterr().out
    assert "not reproduced" in out
    assert "numbers beside ours" in out
    needed = ["formulas", "cloud slab", "cloud transport", "clouds", "cloud frames"]
    assert experiments == needed
    assert cli.run(["paper", "bouthors", "--json"]) == 0
    assert experiments == needed  # the second time nothing is measured
    printed = json.loads(capfd.readouterr().out)["result"]
    rows = {row["item"]: row for row in printed["papers"]}
    assert (rows["eq. 1"]["verdict"], rows["eq. 5"]["verdict"]) == ("reproduced", "not reproduced")
    assert rows["9, stratocumulus of 130 000 triangles"]["verdict"] is None


def test_quick_leaves_out_what_needs_images(variant, experiments, capfd):
    assert cli.run(["paper", "--quick", "--json"]) == 0
    assert experiments == ["formulas", "stencil"]
    printed = json.loads(capfd.readouterr().out)["result"]
    assert printed["left_out"] > 100
    assert {row["verdict"] for row in printed["papers"] if row["paper"] == "ali"} == {"impossible"}


def test_figures_are_drawn_into_the_folder_with_their_data(
    variant, experiments, tmp_path, monkeypatch, capfd
):
    """The figure of the paper that is named, small where that is asked for;
    not those of other papers.
    """
    made = []

    def make(quick, progress):
        made.append(quick)
        images, rows = {"picture": np.ones((2, 3, 3))}, [{"depth": 1.5, "radiance": 0.25}]
        return PaperFigure(lambda column: new_figure(1, 1), images, rows)

    shown = {
        "slab": (("bouthors",), make),
        "others": (("biri",), lambda quick, progress: pytest.fail("of another")),
    }
    monkeypatch.setattr("airlight.reports.figures.papers._FIGURES", shown)
    folder = tmp_path / "figures"
    assert cli.run(["paper", "bouthors", "--quick", "--pictures", str(folder)]) == 0
    names = ["slab.pdf", "slab.png", "slab-picture.exr", "slab.csv"]
    assert capfd.readouterr().out.splitlines()[-4:] == [str(folder / name) for name in names]
    assert sorted(path.name for path in folder.iterdir()) == sorted(names)
    assert (folder / "slab.csv").read_text() == "depth,radiance\n1.5,0.25\n"
    assert made == [True]
