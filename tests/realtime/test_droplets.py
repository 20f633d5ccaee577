# SPDX-License-Identifier: BSD-3-Clause
"""Droplets on the side under test are those of the reference, which computes them by another route."""

import numpy as np
import pytest

from analytic.droplets import Droplets, Modified, optics
from analytic.mie import coefficients
from realtime.droplets import droplet_series, droplet_table, phase_shift_coefficients, share_cut
from realtime.errors import InputError


def test_coefficients_by_phase_shifts_are_those_by_complex_recurrences():
    size = np.array([0.5, 3.0, 7.9, 60.0, 412.0])
    theirs = [part.T for part in coefficients(size, 1.333)]
    for ours, expected in zip(phase_shift_coefficients(size, 1.333), theirs):
        assert ours == pytest.approx(expected, abs=1e-11)


@pytest.mark.claim("droplets-two-sides", tolerance="1e-7 relative: series of Mie's theory leave out terms of 1e-8")
@pytest.mark.parametrize("droplets", [pytest.param(Droplets(), marks=pytest.mark.slow), Droplets(2.0, 8.0)])
def test_two_routes_give_one_phase_function(droplets):
    series = droplet_series(droplets.effective_radius, droplets.gamma)
    reference = optics(droplets)
    angle = np.concatenate([np.linspace(0, np.pi, 901), np.geomspace(1e-5, 0.1, 50)])
    assert series.values(angle) == pytest.approx(reference.series(np.cos(angle)), rel=1e-7)
    assert series.efficiency == pytest.approx(reference.q_extinction, rel=1e-10)
    assert series.extinction_per_droplet * 1e-12 * droplets.number == pytest.approx(reference.extinction, rel=1e-10)
    assert series.share_below(np.deg2rad(5)) == pytest.approx(reference.share(0, 5), abs=1e-9)
    assert share_cut(droplets.effective_radius, droplets.gamma) == pytest.approx(Modified(reference).removed, abs=1e-9)


def test_the_table_is_the_series():
    series, table = droplet_series(2.0, 8.0), droplet_table(2.0, 8.0)
    cells = len(table.entries) // 2 - 1
    w = (np.arange(cells) + 0.5) / cells
    values, slopes = table.entries[::2], table.entries[1::2]
    middle = 0.5 * (values[:-1] + values[1:]) + 0.125 * (slopes[:-1] - slopes[1:])
    assert middle == pytest.approx(series.values(2 * np.arctan2(w, 1 - w)), rel=1e-6)
    assert series.values(np.array([2 * np.arctan(table.peak)]))[0] == pytest.approx(0.5 * values[0], rel=0.05)


@pytest.mark.claim("droplets-refused")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [((1.9,), "effective radius"), ((51.0,), "2 to 50"), ((6.0, 0.0), "gamma"), ((6.0, 2.0, 0.6), "wavelength")],
)
def test_impossible_droplets_are_refused(arguments, words):
    with pytest.raises(InputError, match=words):
        droplet_series(*arguments)
