# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import replace

import numpy as np
import pytest

from reports.tables.stability import print_plane_stability
from validation.frames.plane_stability import _compared, broken, hard_cases, plane_stability
from validation.metrics.errors import plain

# Each case costs five kernels: the deepest stack and the dimmest light here, all four in the slow tier.
FEW = ("deep stack", "dim light behind")


def study(cases):
    told = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("validation.frames.plane_stability.hard_cases", lambda: cases)
        result = plane_stability(size=(20, 16), progress=lambda *progress: told.append(progress))
    assert [done for done, *_ in told] == list(range(len(cases)))
    assert {row.case for row in result} == set(cases)
    return result


@pytest.fixture(scope="module")
def rows(variant):
    return study({name: hard_cases()[name] for name in FEW})


def test_default_keeps_its_bar(rows):
    assert broken(rows) == []


@pytest.mark.slow
def test_default_keeps_its_bar_in_every_case(variant):
    every = study(hard_cases())
    assert broken(every) == []
    for case in hard_cases():
        assert_gamma_loses_more(every, case)


def test_float64_of_either_sum_is_the_truth(rows):
    """What float64 leaves is the kernel's tolerance and float32 distances to surfaces."""
    assert max(row.p99 for row in rows if row.precision == "double") < 1e-6


@pytest.mark.claim("differences-of-gamma")
@pytest.mark.parametrize("case", FEW)
def test_adding_up_gamma_loses_more(rows, case):
    """Cancellation: little within a segment, whose two Gammas share their rounding, much where all planes add up."""
    assert_gamma_loses_more(rows, case)


def assert_gamma_loses_more(rows, case):
    by_sum = {row.sum: row for row in rows if row.case == case and row.precision == "single"}
    assert by_sum["gamma"].p99 > by_sum["segments"].p99
    assert by_sum["planes"].p99 > 20 * by_sum["segments"].p99


def test_errors_are_counted_in_units_of_the_true_value():
    truth = np.full((2, 5), 2.0)
    image = truth.copy()
    image[0, :3] = 2.0 + 2e-3, -1.0, np.nan
    row = _compared(("case", "segments", "single"), image, truth, scale=truth)
    assert (row.pixels, row.beyond, row.negative, row.nonfinite, row.max, row.median) == (10, 2, 1, 1, 1.5, 0.0)
    words = broken([row, replace(row, sum="gamma")])
    assert len(words) == 3
    assert any("case, single: 1 negative" in line for line in words)


def test_table_names_what_is_broken(rows, capsys):
    print_plane_stability(plain(rows), ["deep stack, single: 3 negative"])
    text = capsys.readouterr().out
    assert "deep stack" in text
    assert "BROKEN: shadow planes, deep stack, single: 3 negative" in text
