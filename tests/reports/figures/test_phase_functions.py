# SPDX-License-Identifier: BSD-3-Clause
"""The figure of phase functions: its data are the functions, and it draws."""

import csv

import numpy as np
import pytest

from analytic.phase import phase_from_words


def test_the_data_are_the_functions(tmp_path):
    from reports.figures import phase_functions
    from reports.figures.files import plot

    phase_functions.compute(tmp_path)
    with (tmp_path / "phase-functions.csv").open() as file:
        rows = list(csv.DictReader(file))
    angle = np.deg2rad([float(row["angle"]) for row in rows])
    for words in ("hg:0.99", "hg-draine"):
        expected = phase_from_words(words)(np.cos(angle))
        assert [float(row[words]) for row in rows] == pytest.approx(expected, rel=1e-4)
    # The bow of fog stands out of what is beside it.
    bow = {round(float(row["angle"]), 2): float(row["mie"]) for row in rows}
    assert bow[142.5] > 1.4 * bow[150.0]
    assert bow[142.5] > 1.4 * bow[130.0]
    plot(phase_functions, tmp_path, column="single")
    assert (tmp_path / "phase-functions.pdf").is_file()
