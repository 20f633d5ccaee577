# SPDX-License-Identifier: BSD-3-Clause
"""Claim: `airlight study integrals` gives each row of a file its own value and says how wrong the values are."""

import csv

import numpy as np
import pytest

from analytic.cases import read_cases
from validation.kernels.cases import integrate_cases, summary, write_results

FILES = ("airlight_integral.csv", "airlight_integral_rays.csv")


def test_order_of_the_rows_does_not_matter(variant, data_folder, tmp_path):
    """Rows are evaluated by phase function and must go back to where they were."""
    lines = (data_folder / FILES[1]).read_text().splitlines()
    order = np.random.default_rng(5).permutation(len(lines) - 1)
    (tmp_path / "mixed.csv").write_text("\n".join([lines[0], *(lines[1 + k] for k in order)]) + "\n")
    straight = integrate_cases(read_cases(data_folder / FILES[1]), "quadrature", "double")
    mixed = integrate_cases(read_cases(tmp_path / "mixed.csv"), "quadrature", "double")
    np.testing.assert_array_equal(mixed, straight[order])


def table(tmp_path, text):
    path = tmp_path / "cases.csv"
    path.write_text(text)
    return path


SHORT = "phase,t,h,x0,x1,sigma_t,value\n" + "isotropic,1,2,0,inf,0.5,1.0\n" * 4


def test_summary_finds_the_worst_row_of_the_file(tmp_path):
    cases = read_cases(table(tmp_path, SHORT))
    counts = summary(cases, np.array([1.0, 1.1, 0.7, 1.2]))
    # Line 1 of the file is its header, so the third case is in line 4.
    assert (counts["rows"], counts["compared"], counts["nonfinite"], counts["worst_row"]) == (4, 4, 0, 4)
    assert counts["max"] == pytest.approx(0.3)
    assert counts["p50"] == pytest.approx(0.15)


def test_values_below_float32_are_compared_in_absolute_terms(tmp_path):
    cases = read_cases(table(tmp_path, "phase,t,h,x0,x1,sigma_t,value\nisotropic,1,2,0,inf,900,1e-60\n"))
    assert summary(cases, np.array([0.0]))["max"] < 1e-20


@pytest.mark.parametrize("name", FILES)
def test_written_rows_are_those_of_the_source_with_their_results(data_folder, tmp_path, name):
    source = data_folder / name
    cases = read_cases(source)
    results = np.random.default_rng(3).lognormal(size=len(cases.x0)) / 3
    write_results(cases, results, tmp_path / "out.csv")
    with open(source, newline="") as given, open(tmp_path / "out.csv", newline="") as written:
        before, after = list(csv.DictReader(given)), list(csv.DictReader(written))
    assert [row | {"result": repr(float(value))} for row, value in zip(before, results, strict=True)] == after
    assert list(after[0])[-1] == "result"
    np.testing.assert_array_equal([float(row["result"]) for row in after], results)
