# SPDX-License-Identifier: BSD-3-Clause
"""The page of a report, from a golden report.json: its numbers, nothing from elsewhere,
and names that are words.
"""

import json

import numpy as np
import pytest

from airlight.reports.data.records import Method
from airlight.reports.page.chart import scene_chart, speed_error_chart
from airlight.reports.page.filters import DASH
from airlight.reports.page.render import SCRIPTS, render_page
from airlight.reports.plotting.figure import speed_panel
from airlight.reports.tables.methods import fastest_table
from tests.helpers.page import DATA, Page, engine_image, report_data, write_files
from tests.helpers.reports import checked, entry, growth_record, record_of, refused

_ERRORS = {"rays": 77, "refused": 5, "median": 1.5e-7, "p99": 2.5e-6, "max": 4.5e-6}
_ERRORS |= {"nan": 0, "infinite": 0, "negative": 2, "mean": 2e-7, "worst": None}
_GROUPS = {name: {"all": _ERRORS} for name in ("single", "double")}
STABILITY = [
    {
        "kernel": "my-kernel",
        "exact": True,
        "refused": {},
        "gamma": {},
        "broken": ["law of scale"],
        "sets": [{"name": "certified", "columns": "", **_GROUPS}],
    }
]

_CLAIM = {
    "paper": "biri",
    "item": "eq. 0",
    "words": "a claim of words",
    "verdict": "not reproduced",
}
_CLAIM |= {
    "published": None,
    "measured": 3.0,
    "low": 2.5,
    "high": 3.5,
    "unit": "times",
    "why": "at most 1: so",
}
_RATE = {
    "item": "Fig. 0",
    "words": "a rate",
    "verdict": None,
    "published": 23.0,
    "unit": "frames/s",
    "why": "",
}
PAPERS = [_CLAIM, _CLAIM | _RATE]


EVIL = "</script><script>alert('1')</script> & \"q\" $x^2$ {{ 7 * 7 }}"


@pytest.fixture
def data():
    return report_data()


