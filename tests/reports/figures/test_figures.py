# SPDX-License-Identifier: BSD-3-Clause
import csv
import subprocess
import sys
from pathlib import Path

import pytest

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
