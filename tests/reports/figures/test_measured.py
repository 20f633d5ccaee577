# SPDX-License-Identifier: BSD-3-Clause
"""Figures whose data are measured here: the data are what the studies say, and drawing them twice gives one result."""

import csv

import numpy as np
import pytest

from reports.figures import convergence as figure_convergence
from reports.figures import decomposition as figure_decomposition
from reports.figures import kernel_errors as figure_kernel_errors
from reports.figures import kernel_speed as figure_kernel_speed
from reports.figures import map_size as figure_map_size
from reports.figures import paper_images as figure_paper_images
from reports.figures import polynomials as figure_polynomials
from reports.figures import z_distribution as figure_z_distribution
from reports.figures.files import plot


def rows_of(path):
    with open(path, newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def drawn(module, folder):
    coarse = folder / "coarse.mplstyle"
    coarse.write_text("savefig.dpi: 50\n")
    plot(module, folder, extra=(str(coarse),))
    return [(folder / f"{module.NAME}{suffix}").read_bytes() for suffix in (".pdf", ".png")]


def test_kernel_errors_over_depth_and_angle(variant, tmp_path):
    figure_kernel_errors.compute(tmp_path, quick=True)
    rows = rows_of(tmp_path / "kernel-errors.csv")
    errors = {
        name: np.array([float(row["relative_error"]) for row in rows if row["kernel"] == name])
        for name in ("exact", "taylor")
    }
    assert len(errors["exact"]) == 24 * 18
    # float32 has 1.2e-7; the optical depth of 90 along the longest ray multiplies the rounding of the exponent.
    assert errors["exact"].max() < 2e-5
    assert np.median(errors["taylor"]) > 100 * errors["exact"].max()


def test_curves_meet_at_the_foot_and_leave_it(variant, tmp_path):
    """At theta = 0 all three are p(0); half a radian on, the derived polynomial is the closer one if isotropic."""
    figure_polynomials.compute(tmp_path, rays=256)
    rows = rows_of(tmp_path / "polynomials.csv")
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


@pytest.mark.slow
def test_curves_are_drawn(variant, tmp_path):
    figure_polynomials.compute(tmp_path, rays=256)
    assert drawn(figure_polynomials, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize(
    "module",
    [figure_decomposition, figure_map_size, figure_kernel_speed, figure_convergence, figure_paper_images],
    ids=lambda module: module.NAME,
)
def test_a_figure_is_measured_and_drawn_twice_to_the_same_bytes(variant, tmp_path, module):
    module.compute(tmp_path, quick=True)
    assert rows_of(tmp_path / f"{module.NAME}.csv")
    assert drawn(module, tmp_path) == drawn(module, tmp_path)


@pytest.mark.statistical
def test_z_follows_its_law(variant, tmp_path):
    """Counts in bins against Student's law: chi-square; the seeds are fixed, the level is 1 in 10 000."""
    from scipy.stats import chi2

    figure_z_distribution.compute(tmp_path, quick=True)
    rows = [row for row in rows_of(tmp_path / "z-distribution.csv") if row["estimator"] == "single-scatter"]
    count, expected = (np.array([float(row[name]) for row in rows]) for name in ("count", "expected"))
    assert count.sum() == pytest.approx(float(rows[0]["tested"]))
    assert expected.sum() == pytest.approx(float(rows[0]["tested"]), rel=1e-6)
    large = expected >= 5
    count, expected = (np.append(counts[large], counts[~large].sum()) for counts in (count, expected))
    assert np.sum((count - expected) ** 2 / expected) < chi2.isf(1e-4, len(count) - 1)
    assert drawn(figure_z_distribution, tmp_path) == drawn(figure_z_distribution, tmp_path)