@pytest.fixture(autouse=True)
def _no_chart(monkeypatch):
    """Draw no charts for the pages: they take longer than everything else, and
    have a test of their own.
    """
    monkeypatch.setattr(
        "airlight.reports.page.render.speed_error_chart", lambda scenes: "<svg></svg>"
    )
    monkeypatch.setattr(
        "airlight.reports.page.render.scene_chart", lambda scenes, place: "<svg></svg>"
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_files(tmp_path_factory.mktemp("page"))


def render(data, folder):
    return Page(render_page(checked(data), folder))


def test_page_shows_the_numbers_of_the_data(data, folder):
    whole = data | {"stability": STABILITY, "papers": PAPERS}
    page = render(whole | {"scaling": [growth_record()]}, folder)
    text = page.text
    for shown in (
        "1.23 %",
        "-0.45 %",
        "5.55 %",
        "3.21",
        "312",
        "0.98765",
        "4321",
        "-0.110 … +0.140 %",
        "0.5 %",
        "11",
    ):
        assert shown in text, shown
    for claim in DATA["claims"]:
        assert claim["text"] in text
    for row in fastest_table(checked(DATA).scenes).rows:
        assert all(cell in text for cell in row.values.values())
    for words in (
        "airlight report --quick",
        "mitsuba 3.9.1",
        "my-kernel",
        "not reproduced",
        "numbers beside ours",
    ):
        assert words in text
    index = json.loads(page.script("images"))
    assert [entry["label"] for entry in index["scenes"][0]["methods"]] == ["good (k)", "flat"]
    assert render(data, folder).source == render(report_data(), folder).source


@pytest.mark.claim("build-named")
def test_page_names_the_commit_and_the_digest_where_the_report_has_them(data, folder):
    assert "airlight 0.1.0, effort" in render(data, folder).text
    made = {
        "airlight": "0.9",
        "commit": "1a2b3c4d5e6f7a8b",
        "changed": True,
        "digest": "0f1e2d3c4b5a6978",
    }
    text = render(data | {"environment": data["environment"] | {"build": made}}, folder).text
    words = "airlight 0.9, commit 1a2b3c4d5e6f with changes, files 0f1e2d3c4b5a"
    assert f"{words}, effort" in text
    assert f"Written by {words}." in text
    assert "digest 0f1e2d3c4b5a6978" in text


@pytest.mark.claim("report-stands-alone")
def test_page_needs_nothing_but_itself(data, folder):
    """Only the pictures that are named for readers without scripts are other files,
    and they are not loaded.

    Their addresses begin in this folder: `random:7/a.png` would be of a scheme called random.
    """
    data["scenes"][0]["files"] |= {"picture": "random:7/reference.png"}
    page = render(data, folder)
    linked = [
        address for tag, address in page.addresses() if tag == "a" and not address.startswith("#")
    ]
    others = [address for tag, address in page.addresses() if address not in linked]
    assert all(address.startswith(("#", "data:,")) for address in others), others
    assert "./random:7/reference.png" in linked
    assert all(target.startswith("./") for target in linked)
    assert not {tag for tag, _ in page.tags} & {"iframe", "object", "embed", "img"}
    assert "@import" not in page.source
    assert "url(http" not in page.source


def test_names_and_notes_are_words_and_never_html(data, folder):
    scene = data["scenes"][0]
    scene["name"] = scene["purpose"] = scene["published"] = EVIL
    scene["notes"] = [EVIL]
    scene["plan"][EVIL] = EVIL
    scene["methods"][0]["label"] = EVIL
    scene["methods"].append(refused("x", EVIL))
    data["claims"].append({"kind": EVIL, "text": EVIL, "good": None})
    data["command"] = data["environment"]["variant"] = EVIL
    page = render(data, folder)
    # Scripts of our own, the index and one scene's pixels; none by what a file is called.
    assert len(page.scripts) == len(SCRIPTS) + 2
    # Claim twice, name, purpose, published, note, plan twice, label, refusal, command,
    # environment: all as they came.
    assert page.text.count(EVIL) >= 12
    index = json.loads(page.script("images"))
    assert index["scenes"][0]["name"] == index["scenes"][0]["methods"][0]["label"] == EVIL


def test_missing_values_are_dashes_and_failures_are_marked(data, folder):
    scene = data["scenes"][0]
    scene["reference"] |= {"mean": None, "relative_error": None, "missed": None}
    scene["methods"][0]["error"] |= dict.fromkeys(("relative_rmse", "relative_bias", "p50", "p99"))
    scene["methods"] += [refused("bad", "no series"), engine_image()]
    scene["agreement"]["airlight"]["statistics"] |= {
        "relative_bias": None,
        "relative_bias_ci": [None, None],
    }
    scene["agreement"]["surface"]["statistics"] |= {"equivalent": False}
    data["claims"] = [
        {"kind": "reference", "text": "The reference is NOT confirmed.", "good": False}
    ]
    page = render(data, folder)
    assert "None" not in page.text
    assert "nan" not in page.text.lower().replace("airlight", "").split()
    for words in (
        DASH,
        "refused: no series",
        "(image, total)",
        "does not hold: The reference is NOT confirmed.",
    ):
        assert words in page.text
    marked = [
        tag for tag, attributes in page.tags if "bad" in (attributes.get("class") or "").split()
    ]
    assert {"li", "td"} <= set(marked)


def test_bars_of_noisy_methods_go_down_to_their_bias():
    from matplotlib.figure import Figure

    noise = {"runs": 8, "bias": 0.0, "bias_within": 0.1, "rmse": 0.2, "rmse_within": 0.1}
    noise |= {"root_bias": None, "most_bias": 0.05}
    entries = [record_of(entry(str(n), noise=noise if n else None), Method) for n in range(2)]
    panel = Figure().subplots()
    speed_panel(panel, "scene", entries, {"0": {}, "1": {}})
    bars = [bar.get_segments() for bar in panel.collections if np.ptp(bar.get_segments()[0][:, 1])]
    np.testing.assert_allclose(np.ravel([bar[0][:, 1] for bar in bars]), [0.05, 0.2])


def test_the_point_of_a_noisy_method_says_the_error_at_which_it_stands():
    """The words under the pointer were of the first run, the point of the mean over the runs."""
    noise = {"runs": 8, "bias": 0.0, "bias_within": 0.1, "rmse": 0.2, "rmse_within": 0.1}
    noise |= {"root_bias": None, "most_bias": 0.05}
    data = report_data()
    data["scenes"][0]["methods"][0]["noise"] = noise
    svg = scene_chart(checked(data).scenes, 0)
    assert "<title>good (k): 3.21 ms, relative RMSE 0.2</title>" in svg
    assert "<title>flat: 3.21 ms, relative RMSE 0.012</title>" in svg


def test_an_error_of_other_light_than_the_airlight_says_so():
    from matplotlib.figure import Figure

    entries = [record_of(entry(each, layer=each), Method) for each in ("airlight", "total")]
    panel = Figure().subplots()
    speed_panel(panel, "scene", entries, {"airlight": {}, "total": {}})
    assert [text.get_text() for text in panel.texts] == ["error of the total"]


def test_the_chart_has_a_panel_for_each_scene_whatever_it_is_called():
    """A dollar begins mathematics in matplotlib; half a formula would end the
    report after all its work.
    """
    scenes = [
        report_data()["scenes"][0] | {"name": name} for name in ("hall", "50$ a_b^c $\\frac{$")
    ]
    # no place on a logarithmic axis
    scenes[1]["methods"] += [refused("refused", "x"), engine_image()]
    records = checked(report_data() | {"scenes": scenes}).scenes
    svg = speed_error_chart(records)
    assert svg == speed_error_chart(records)
    assert all(svg.count(f">{label}<") == 1 for label in ("hall", "good (k)", "flat"))
