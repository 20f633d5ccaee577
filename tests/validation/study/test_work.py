# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a cell becomes a row of finite numbers that are those of the metrics, or says why there are none."""

import weakref
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from realtime.scene.read_scene import read_scene
from validation.estimates.quadrature import truth_of_pixels
from validation.metrics.errors import error_metrics
from validation.scenes.loading import load_scene
from validation.study import reference as sampled
from validation.study import work
from validation.study.configuration import configuration, prepared
from validation.study.reference import cell_truth, load_cell
from validation.study.row import checked_row
from validation.study.stated_errors import ROUNDING
from validation.study.study import Cell

SIZE = (24, 18)


def row_of(scene, chosen, **options):
    cell = Cell(scene, SIZE, options.pop("medium", ()), chosen, **options)
    loaded = load_cell(cell)
    row = work.cell_row(
        cell, read_scene(loaded.scene), cell_truth(loaded), whole=loaded.scene, properties={"depth": 2.0}
    )
    return checked_row(row | {"key": "k"})


@pytest.mark.usefixtures("variant")
def test_a_row_has_the_errors_and_what_they_cost():
    chosen = configuration("shadow-planes")
    row = row_of("sphere-spot", chosen)
    loaded = load_scene("sphere-spot", SIZE)
    frame = work.unchecked_frame  # the same image as `render_frame` makes
    scene = read_scene(loaded.scene)
    renderer = prepared(scene, chosen)
    image = frame(renderer, work.run_stages(renderer, renderer.prepare(scene)))
    errors = error_metrics(cell_truth(loaded).airlight, image.airlight)
    assert row["status"] == "done"
    assert (row["p99"], row["relative_rmse"], row["bias"]) == (errors.p99, errors.relative_rmse, errors.bias)
    assert (row["bound"], row["outside_bound"], row["nonfinite"]) == (ROUNDING, 0, 0)
    assert row["truth"] == "quadrature"
    assert 0 < row["truth_error"] < 1e-6
    assert row["frame_ms"] > 0 < row["prepare_ms"]
    assert row["frames"] >= 1
    assert row["crossings"] > 0
    assert (row["rays"], row["lights"], row["property.depth"]) == (24 * 18, 1, 2.0)
    assert row["colour.ciede2000_max"] < 0.1
    assert row["command"] == "airlight view sphere-spot --method shadow-planes --kernel exact --size 24x18"


@pytest.mark.usefixtures("variant")
def test_preparation_is_timed_when_what_was_prepared_before_is_gone(monkeypatch):
    """In `random:20` the maps of 35 lights take a gigabyte: two of these ended the worker."""
    alive = []

    def counted(scene, chosen):
        renderer = prepared(scene, chosen)

        def prepare(scene):
            assert not any(each() for each in alive)
            state = renderer.prepare(scene)
            alive.append(weakref.ref(state))
            return state

        return replace(renderer, prepare=prepare)

    monkeypatch.setattr(work, "prepared", counted)
    row = row_of("sphere-spot", configuration("soft-shafts"))
    assert len(alive) == 2
    assert row["prepare_ms"] > 0


@pytest.mark.usefixtures("variant")
def test_times_are_left_out_where_nobody_asks():
    row = row_of("open-fog", configuration("unshadowed"), times="none", medium=("medium.sigma_t=0.3",))
    assert (row["status"], row["frame_ms"], row["medium"]) == ("done", None, "medium.sigma_t=0.3")
    assert row["outside_bound"] == 0  # nothing casts a shadow there, so the kernel's claim holds for whole rays
    assert row_of("windows", configuration("unshadowed"), times="none")["bound"] is None


@pytest.mark.usefixtures("variant")
def test_a_refusal_is_a_row():
    row = row_of("windows", configuration("shadow-planes", None, {"media": "paper"}))
    assert row["status"] == "refused"
    assert "lights with a place" in row["reason"]
    assert row["p99"] is None
    assert row["truth_mean"] > 0


@pytest.mark.slow
@pytest.mark.usefixtures("variant")
def test_under_a_light_with_extent_a_sixteenth_of_the_pixels_has_a_truth(own_cache, monkeypatch):
    loaded = load_cell(Cell("penumbra-plane", (40, 32), (), configuration("unshadowed")))
    truth = cell_truth(loaded)
    assert truth.mask is not None
    assert int(truth.mask.sum()) == 40 * 32 // 16
    assert truth.surface is None
    again = cell_truth(loaded)
    assert (again.airlight == truth.airlight).all()
    assert again.seconds == truth.seconds
    finer = truth_of_pixels(loaded.scene, np.flatnonzero(truth.mask))
    assert finer.airlight_se is not None
    beyond = []
    for seed in range(16):
        monkeypatch.setattr(sampled, "_PLAN", replace(sampled._PLAN, seed=seed))
        some = sampled.sampled_truth(loaded.scene)
        difference = np.abs(some["airlight"][truth.mask] - finer.airlight[0])
        beyond.append((difference > some["bound"][truth.mask] + 3 * finer.airlight_se[0]).mean())
    # The bound is three standard errors of eight replicates, beyond which 2.0 % of Student's law lie. The pixels of a
    # run share their points, the runs do not: four standard errors of the mean over runs.
    assert np.mean(beyond) <= 2 * stats.t.sf(3, 7) + 4 * np.std(beyond, ddof=1) / np.sqrt(len(beyond))
