# SPDX-License-Identifier: BSD-3-Clause
"""Tables of cases: both sets of columns, and every way to get one wrong."""

import numpy as np
import pytest

from analytic.errors import InputError
from validation.kernels.case_files import read_cases

HEAD = "phase,g,t,h,x0,x1,sigma_t\n"


@pytest.fixture
def table(tmp_path):
    def write(text):
        path = tmp_path / "cases.csv"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_both_files(data_folder):
    cases = read_cases(data_folder / "airlight_integral.csv")
    assert len(cases.phase) == len(cases.tag) == len(cases.rows) == 2004
    assert cases.origin is None
    assert np.isinf(cases.x1).any()
    assert cases.header[0] == "tag"
    rays = read_cases(data_folder / "airlight_integral_rays.csv")
    assert rays.origin.shape == rays.direction.shape == rays.light.shape == (1002, 3)
    assert rays.tag is None
    assert (rays.height >= 0).all()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("phase,g,t,h,x0,x1\nhazy,0,1,1,0,1\n", "line 1: no column 'sigma_t'"),
        (HEAD + "hazy,0,1,1,0,1,0.1\nhazy,0,1,one,0,1,0.1\n", "line 3, column 'h': 'one' is not a number"),
        (HEAD + "hazy,0,1,-1,0,1,0.1\n", "line 2, column 'h': -1 is out of range; wanted a number >= 0"),
        (
            HEAD + "hazi,0,1,1,0,1,0.1\n",
            "line 2, column 'phase': no phase function is called 'hazi'; did you mean 'hazy'",
        ),
        (HEAD + "tabulated,0,1,1,0,1,0.1\n", "no place for its table"),
        (HEAD + "hazy,0,1,1,0,1\n", "line 2: 6 cells under a header of 7 columns"),
        ("", "no lines"),
        (
            "phase,ox,oy,oz,dx,dy,dz,lx,ly,lz,x0,x1,sigma_t\nhazy,0,0,0,0,0,2,1,1,1,0,1,0.1\n",
            "line 2, column 'dx': 0 is out of range; wanted a direction of length 1",
        ),
    ],
)
def test_refusals(table, text, message):
    with pytest.raises(InputError, match=message):
        read_cases(table(text))
