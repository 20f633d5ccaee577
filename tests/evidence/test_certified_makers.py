# SPDX-License-Identifier: BSD-3-Clause
"""Claim: every certified CSV file has a maker, which gives its digits again from its inputs."""

import shutil

import pytest

from tests.evidence.certified.airlight_integral import read
from tests.evidence.certified.write import MAKERS, write

#: Rows that the default tier makes again: of each kind some, which are quick. Rows of
#: `airlight_integral*.csv` are those of `test_certified_integral`.
SAMPLES = {
    "airlight_integral_droplets.csv": slice(3, 4),
    "airlight_slopes.csv": slice(1, None, 20),
    "height_fog_rays.csv": slice(7, None, 57),
    "model_rays.csv": slice(3, None, 23),
}
_MIE = 1e-13  # relative: processors round the moments of Mie's series differently


def agree(name, row):
    made = MAKERS[name](row)
    mie = row.get("phase", "").startswith("mie")
    return all(
        float(row[key]) == pytest.approx(float(cell), rel=_MIE) if mie else row[key] == cell
        for key, cell in made.items()
    )


def test_every_file_of_rows_has_a_maker(data_folder):
    assert {path.name for path in data_folder.glob("*.csv")} == set(MAKERS)


@pytest.mark.claim(
    "droplets-certified", tolerance="none: the same digits; 1e-13 for sizes, which processors round"
)
@pytest.mark.parametrize("name", SAMPLES)
def test_a_sample_of_rows_is_made_again(data_folder, name):
    rows = read(data_folder / name)[1][SAMPLES[name]]
    assert rows
    assert [row for row in rows if not agree(name, row)] == []


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLES)
def test_all_rows_are_made_again(data_folder, name):
    rows = read(data_folder / name)[1]
    assert [row for row in rows if not agree(name, row)] == []


def test_a_file_is_written_whole(data_folder, tmp_path):
    """A digit that was changed by hand is put right, and its line is told."""
    shutil.copy(data_folder / "airlight_slopes.csv", tmp_path / "rows.csv")
    lines = (tmp_path / "rows.csv").read_text().splitlines(keepends=True)[:3]
    (tmp_path / "rows.csv").write_text(
        "".join(lines[:2]) + lines[2].replace("0.0014554480855734161", "0.0014554480855734162")
    )
    assert write(tmp_path / "rows.csv", MAKERS["airlight_slopes.csv"]) == [3]
    assert (tmp_path / "rows.csv").read_text() == "".join(lines)
