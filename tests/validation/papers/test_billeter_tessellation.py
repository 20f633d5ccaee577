# SPDX-License-Identifier: BSD-3-Clause
import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from reports.commands import main as cli
from reports.papers.billeter import billeter_data, billeter_tables
from reports.tables.drawing import text
from validation.configurations.timing import Timing
from validation.metrics.errors import error_metrics
from validation.papers.billeter_conclusions import conclusions, pays_from
from validation.papers.billeter_images import (
    FIGURES,
    TILES,
    FigureEntry,
    FigureRow,
    figure_rows,
    sampled,
    sampled_truth,
)
from validation.papers.billeter_tessellation import EVALUATIONS, TABLE, TableRow, table_rows, table_scene

SMALL = {"size": (24, 24), "seconds": 0.0}
ENDLESS = 1e9  # seconds that a frame may take: what is measured must not hang on how busy the machine is


@pytest.mark.claim("published-figures")
def test_published_figures_are_those_of_the_paper():
    rates = {(figure.where, figure.map): figure.fps for figure in FIGURES if figure.fps}
    assert rates == {
        ("Fig. 6a", 32): 230,
        ("Fig. 6b", 128): 165,
        ("Fig. 6c", 512): 25,
        ("Fig. 7a", 512): 25,
        ("Fig. 7b", 512): 10,
        ("Fig. 7c", 512): 96,
    }
    hall, mesh = TABLE
    assert [hall.fps[size] for size in (1024, 2048, 4096)] == [(86, 64), (35, 35), (10, 18)]
    assert [mesh.fps[size] for size in (1024, 2048, 4096)] == [(32, 29), (21, 21), (8, 12)]


def test_adaptive_pays_from_4096_on_in_the_paper():
    assert [pays_from(row.fps) for row in TABLE] == [4096, 4096]
    assert pays_from({1024: (10, 12), 2048: (10, 9), 4096: (10, 20)}) == 4096
    assert pays_from({1024: (10, 12), 2048: (10, 11)}) == 1024
    assert pays_from({1024: (10, 12), 2048: (10, 10.1)}) is None


def test_pixels_of_the_truth_are_those_of_the_frame(variant):
    from reference.scene.read import read_truth
    from validation.scenes.loading import load_scene

    truth = read_truth(load_scene("omni-box", (11, 7)).scene)
    some = sampled_truth(truth, 3)
    # Rows 1 and 4, columns 1, 4, 7 and 10 of 7 x 11.
    assert (some.height, some.width) == (2, 4)
    assert np.array_equal(some.direction[5], truth.direction[4 * 11 + 4])
    assert sampled(np.arange(77).reshape(7, 11), 3).tolist() == [[12, 15, 18, 21], [45, 48, 51, 54]]


def test_a_figure_is_judged_against_truth_and_map(variant):
    entries = [
        FigureEntry("Fig. 6", "omni-box", 16, "light-volumes", (("walls", "slanted"),), 230),
        FigureEntry("Fig. 6", "omni-box", 16, "light-volumes", (("evaluation", "mesh"),), 230),
        FigureEntry("Fig. 6", "omni-box", 16, "light-volumes", (("walls", "upright"),), 230),
        FigureEntry("Fig. 7", "omni-box", 16, "ray-march", (("steps", 16), ("spacing", "uniform"), ("shadow", "map"))),
    ]
    told = []
    rows = figure_rows(entries, limit=ENDLESS, progress=lambda *what: told.append(what), **SMALL)
    assert [share for share, _ in told] == [0, 1 / 4, 2 / 4, 3 / 4]
    walk, mesh, upright, march = rows
    assert walk.error is not None
    assert walk.error.relative_rmse > 0.01  # a map of 16 texels is coarse
    for row in (walk, mesh, upright):
        assert row.map_error is not None
        assert row.map_error.relative_rmse < 1e-5  # all are exact with respect to their map, and what it has of walls
        assert row.light_moved is not None
        assert row.light_moved.median_ms > 0
    assert upright.error is not None
    assert upright.error.relative_rmse < 0.7 * walk.error.relative_rmse
    assert march.map_error is not None
    assert march.map_error.relative_rmse > 0.01


