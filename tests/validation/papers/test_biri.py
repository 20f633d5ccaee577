# SPDX-License-Identifier: BSD-3-Clause
import json
from dataclasses import replace

import pytest

from reports.commands import main as cli
from validation.configurations.timing import Timing
from validation.papers.biri import PUBLISHED, STAGES, as_published, biri_row, biri_rows, told_apart


@pytest.mark.claim("published-figures")
def test_published_figures_are_those_of_the_paper():
    rates = {(figure.scene, figure.size): figure.fps for figure in PUBLISHED}
    assert [rates[name, (800, 600)] for name in ("two-pens", "three-media", "clutter", "hall")] == [23, 35, 25, 12]
    assert (rates["sphere-spot", (800, 600)], rates["sphere-spot", (1024, 768)]) == (120, 107)
    for figure in PUBLISHED:
        # Table 1 is printed with one decimal at most: its rows add up to 100 within 5 x 0.05.
        assert figure.shares is None or sum(figure.shares) == pytest.approx(100, abs=0.25)


def test_a_row_has_every_stage_and_its_error(variant):
    row = biri_row(PUBLISHED[0], "exact", size=(48, 36), error_size=(24, 18), seconds=0.02)
    assert row.triangles == 2 * 32 * 17 + 2
    assert len(row.stages_ms) == len(STAGES)
    assert all(stage > 0 for stage in row.stages_ms[:4])
    known = [share for share in row.shares if share is not None]
    assert sum(known) == pytest.approx(100) if row.told_apart else len(known) == 3
    assert row.error.relative_rmse < 1e-3  # the target of the method in every built-in scene
    assert all(
        times.median_ms > 0
        for times in (row.light_moved, row.static, row.light_moved_camera_kept, row.colours_changed, row.rays)
    )


def test_with_a_tolerance_the_timed_frame_is_compared_in_as_many_of_its_pixels(variant):
    """Rationale: the error of interpolation depends on the size of a pixel; some pixels of a frame say what all say."""
    sizes = {"size": (96, 72), "seconds": 0.0}
    row = biri_row(PUBLISHED[0], "exact", tolerance=0.005, error_size=(48, 36), **sizes)
    whole = biri_row(PUBLISHED[0], "exact", tolerance=0.005, error_size=(200, 200), **sizes)
    assert (row.error_size, row.error.pixels, row.frame_error.pixels) == ((96, 72), 48 * 36, 48 * 36)
    assert (whole.error_size, whole.error.pixels) == ((96, 72), 96 * 72)
    # The relative standard error of the root of a mean over a quarter of the pixels; errors are larger along shadows.
    assert row.error.relative_rmse == pytest.approx(whole.error.relative_rmse, rel=0.2)


def test_stages_are_told_apart_by_more_than_their_spread(variant):
    plain = Timing(10.0, 9.0, 11.0, 5)
    assert told_apart(plain, Timing(12.0, 11.5, 13.0, 5))
    assert not told_apart(plain, Timing(12.0, 10.9, 13.0, 5))
    assert not told_apart(plain, Timing(9.0, 8.0, 9.5, 5))
    row = biri_row(PUBLISHED[0], "exact", size=(48, 36), error_size=(24, 18), seconds=0.0)
    hidden, shown = (replace(row, told_apart=apart).shares for apart in (False, True))
    assert hidden == (shown[0], shown[1], None, shown[3], None)
    assert sum(shown) == pytest.approx(100)


def test_every_entry_is_measured_with_every_kernel(variant):
    told = []
    rows = biri_rows(
        PUBLISHED[:2], ("exact", "taylor"), scale=0.02, seconds=0.0, progress=lambda *what: told.append(what)
    )
    assert [(row.size, row.kernel, row.cone, row.tolerance) for row in rows] == [
        (size, *what)
        for size in ((16, 12), (20, 16))
        for what in (
            ("exact", 0, 0),
            ("exact", 32, 0),
            ("exact", 0, 0.005),
            ("taylor", 0, 0),
            ("taylor", 32, 0),
            ("taylor", 32, 0),
        )
    ]
    assert [row.published_variant for row in rows] == 2 * [*5 * [False], True]
    assert [share for share, _ in told] == [number / 12 for number in range(12)]


@pytest.mark.claim("biri-as-published")
@pytest.mark.parametrize("scene", ["sphere-spot", "three-media", "clutter"])
def test_a_row_as_published_has_all_that_the_paper_has(variant, scene):
    entry = next(row for row in PUBLISHED if row.scene == scene)
    chosen = as_published("taylor", white=0.7, cone=entry.cone)
    expected = {"order": "paper", "evaluation": "vertex", "buffer": "8bit", "white": 0.7, "cone": entry.cone}
    assert dict(chosen.parameters) == expected
    row = biri_row(
        entry, "taylor", cone=entry.cone, published_variant=True, size=(24, 16), error_size=(24, 16), seconds=0.0
    )
    assert row.white > 0
    assert row.error.nonfinite == row.frame_error.nonfinite == 0
    # The frame has what the airlight has of errors, and surfaces that are right beside it.
    assert row.error.relative_rmse > 0.02
    assert row.frame_error.relative_rmse < row.error.relative_rmse


def test_command_prints_both_tables_beside_the_published_figures(variant, monkeypatch, capfd):
    measured = []

    def once(*arguments, **options):
        """Measure for the first command, and give the second the same rows."""
        measured.extend([] if measured else biri_rows(*arguments, **options))
        return measured

    monkeypatch.setattr("validation.papers.biri.biri_rows", once)
    arguments = ["published", "two-pens", "--kernels", "exact", "--scale", "0.03"]
    assert cli.run([*arguments, "--markdown"]) == 0
    out = capfd.readouterr().out
    assert "| two-pens: Table 1, Fig. 7a | 1 % | 8.7 % | 21.7 % | 9.6 % | 59 % | - |" in out
    assert "two-pens, 24 x 16 (exact) | 34549 | 23 |" in out
    assert "more than 35" in out
    assert cli.run([*arguments, "--json"]) == 0
    printed = json.loads(capfd.readouterr().out)
    assert printed["rows"][0]["published"]["fps"] == 23
    assert len(printed["rows"][0]["shares"]) == len(printed["stages"]) == 5


def test_unknown_scene_is_refused(capfd):
    assert cli.run(["published", "three-pens"]) == cli.WRONG_INPUT
    assert "scene: got 'three-pens', wanted some of sphere-spot" in capfd.readouterr().err
