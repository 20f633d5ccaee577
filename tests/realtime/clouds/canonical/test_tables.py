# SPDX-License-Identifier: BSD-3-Clause
"""Claim: looked up, the tables of canonical transport give what they were made of, and what lies outside is defined."""

import drjit as dr
import numpy as np
import pytest

from realtime.clouds.canonical import coordinates
from realtime.clouds.canonical.fit import fit_on_device, fit_tables
from realtime.clouds.canonical.kept import kept_path
from realtime.clouds.canonical.look_up import on_device
from realtime.clouds.canonical.sets import SETS, set_name
from realtime.clouds.canonical.tables import Grid, canonical_tables, tables_digest
from realtime.clouds.slab_orders.phases import HenyeyGreensteinPhase
from realtime.errors import InputError
from realtime.numerics.array_types import array_types
from validation.canonical.errors import look_up_errors, looked_up_points, transport_at

PHASE, ALBEDO = HenyeyGreensteinPhase(0.5), 0.95
GRID = Grid(thicknesses=5, depths=5, suns=4, directions=13, fine_thicknesses=5, fine_depths=5, fine_suns=4)


@pytest.fixture(scope="module")
def tables(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))
        yield canonical_tables(PHASE, ALBEDO, grid=GRID)


@pytest.fixture(scope="module")
def look_up(variant, tables):
    return on_device(tables, array_types())


def values(look_up, number, t, d, mu, phi, mu_l):
    Float = array_types().scalar
    arrays = np.broadcast_arrays(*map(np.atleast_1d, (t, d, mu, np.cos(phi), np.sin(phi), mu_l)))
    results = look_up(number, *(Float(np.array(each, dtype=np.float64)) for each in arrays))
    dr.eval(results)
    return np.array(results, dtype=np.float64)


@pytest.mark.claim("clouds-look-up", tolerance="0.4 % of T: half precision, and waves that are cut off")
def test_at_entries_look_ups_are_the_computation(look_up):
    """Half precision keeps three digits; azimuths are those at which no wave is cut off, and where some are."""
    t = coordinates.thicknesses(5)[2]
    d, mu, mu_l = coordinates.depths(5, t)[[1, 2, 3]], coordinates.directions(13)[[2, 4, 10]], coordinates.suns(4)[1:]
    phi = np.array([0.7, 4.0, 2.2])
    exact = transport_at(PHASE, ALBEDO, t, d, mu, phi, mu_l, streams=32)
    for number in (0, 4, 7):
        T, c_x, c_y, sigma = values(look_up, number, t, d, mu, phi, mu_l)
        assert pytest.approx(exact[0, number], rel=4e-3) == T
        assert sigma == pytest.approx(exact[3, number], rel=6e-3)
        off = np.hypot(c_x - exact[1, number], c_y - exact[2, number]) / exact[3, number]
        assert off.max() < 0.01


def test_both_faces_and_grazing_directions_are_finite_and_dark_where_no_light_comes_from(look_up):
    d, mu = np.array(
        [(0, -0.5), (0, -1), (3, 0.5), (3, 0), (3, 1), (0, 0), (0, 1), (3, -1), (1, 0), (1, -1e-4), (1, 1e-4)]
    ).T
    for number in (0, 7):
        T, c_x, c_y, sigma = values(look_up, number, 3.0, d, mu, 1.0, 0.5)
        assert np.isfinite([T, c_x, c_y, sigma]).all()
        assert (sigma > 0).all()
        assert (T[:5] == 0).all()
        assert (T[5:] > 0).all()
        assert T[-1] == pytest.approx(T[-2], rel=1e-2)