def test_table_has_every_evaluation_and_its_passes(variant):
    rows = table_rows(TABLE[1:], maps=(16, 32), limit=ENDLESS, **SMALL)
    assert [(row.map, row.evaluation) for row in rows] == [(size, name) for size in (16, 32) for name in EVALUATIONS]
    static, adaptive, walk, upright = rows[4:]
    assert static.triangles == 2 * 32 * 32 + 4 * 32  # the texels, and the sides up to the light
    assert 0 < adaptive.triangles < static.triangles
    assert walk.triangles == upright.triangles == 0
    assert list(adaptive.passes) == [
        "surface",
        "shadow map",
        "laplacian",
        "edge map",
        "tessellate",
        "vertices",
        "prepare",
        "volume",
    ]
    assert all(value > 0 for row in rows for value in row.passes.values())
    assert static.against_static is None
    for row in (adaptive, walk):
        assert row.against_static is not None
        assert row.against_static.relative_rmse < 1e-3  # the threshold of the tessellation; rounding for walk
    assert upright.against_static is not None
    assert upright.against_static.relative_rmse > 0.01  # by which the slanted walls are wrong


def test_hall_of_the_table_has_one_map(variant):
    from realtime.scene.read_scene import read_scene

    assert [light.kind for light in read_scene(table_scene("colonnade", (8, 8))).lights] == ["spot"]


def test_what_takes_too_long_is_left_out_and_said(variant):
    rows = table_rows(TABLE[1:], maps=(16, 32), limit=1e-6, **SMALL)
    assert all(row.light_moved is None for row in rows)
    assert "more than the limit" in rows[0].missing
    assert rows[4].missing.startswith("not begun after map 16: a frame takes")
    assert any("could not be compared" in sentence for sentence in conclusions([], rows))


def test_a_row_that_must_be_expected_to_take_too_long_is_not_begun(variant, monkeypatch):
    from validation.papers import billeter_tessellation as billeter_tables

    def measured(empty, *rest, **values):
        return replace(empty, light_moved=timing(1000))

    monkeypatch.setattr(billeter_tables, "_measured", measured)
    rows = table_rows(TABLE[1:], maps=(16, 32, 64), limit=5.0, **SMALL)
    # Of 1 s at 16 texels follows up to 4 s at 32 and, as 32 was measured with 1 s too, 4 s at 64.
    assert not any(row.missing for row in rows)
    rows = table_rows(TABLE[1:], maps=(16, 64), limit=5.0, **SMALL)
    assert rows[4].missing == "a frame may take 16 s, by that of map 16: more than the limit of 5 s"


def test_too_much_memory_is_a_reason_and_no_crash(variant, monkeypatch):
    from realtime.errors import InputError
    from validation.papers import billeter_tessellation as billeter_tables

    def refuse(*what):
        raise InputError("map: needs 7 GB, there are 2")

    monkeypatch.setattr(billeter_tables, "prepared", refuse)
    rows = table_rows(TABLE[1:], maps=(16,), **SMALL)
    assert {row.missing for row in rows} == {"map: needs 7 GB, there are 2"}


def timing(milliseconds: float) -> Timing:
    return Timing(milliseconds, milliseconds, milliseconds, 3)


def table_row(size: int, evaluation: str, milliseconds: float) -> TableRow:
    return TableRow(TABLE[0], size, evaluation, (8, 8), light_moved=timing(milliseconds))


@pytest.mark.claim("conclusions-follow")
def test_conclusion_about_adaptive_is_that_of_the_measurement():
    times = {1024: (100, 100), 2048: (200, 150), 4096: (800, 300)}
    rows = [
        table_row(size, name, milliseconds)
        for size, pair in times.items()
        for name, milliseconds in zip(("static", "adaptive"), pair, strict=True)
    ]
    (sentence,) = conclusions([], rows)
    assert "faster than static from 2048 on" in sentence
    assert "1.00 at 1024, 1.33 at 2048, 2.67 at 4096" in sentence
    assert "published: from 4096 on; the paper's conclusion does not hold here." in sentence
    rows[3] = table_row(2048, "adaptive", 200)
    (sentence,) = conclusions([], rows)
    assert "from 4096 on; the same as published." in sentence
    rows.append(table_row(4096, "walk", 150))
    assert conclusions([], rows)[1] == "colonnade: frames a second of walk over those of the faster mesh: 2.00 at 4096."


