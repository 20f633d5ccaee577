# SPDX-License-Identifier: BSD-3-Clause
import pytest

from reports.page.render import render_page
from reports.papers.billeter import PASSES as BILLETER_PASSES
from reports.papers.billeter import SIZE as BILLETER_SIZE
from tests.helpers.page import Page, report_data, table_of, widths, write_files
from tests.helpers.published import BILLETER, BIRI

TIMES = "\N{MULTIPLICATION SIGN}"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_files(tmp_path_factory.mktemp("published"))


def shown(published, folder):
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("reports.page.render.speed_error_chart", lambda scenes: "<svg></svg>")
        return Page(render_page(report_data() | {"published": published}, folder))


def test_published_tables_of_biri_stand_beside_the_measured(folder):
    page = shown({"biri": BIRI, "billeter": None}, folder)
    text = page.text
    assert "clutter: Table 1, Fig. 7c" in text
    assert text.count("clutter: Table 1") == 1
    assert text.count(f"1.3 {TIMES}") == 1  # 50 frames a second against 38; of another size nothing is compared
    assert f"clutter, 80 {TIMES} 60 (taylor)" in text
    assert "Fig. 7c: a note." in text
    for caption, width in (("Table 1 of Biri", 7), ("Table 2 of Biri", 13)):
        assert set(widths(table_of(page, caption))) == {width}
    assert "published" not in {a.get("id") for _, a in shown(None, folder).tags}


def test_published_tables_of_billeter_stand_beside_the_measured(folder):
    from validation.papers.billeter_images import SIZE
    from validation.papers.billeter_tessellation import PASSES

    assert PASSES == BILLETER_PASSES
    assert SIZE == BILLETER_SIZE
    page = shown({"biri": None, "billeter": BILLETER}, folder)
    for words_there in (
        f"omni-box, 1024 {TIMES} 1024: light-volumes (map=32, evaluation=walk)",
        "not measured: too slow",
    ):
        assert words_there in page.text
    for caption, width in (
        ("Figures 6 and 7", 9),
        ("Table 1 of Billeter", 9),
        ("Table 1 of Billeter 2010 again: the passes", 9),
    ):
        assert set(widths(table_of(page, caption))) == {width}


def test_reports_from_before_frames_kept_anything_are_still_shown(folder):
    """Version 2 of the data gained three timings; a report without them has a dash."""
    old = {
        **BIRI,
        "rows": [
            {k: v for k, v in row.items() if k not in ("light_moved_camera_kept", "colours_changed", "rays")}
            for row in BIRI["rows"]
        ],
    }
    page = shown({"biri": old, "billeter": None}, folder)
    assert set(widths(table_of(page, "Table 2 of Biri"))) == {13}
