# SPDX-License-Identifier: BSD-3-Clause
import csv

import pytest

from analytic.errors import InputError
from reports.command_figures import figures
from reports.figure_polynomials import THICKNESSES, compute, plot


@pytest.fixture(scope="module")
def folder(variant, tmp_path_factory):
    folder = tmp_path_factory.mktemp("figures")
    compute(folder, rays=256)
    plot(folder)
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


def test_plots_only_read_and_give_the_same_bytes(folder):
    first = {suffix: (folder / f"polynomials{suffix}").read_bytes() for suffix in (".pdf", ".png")}
    plot(folder)
    for suffix, content in first.items():
        assert (folder / f"polynomials{suffix}").read_bytes() == content
    assert first[".pdf"].startswith(b"%PDF")
    assert first[".png"].startswith(b"\x89PNG")


def test_unknown_figures_are_refused_with_the_nearest(tmp_path):
    with pytest.raises(InputError, match="did you mean 'polynomials'"):
        figures(["polynomial"], output=tmp_path)
