# SPDX-License-Identifier: BSD-3-Clause
import pytest

from reports.page import render_page
from reports.page_published import BILLETER_PASSES, BILLETER_SIZE
from tests.page_for_tests import Page, report_data, table_of, timing, widths, write_files

TIMES = "\N{MULTIPLICATION SIGN}"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_files(tmp_path_factory.mktemp("published"))


def shown(published, folder):
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("reports.page.speed_error_chart", lambda scenes: "<svg></svg>")
        return Page(render_page(report_data() | {"published": published}, folder))


BIRI = {
    "stages": ["silhouettes", "scene", "airlight of the scene", "sorting", "shadow planes"],
    "rows": [
        {
            "published": {
                "scene": "clutter",
                "where": "Fig. 7c",
                "size": [800, 600],
                "fps": 38,
                "shares": [1.7, 14, 33.6, 16, 34.7],
                "note": note,
                "cone": 0,
            },
            "kernel": kernel,
            "cone": 0,
            "size": size,
            "triangles": 20747,
            "stages_ms": [1.0, 2.0, 3.0, 4.0, 10.0],
            "shares": [5.0, 10.0, 15.0, 20.0, 50.0],
            "rebuilt": timing(20.0),
            "static": timing(12.5),
            "error": {"relative_rmse": 0.002, "relative_bias": 0.001, "p99": 0.01},
            "error_size": [160, 120],
        }
        for kernel, size, note in (("exact", [800, 600], "a note"), ("taylor", [80, 60], ""))
    ],
    "needless": [
        {"what": "unseen", "ratio": 1.013, "low": 0.99, "high": 1.03, "with_ms": 2.0, "without_ms": 1.97, "turns": 60}
    ],
}


def test_published_tables_of_biri_stand_beside_the_measured(folder):
    page = shown({"biri": BIRI, "billeter": None}, folder)
    text = page.text
    assert "clutter: published, Fig. 7c" in text
    assert text.count("clutter: published") == 1
    assert text.count(f"1.3 {TIMES}") == 1  # 50 frames a second against 38; of another size nothing is compared
    assert f"clutter, 80 {TIMES} 60 (taylor)" in text
    assert "Fig. 7c: a note." in text
    for caption, width in (("Table 1 of Biri", 7), ("Table 2 of Biri", 10), ("What is not needed", 6)):
        assert set(widths(table_of(page, caption))) == {width}
    assert "published" not in {a.get("id") for _, a in shown(None, folder).tags}


def test_published_tables_of_billeter_stand_beside_the_measured(folder):
    from validation.billeter_figures import SIZE
    from validation.billeter_tables import PASSES

    assert list(PASSES) == BILLETER_PASSES
    assert list(SIZE) == BILLETER_SIZE
    entry = {"where": "Fig. 6a", "scene": "omni-box", "map": 32, "method": "light-volumes", "fps": 230}
    error = {"relative_rmse": 0.002, "p99": 0.01}
    times = {"rebuilt": timing(2.0), "static": timing(1.0)}
    image = {"entry": entry | {"parameters": [["evaluation", "walk"]]}, "size": [1024, 1024], "missing": None}
    view = {"map": 1024, "evaluation": "static", "size": [1024, 1024], "faces": 1, "scene": "colonnade"}
    published = {"what": "Sponza", "fps": 86, "passes": {"volume": 9.0}}
    blank = {"rebuilt": None, "static": None, "error": None, "map_error": None}
    billeter = {
        "figures": [image | times | {"error": error, "map_error": error}, image | blank | {"missing": "too slow"}],
        "table": [
            view
            | times
            | {"triangles": 7, "passes": {"volume": 12.5}, "against_static": error, "published": published},
            view | blank | {"missing": "too big", "triangles": 0, "passes": {}, "published": published},
        ],
        "conclusions": ["Adaptive pays."],
    }
    page = shown({"biri": None, "billeter": billeter}, folder)
    for words_there in (
        f"omni-box, 1024 {TIMES} 1024: light-volumes (map=32, evaluation=walk)",
        "not measured: too slow",
    ):
        assert words_there in page.text
    assert "Adaptive pays." in page.text
    for caption, width in (("Figures 6 and 7", 10), ("Table 1 of Billeter", 8), ("The passes of Table 1", 9)):
        assert set(widths(table_of(page, caption))) == {width}