def figure_row(entry: FigureEntry, milliseconds: float, error: float, map_error: float) -> FigureRow:
    ones = np.ones((4, 4, 3))
    errors = {
        "error": error_metrics(ones, (1 + error) * ones),
        "map_error": error_metrics(ones, (1 + map_error) * ones),
    }
    return FigureRow(entry, (8, 8), timing(milliseconds), timing(milliseconds), **errors)


@pytest.mark.claim("conclusions-follow")
def test_conclusions_about_marching_compare_each_form_of_the_volume_by_itself():
    entries = {(figure.where, figure.volume): figure for figure in FIGURES}
    rows = [
        figure_row(entries["Fig. 7b", None], 101.0, 0.05, 0.01),
        figure_row(entries["Fig. 7c", "walk"], 10.0, 0.05, 1e-4),
        figure_row(entries["Fig. 7c", "mesh"], 101.0, 0.04, 1e-4),
    ]
    mesh, mesh_verdict, walk, walk_verdict = conclusions(rows, [])
    assert "400 samples takes 1 times as long as the mesh (published: 9.6)" in mesh
    assert mesh_verdict.startswith("Fig. 7: the mesh is no faster than 400 samples")
    assert mesh_verdict.endswith("are not as good.")
    assert "takes 10.1 times as long as the walk (published of the mesh: 9.6)" in walk
    assert "has 0.01 of its error, against the truth 1." in walk
    assert walk_verdict.startswith("Fig. 7: the walk is faster than 400 samples")
    assert walk_verdict.endswith("are as good.")


@pytest.mark.claim("conclusions-follow")
def test_a_marcher_that_sums_the_integrand_is_not_the_one_of_the_paper():
    marchers = [figure for figure in FIGURES if figure.method == "ray-march"]
    assert {dict(figure.parameters).get("sum") for figure in marchers if figure.fps} == {"transitions"}
    volume = next(figure for figure in FIGURES if figure.where == "Fig. 7c" and figure.volume == "mesh")
    summed = next(figure for figure in marchers if figure.where == "peer")
    assert conclusions([figure_row(volume, 10.0, 0.1, 0.1), figure_row(summed, 20.0, 0.1, 0.1)], []) == []


@pytest.mark.claim("conclusions-follow")
def test_the_ratio_of_map_sizes_mixes_no_forms_of_the_volume():
    entries = {(figure.where, figure.volume): figure for figure in FIGURES}
    times = {("Fig. 6a", "mesh"): 10, ("Fig. 6c", "mesh"): 50, ("Fig. 6a", "walk"): 1, ("Fig. 6c", "walk"): 2}
    mesh, walk = conclusions([figure_row(entries[key], ms, 0.1, 0.1) for key, ms in times.items()], [])
    assert "a frame of the mesh takes 5 times as long, published: 9.2." in mesh
    assert "a frame of the walk takes 2 times as long, published of the mesh: 9.2." in walk


@pytest.mark.claim("conclusions-follow")
def test_conclusions_about_walls():
    figures = {dict(figure.parameters).get("walls"): figure for figure in FIGURES if figure.where == "Fig. 6b"}
    rows = [figure_row(figures["slanted"], 20.0, 0.05, 1e-5), figure_row(figures["upright"], 23.0, 0.002, 1e-5)]
    (words, *rest) = conclusions(rows, [])
    assert words.startswith("omni-box, map 128: with upright walls a frame takes 1.15 times as long as with slanted")
    assert words.endswith("and has 0.04 of their error against the truth.")
    assert rest == []


@pytest.fixture
def quick(monkeypatch):
    """Commands that time everything as few times as there is, and a table once."""
    from validation.papers import billeter_images as billeter_figures
    from validation.papers import billeter_tessellation as billeter_tables

    measured = []

    def once(*arguments, **options):
        measured.extend([] if measured else table_rows(*arguments, seconds=0.0, **options))
        return measured

    monkeypatch.setattr(billeter_tables, "table_rows", once)
    monkeypatch.setattr(billeter_figures, "figure_rows", partial(figure_rows, seconds=0.0))


