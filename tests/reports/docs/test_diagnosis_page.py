# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the table of planted faults is what runs of the command printed, and no right image is called wrong."""

import pytest

from reports.data.json_files import read_json
from reports.docs.diagnosis import RECORD, ROOT, current_page, redraw
from reports.tables.diagnosis import answers_sentence, answers_table
from reports.tables.drawing import text
from tests.helpers.aside import SCENES as ASIDE
from tests.helpers.aside import write_scenes
from validation.diagnosis.planted import PAIRS, PLANTED
from validation.scenes.registry import FOG_SCENES


@pytest.fixture(scope="module")
def rows():
    return read_json(ROOT / RECORD, "a run")["diagnosis"]


def test_the_page_is_made_of_its_run():
    """Run `python -m reports.docs.diagnosis` if this fails."""
    assert (ROOT / "docs/diagnosis.md").read_text(encoding="utf-8") == current_page()


@pytest.mark.claim("diagnosis-table")
def test_planted_faults_are_those_that_there_are_and_nearly_all_are_named(rows):
    assert {row["words"] for row in rows} <= {planted.words for planted in (*PLANTED, *PAIRS)}
    assert all(row["right"] for row in rows if row["planted"] == "right")
    assert {row["scene"] for row in rows} <= {*FOG_SCENES, *ASIDE}
    for scenes, fewest in ((FOG_SCENES, 200), (ASIDE, 80)):
        single = [
            row["right"] for row in rows if row["scene"] in scenes and row["planted"] != "right" and not row["pair"]
        ]
        assert len(single) > fewest
        assert sum(single) >= 0.95 * len(single)


def test_runs_are_joined_and_drawn(tmp_path, rows):
    (tmp_path / "docs/data").mkdir(parents=True)
    (tmp_path / "docs/diagnosis.md").write_text("a\n<!-- answers: begin -->\nold\n<!-- answers: end -->\nb\n")
    run = str(read_json(ROOT / RECORD, "a run") | {"diagnosis": rows[:3]}).replace("'", '"')
    (tmp_path / "run.json").write_text(run.replace("True", "true").replace("False", "false").replace("None", "null"))
    page = redraw(tmp_path, [tmp_path / "run.json"] * 2).read_text()
    assert "old" not in page
    assert page.startswith("a\n")
    assert len(read_json(tmp_path / RECORD, "a run")["diagnosis"]) == 6
    assert "Not run: `" in page  # the other scenes


def test_answers_are_counted():
    row = {"planted": "g", "words": "another g", "scene": "hall", "pair": False, "answer": "factor", "right": False}
    rows = [row, row | {"answer": "g", "right": True}, row | {"planted": "right", "right": True}]
    assert answers_sentence(rows) == "1 of 2 faults are named first (50 %); 1 of 1 right images are called right."
    both = row | {"pair": True, "planted": "g and flip", "answer": "g and flip", "right": True}
    assert answers_sentence([both]).endswith("of 1 pairs of faults both are named in 1.")
    assert "factor (hall)" in text(answers_table(rows))


def test_scenes_kept_aside_are_read(variant, tmp_path):
    from reference.scene.read import read_truth
    from validation.scenes.loading import load_scene

    truths = [read_truth(load_scene(str(path), (8, 6)).scene) for path in write_scenes(tmp_path)]
    assert [len(truth.lights) for truth in truths] == [2, 1, 0, 2]
    assert [len(truth.media) for truth in truths] == [0, 1, 2, 0]