@pytest.mark.claim("clouds-outside")
def test_outside_the_tables_what_happens_is_what_the_page_says(look_up):
    t, d, mu_l = np.array(
        [
            (2, 9, 0.7),
            (2, 2, 0.7),
            (2, -1, 0.7),
            (2, 0, 0.7),
            (0.001, 0.0005, 0.7),
            (0.01, 0.005, 0.7),
            (1000, 7, 0.7),
            (200, 7, 0.7),
            (1000, 500, 0.7),
            (200, 100, 0.7),
            (2, 1, 0.02),
            (2, 1, 0.01),
            (2, 1, -0.3),
        ]
    ).T
    for number in (0, 7):
        first = SETS[number][0]
        below, floor, above, top, thin, thinnest, thick, thickest, deep, middle, low, lower, night = values(
            look_up, number, t, d, np.where(t == 2, 0.6, -0.6), 0.4, mu_l
        ).T
        np.testing.assert_array_equal(below, floor)
        np.testing.assert_array_equal(above, top)
        np.testing.assert_allclose(thin[1:], thinnest[1:], rtol=0.05, atol=0.01)
        assert thin[0] <= 0.2 * thinnest[0] * 0.1 ** (first - 1)
        np.testing.assert_allclose(thick, thickest, rtol=1e-3)
        np.testing.assert_allclose(deep, middle, rtol=1e-3)
        np.testing.assert_allclose(lower, [0.5 * low[0], *low[1:]], rtol=1e-4)
        np.testing.assert_allclose(night, [0, *low[1:]], rtol=1e-4)


def test_the_azimuth_turns_the_collector_and_not_the_light(look_up):
    there, mirrored = values(look_up, 7, 2.0, 1.0, 0.4, np.array([0.8, -0.8]), 0.5).T
    np.testing.assert_allclose(mirrored, there * [1, 1, -1, 1], rtol=1e-5)


def test_tables_are_kept_and_damaged_ones_are_made_again(tables, tmp_path, monkeypatch):
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path))
    made = []
    small = Grid(4, 4, 4, 5, 4, 4, 4)

    def tell(share, what):
        made.append(share)

    first = canonical_tables(HenyeyGreensteinPhase(0.0), 0.5, grid=small, progress=tell)
    count = len(made)
    again = canonical_tables(HenyeyGreensteinPhase(0.0), 0.5, grid=small, progress=tell)
    assert len(made) == count
    np.testing.assert_array_equal(first.waves[3], again.waves[3])
    path = kept_path(tables_digest(HenyeyGreensteinPhase(0.0), 0.5, small))
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 255
    path.write_bytes(data)
    canonical_tables(HenyeyGreensteinPhase(0.0), 0.5, grid=small, progress=tell)
    assert len(made) == 2 * count
    assert tables_digest(PHASE, 0.5, small) != tables_digest(HenyeyGreensteinPhase(0.0), 0.5, small)


def test_full_tables_are_at_most_32_megabytes():
    from realtime.clouds.canonical.tables import LENGTHS, WAVES

    grid = Grid()
    corners = grid.thicknesses * grid.depths * grid.suns
    halves = corners * (sum(WAVES) * grid.directions + sum(map(sum, LENGTHS)) * grid.other_directions)
    singles = len(SETS) * (4 * grid.fine_thicknesses * grid.fine_depths * grid.fine_suns + 1025)
    assert 2 * halves + 4 * singles <= 32e6
    assert all(waves % 4 == 0 for waves in WAVES)
    assert all(sum(lengths) % 4 == 0 for lengths in LENGTHS)


def test_an_albedo_without_scattering_is_refused():
    for albedo in (0.0, 1.5, float("nan")):
        with pytest.raises(InputError, match="albedo"):
            canonical_tables(PHASE, albedo)


@pytest.mark.slow
def test_the_22_functions_are_fitted_and_have_the_same_door(look_up):
    types = array_types()
    fitted = fit_on_device(fit_tables(look_up, types), types)
    points = looked_up_points(look_up, types, 2000)
    rows = look_up_errors(fitted, types, points)
    assert [row["orders"] for row in rows] == [set_name(number) for number in range(len(SETS))]
    for row in rows:
        assert 0.005 < row["T"]["p50"] < 1.5
        assert row["sigma"]["p50"] < 1.0
