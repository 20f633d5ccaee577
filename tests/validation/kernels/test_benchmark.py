# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the table of speed against error names the cheapest kernel that keeps each error, by what was measured."""

import numpy as np
import pytest

from analytic.errors import InputError
from validation.kernels import benchmark as kernel_bench
from validation.kernels.benchmark import KernelCost, Spread, bench_kernels, measure, speed_against_error
from validation.kernels.rays import wide_rays


def cost(family, size, ns, error, **others):
    spread = Spread(ns, ns, ns, 5)
    fields = {"device": spread, "wall": spread, "p99": error / 10, "max": error} | others
    return KernelCost(f"{family}-{size}", family, size, "isotropic", 0.0, 1000, **fields)


COSTS = (
    cost("uniform", 100, 100.0, 0.5),
    cost("uniform", 1000, 1000.0, 5e-3),
    cost("table", 64, 4.0, 0.05),
    cost("quadrature", 8, 5.0, 2e-3),
    cost("quadrature", 16, 8.0, 5e-6),
)


def level(levels, statistic, value):
    return next(entry for entry in levels if entry.statistic == statistic and entry.level == value)


def test_cheapest_kernel_of_each_level_and_what_its_rivals_cost():
    levels = speed_against_error(COSTS)
    assert len(levels) == 12
    coarse, fine, finest = (level(levels, "max", value) for value in (1e-1, 1e-2, 1e-6))
    assert (coarse.cheapest, coarse.rivals) == ("table-64", {"uniform": "uniform-1000", "table": "table-64"})
    assert coarse.ratios == {"uniform": 250.0, "table": 1.0}
    assert (fine.cheapest, fine.ratios) == ("quadrature-8", {"uniform": 200.0, "table": None})
    assert (finest.cheapest, finest.ns, finest.ratios) == (None, None, {"uniform": None, "table": None})
    # 99 % of the rays are ten times better here.
    assert level(levels, "p99", 1e-1).rivals["uniform"] == "uniform-100"
    assert level(levels, "p99", 1e-6).cheapest == "quadrature-16"


def test_values_that_are_not_finite_reach_no_level():
    fast = cost("taylor", 4, 1.0, 1e-7, nonfinite=1)
    assert level(speed_against_error([*COSTS, fast]), "max", 1e-1).cheapest == "table-64"


def test_phase_functions_are_judged_apart():
    other = KernelCost("x", "x", None, "hg", 0.8, 10, None, Spread(1.0, 1.0, 1.0, 5), 1e-8, 1e-8, 1e-8)
    levels = speed_against_error([*COSTS, other])
    assert len(levels) == 24
    assert {entry.phase for entry in levels if entry.cheapest == "x"} == {"hg"}


def test_measured_errors_and_times_are_those_of_the_kernel(variant):
    truth, timed = wide_rays(512), wide_rays(4096, truth=False)
    coarse, fine = (measure("quadrature", n, truth=truth, timed=timed, seconds=0.05) for n in (4, 16))
    assert (fine.kernel, fine.family, fine.size, fine.rays) == ("quadrature-16", "quadrature", 16, 4096)
    # The certified bound of 16 nodes is 4e-6; float32 rounds exponents of up to 60.
    assert fine.max < 3e-5 < coarse.max
    assert fine.nonfinite == 0
    for spread in (fine.device, fine.wall):
        assert 0 < spread.low <= spread.median <= spread.high
        assert spread.repetitions >= 5
    assert coarse.refused is None


def test_refusing_kernel_is_recorded(variant):
    truth = wide_rays(64, "tabulated")
    measured = measure("taylor", 4, truth=truth, timed=truth, seconds=0.01)
    assert "tabulated" in measured.refused
    assert (measured.ns, measured.max) == (None, None)


def test_long_work_is_done_on_fewer_rays_or_extrapolated(variant):
    truth, timed = wide_rays(64), wide_rays(256, truth=False)
    before = measure("uniform", 4, truth=truth, timed=timed, seconds=0.01)
    slow = cost("uniform", 4, 1e12, 0.5)
    after = measure("uniform", 8, truth=truth, timed=timed, seconds=0.01, before=slow)
    assert (after.rays, after.device.median, after.wall.repetitions) == (0, 2e12, 0)
    assert before.rays == 256
    assert kernel_bench._affordable(None, 480_000) == 480_000
    assert kernel_bench._affordable(4000.0, 480_000) == 120_000
    assert kernel_bench._affordable(1e5, 480_000) == 0
    # Only marching is linear in its size.
    assert (
        measure("quadrature", 8, truth=truth, timed=timed, seconds=0.01, before=cost("quadrature", 4, 1e12, 0.5)).rays
        == 256
    )


def test_names_stand_for_all_sizes_or_one(variant, monkeypatch):
    monkeypatch.setitem(kernel_bench.SIZES, "nodes", (2, 8))
    monkeypatch.setattr(kernel_bench, "ERROR_RAYS", 64)
    told = []
    study = bench_kernels(
        ["quadrature", "taylor-3"],
        phases=(("isotropic", 0.0), ("rayleigh", 0.0)),
        rays=256,
        seconds=0.01,
        progress=lambda *progress: told.append(progress),
    )
    assert [(row.kernel, row.phase) for row in study.costs] == [
        ("quadrature-2", "isotropic"),
        ("quadrature-8", "isotropic"),
        ("quadrature-16", "isotropic"),
        ("taylor-3", "isotropic"),
        ("quadrature-16", "rayleigh"),
        ("taylor-3", "rayleigh"),
    ]
    assert [done for done, _, _ in told] == [0, 1, 2, 3]
    assert {total for _, total, _ in told} == {4}


def test_unknown_kernel_is_refused_before_any_work(monkeypatch):
    monkeypatch.setattr(kernel_bench, "wide_rays", None)
    with pytest.raises(InputError, match="wanted one of"):
        bench_kernels(["tailor"])


def test_wide_rays_are_the_set_of_the_notes():
    rays = wide_rays(4096)
    distance = np.hypot(rays.foot, rays.height)
    assert 1e-4 * 0.999 < distance.min() < distance.max() < 60 * 1.001
    assert (rays.x0 == 0).all()
    assert (rays.sigma_t == 1).all()
    angle = np.degrees(np.arctan2(rays.height, rays.foot))
    np.testing.assert_allclose(np.percentile(angle, [25, 50, 75]), [45, 90, 135], atol=0.5)
