# SPDX-License-Identifier: BSD-3-Clause
import csv
import subprocess
import sys
from pathlib import Path

import pytest

from reports.commands import figures as command_figures
from reports.commands.figures import FIGURES, figures
from reports.figures import polynomials
from reports.figures.files import plot
from reports.figures.polynomials import THICKNESSES, compute


@pytest.fixture(scope="module")
def folder(variant, tmp_path_factory):
    folder = tmp_path_factory.mktemp("figures")
    compute(folder, rays=256)
    plot(polynomials, folder, column="single")
    return folder


def read(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_curves_meet_at_the_foot_and_leave_it(folder):
    """At theta = 0 all three are p(0); half a radian on, the derived polynomial is the closer one if isotropic."""
    rows = read(folder / "polynomials.csv")
    assert len(rows) == 4 * len(THICKNESSES) * 301
    middle = [row for row in rows if float(row["theta"]) == 0]
    assert len(middle) == 12
    for row in middle:
        for name in ("taylor", "taylor-printed"):
            assert float(row[name]) == pytest.approx(float(row["exact"]), rel=1e-7)  # nine digits are written
    aside = next(
        r for r in rows if (r["phase"], r["a"]) == ("isotropic", "0.5") and abs(float(r["theta"]) - 0.5) < 1e-9
    )
    exact = float(aside["exact"])
    assert abs(float(aside["taylor"]) - exact) < 0.2 * abs(float(aside["taylor-printed"]) - exact)


def test_shares_are_counted(folder):
    rows = read(folder / "polynomials-shares.csv")
    assert {row["kernel"] for row in rows} == {"exact", "taylor", "taylor-printed"}
    assert all(float(row["within_1_percent"]) == 1 for row in rows if row["kernel"] == "exact")
    assert any(float(row["within_1_percent"]) < 0.5 for row in rows if row["kernel"] == "taylor-printed")


@pytest.mark.claim("figures-repeat", tolerance="none: equal bytes")
def test_drawing_again_only_reads_and_gives_the_same_bytes_without_mitsuba(folder, tmp_path):
    """In another process, by the command; and what is embedded are TrueType fonts, no date."""
    program = (
        "import sys; from reports.commands.main import run\n"
        f"assert run(['figures', '--from', {str(folder)!r}, '-o', {str(tmp_path)!r}, '--column', 'single']) == 0\n"
        "assert not {'mitsuba', 'drjit'} & set(sys.modules), 'drawing started Mitsuba'\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True, cwd=Path(__file__).parents[3])
    for suffix, start in ((".pdf", b"%PDF"), (".png", b"\x89PNG")):
        content = (tmp_path / f"polynomials{suffix}").read_bytes()
        assert content == (folder / f"polynomials{suffix}").read_bytes()
        assert content.startswith(start)
    pdf = (tmp_path / "polynomials.pdf").read_bytes()
    assert b"/FontFile2" in pdf
    assert b"/Type3" not in pdf
    assert b"CreationDate" not in pdf
    assert sorted(path.suffix for path in tmp_path.iterdir()) == [".pdf", ".png"]


def test_every_figure_has_a_module_with_its_name_and_summary():
    modules = {path.stem for path in (Path(__file__).parents[3] / "reports" / "figures").glob("*.py")}
    helpers = {"__init__", "files", "report", "picture_grid"}
    assert {module for module, _ in FIGURES.values()} == modules - helpers
    for name in FIGURES:
        module = command_figures._module(name)
        assert name == module.NAME
        assert module.SUMMARY
        assert callable(module.compute)
        drawn = [getattr(module, part, None) for part in ("draw", "tabular")]
        assert any(map(callable, drawn))


@pytest.mark.claim("scenes-stand-first")
def test_a_scene_behind_the_figures_is_that_of_the_strip(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr("reports.commands.figures._compute", lambda name, folder, given: asked.append((name, given)))
    monkeypatch.setattr("reports.commands.figures.plot", lambda *arguments, **options: None, raising=False)
    monkeypatch.setattr("reports.figures.files.plot", lambda *arguments, **options: None)
    monkeypatch.setattr("reports.commands.figures._print_files", lambda *arguments: None)
    monkeypatch.setattr("reports.commands.figures._report_folder", lambda path: tmp_path)
    monkeypatch.setattr("reports.data.reader.read_report", lambda path: {"scenes": [{"name": "mine"}]})
    for scene in ("hall", "mine"):
        figures(["strip", scene], output=tmp_path)
    assert [(name, given["scene"]) for name, given in asked] == [("strip", "hall"), ("strip", "mine")]
