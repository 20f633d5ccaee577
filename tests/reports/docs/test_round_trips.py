# SPDX-License-Identifier: BSD-3-Clause
"""Protects the round trips of docs/diagnosis.md: faults that are set in Cycles are named, and none else."""

import json

import pytest

from reports.docs.round_trips import ROOT, current_page, page, render_faults
from tests.helpers.cycles import cycles_python
from validation.diagnosis.diagnose import diagnose_file

_SIZE = (80, 60)


@pytest.fixture(scope="module")
def images(tmp_path_factory):
    """Return a folder with images of a scene: a right one, and faults of medium, light, camera and values."""
    folder = tmp_path_factory.mktemp("cycles")
    names = ["right", "extinction-0.9", "near-0.1", "spot-half", "linear-falloff", "shift-1", "black-level", "agx"]
    render_faults(cycles_python(), "sphere-spot", folder, samples=256, size=_SIZE, faults=names)
    return folder


@pytest.mark.slow
@pytest.mark.claim("diagnosis-cycles")
@pytest.mark.parametrize(
    ("fault", "named"),
    [
        ("right", "right"),
        ("extinction-0.9", "extinction"),
        ("near-0.1", "near-plane"),
        ("spot-half", "spot-angle"),
        ("linear-falloff", "distance-law"),
        ("shift-1", "shift"),
        ("black-level", "black-level"),
        ("agx", "tone-map"),
    ],
)
def test_what_is_set_wrong_in_cycles_is_named(variant, images, fault, named):
    diagnosis = diagnose_file(images / f"{fault}.exr", "sphere-spot", pixel="area")
    assert diagnosis.first == named, [row.words for row in diagnosis.ranked]


@pytest.mark.claim("diagnosis-cycles")
def test_the_page_has_the_table_of_the_record():
    assert current_page() == (ROOT / "docs/diagnosis.md").read_text(encoding="utf-8")


def test_the_table_counts_faults_and_right_images():
    row = {"scene": "s", "words": "w", "says": "so", "together": [], "residual": 0.2, "left": 0.01}
    rows = [
        row | {"planted": "right", "first": "right", "right": True},
        row | {"planted": "g", "first": "g", "right": True},
        row | {"planted": "g", "first": "factor", "right": False, "together": ["factor", "flip"]},
    ]
    text = page(
        "before\n<!-- cycles: begin -->\nold<!-- cycles: end -->\nafter",
        {"measured": "2026-11-23", "blender": "5.0.1", "rows": rows},
    )
    assert text.startswith("before\n<!-- cycles: begin -->\n1 of 2 faults are named first; 1 of 1 right images")
    assert "| s | w | `g` | **`factor`** | so (with factor and flip) | 20 % | 1 % |" in text
    assert text.endswith("<!-- cycles: end -->\nafter")


def test_examples_compile():
    """They run elsewhere: here they are only compiled."""
    script = ROOT / "docs/examples/cycles_faults.py"
    compile(script.read_text(), str(script), "exec")
    record = json.loads((ROOT / "docs/data/cycles-faults.json").read_text(encoding="utf-8"))
    assert {row["planted"] for row in record["rows"]} >= {"right", "factor", "extinction"}