def test_command_prints_the_table(variant, quick, capfd):
    arguments = ["published", "--paper", "billeter", "--scenes", "tangle", "--scale", "0.02", "--maps", "32,16"]
    arguments += ["--limit", str(ENDLESS)]
    assert cli.run([*arguments, "--markdown"]) == 0
    out = capfd.readouterr().out
    assert "| tangle, 20 x 20, map 16: static | 576 | - |" in out  # two a texel, and the sides up to the light
    assert "tangle: adaptive tessellation is faster than static" in out
    assert "the paper has no figures for these maps" in out
    assert cli.run([*arguments, "--json"]) == 0
    printed = json.loads(capfd.readouterr().out)
    assert set(printed) == {"environment", "billeter"}
    rows = printed["billeter"]["table"]
    assert [row["evaluation"] for row in rows] == 2 * ["static", "adaptive", "walk", "upright"]
    assert rows[0]["scene"] == "tangle"
    assert printed["billeter"]["figures"] == []
    assert printed["billeter"]["conclusions"]


def test_command_prints_the_figures(variant, quick, monkeypatch, capfd):
    from validation.papers import billeter_images as billeter_figures

    monkeypatch.setattr(billeter_figures, "FIGURES", FIGURES[:3])
    arguments = ["published", "--paper", "billeter", "--scenes", "omni-box", "--scale", "0.02", "--limit", str(ENDLESS)]
    assert cli.run([*arguments, "--markdown"]) == 0
    out = capfd.readouterr().out
    assert "| Fig. 6a, omni-box, 20 x 20: light-volumes (map=32, evaluation=walk, walls=slanted) | 230 |" in out
    assert "Table 1" not in out
    assert "Not measured" not in out


def test_what_is_not_measured_is_printed_with_its_reason():
    peer = next(figure for figure in FIGURES if figure.method == "min-max")
    figures = [FigureRow(peer, (8, 8), missing="no room")]
    table = [TableRow(TABLE[1], 4096, "static", (8, 8), missing="too slow")]
    out = "".join(text(drawn) for drawn in billeter_tables(billeter_data(figures, table)))
    assert "peer, colonnade, 8 x 8: min-max (map=512): not measured: no room" in out
    assert "tangle, 8 x 8, map 4096: static: not measured: too slow" in out
    assert "96.3" in out  # the pass that was published for this row
    as_read = billeter_data([], [TableRow(TABLE[0], 4096, "adaptive", (8, 8))])
    assert as_read["table"][0]["published"]["passes"]["volume"] == 17.75
    assert "adaptive: published (laplacian, edge map, tessellate, volume as read)" in text(billeter_tables(as_read)[-1])
    assert billeter_data(figures, table)["table"][0]["missing"] == "too slow"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--paper", "biry"], "--paper: got 'biry', wanted one of biri, billeter"),
        (["--paper", "billeter", "--scenes", "hall"], "scene: got 'hall', wanted some of omni-box"),
        (["--maps", "1024,many"], "--maps: got '1024,many', wanted sizes in texels"),
        (["--maps", "100"], "map: got 100, wanted a power of two"),
        (["--limit", "0"], "--limit: got 0, wanted more than 0"),
    ],
)
def test_wrong_options_are_refused(arguments, words, capfd):
    assert cli.run(["published", *arguments]) == cli.WRONG_INPUT
    assert words in capfd.readouterr().err


def test_rows_by_tiles_are_compared_with_their_own_and_are_not_those_of_the_paper():
    """A marcher, whose frames are shorter by tiles, is not the one that the paper's conclusion is about."""
    entries = [figure for figure in FIGURES if figure.scene == "colonnade" and figure.method == "ray-march"]
    assert [figure.where for figure in entries] == ["Fig. 7a", "Fig. 7b", "peer", "peer", TILES]
    volume = next(figure for figure in FIGURES if figure.where == "Fig. 7c" and figure.upright)
    rows = [
        figure_row(figure, ms, 0.1, 0.1)
        for figure, ms in ((volume, 100.0), (entries[1], 500.0), (entries[3], 900.0), (entries[4], 300.0))
    ]
    sentences = conclusions(rows, [])
    assert any("marching with 400 samples takes 5 times as long" in sentence for sentence in sentences)
    assert [words for words in sentences if "corners of tiles" in words and "takes 0.33 of the time" in words]
