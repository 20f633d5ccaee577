# SPDX-License-Identifier: BSD-3-Clause
import json
import re

import numpy as np
import pytest

from analytic.errors import InputError
from reports.page.chart import scene_chart, speed_error_chart
from reports.page.filters import DASH, kept_words, number, percent, words
from reports.page.render import SCRIPTS, render_page
from reports.plotting.pictures import png_bytes
from reports.tables.methods import fastest_table
from tests.helpers.page import (
    DATA,
    Page,
    engine_image,
    method,
    report_data,
    table_of,
    widths,
    write_files,
)
from tests.helpers.published import MUTATIONS, STABILITY
from tests.helpers.reports import growth_record, refused, timing


@pytest.fixture
def data():
    return report_data()


@pytest.fixture(autouse=True)
def _no_chart(monkeypatch):
    """Draw the charts for the page of the module alone: they take longer than everything else."""
    monkeypatch.setattr("reports.page.render.speed_error_chart", lambda scenes: "<svg></svg>")
    monkeypatch.setattr("reports.page.render.scene_chart", lambda scenes, place: "<svg></svg>")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return write_files(tmp_path_factory.mktemp("page"))


def render(data, folder):
    return Page(render_page(data, folder))


@pytest.fixture(scope="module")
def page(folder):
    return render(report_data(), folder)


def test_page_shows_the_numbers_of_the_data(page):
    text = page.text
    for shown in ("1.23 %", "-0.45 %", "5.55 %", "3.21", "312", "0.98765", "4321", "-0.110 … +0.140 %", "0.5 %", "11"):
        assert shown in text, shown
    for claim in DATA["claims"]:
        assert claim["text"] in text
    for row in fastest_table(DATA["scenes"]).rows:
        assert all(cell in text for cell in row.values.values())
    assert "Answers to: Billeter 2010." in text
    assert "airlight report --quick" in text
    assert "mitsuba 3.9.1" in text


def test_code_in_a_claim_is_drawn_as_code(data, folder):
    data["claims"].append({"kind": "not-measured", "text": "`--scenes` names <them>.", "good": None})
    assert "<code>--scenes</code> names &lt;them&gt;." in render(data, folder).source


@pytest.mark.claim("report-stands-alone")
def test_page_needs_nothing_but_itself(page):
    """Only the pictures that are named for readers without scripts are other files, and they are not loaded."""
    for tag, attributes in page.tags:
        for name in ("src", "href", "xlink:href", "data", "poster", "srcset", "action"):
            target = attributes.get(name)
            ok = target is None or target.startswith(("#", "data:,")) or (tag == "a" and target.startswith("s/"))
            assert ok, (tag, target)
    assert not {tag for tag, _ in page.tags} & {"iframe", "object", "embed", "img"}
    assert "@import" not in page.source
    assert "url(http" not in page.source


def test_images_are_data_and_every_canvas_has_words(page):
    index = json.loads(page.script("images"))
    (scene,) = index["scenes"]
    assert [entry["label"] for entry in scene["methods"]] == ["good (k)", "flat"]
    assert set(scene["methods"][1]["layers"]) == {"airlight", "surface", "flip"}
    assert len(page.script("pixels-0")) > 1000
    pictures = [attributes for attributes in page.attributes("canvas") if "aria-hidden" not in attributes]
    shown = [attributes for attributes in pictures if attributes.get("role") == "img"]
    assert len(shown) == 3
    assert len({attributes["aria-label"] for attributes in shown}) == 3
    assert all(attributes["tabindex"] == "0" for attributes in shown)


def test_tables_have_headers_and_captions(page):
    # Probe, trust, fastest, methods, agreement, multiple scattering, environment, times of parts, settings, keys.
    assert len(page.tables) == 10
    for table in page.tables:
        assert any(tag == "caption" for tag, _ in table)
        headers = [attributes for tag, attributes in table if tag == "th"]
        assert headers
        assert all(attributes.get("scope") in ("col", "row") for attributes in headers)
        rows = sum(tag == "tr" for tag, _ in table)
        # Every row begins with a header of its own but for the row of column headers.
        assert sum(attributes["scope"] == "row" for attributes in headers) >= rows - 1


def test_rows_of_the_methods_are_as_wide_as_their_headers(data, folder):
    data["scenes"][0]["methods"] += [refused("bad", "no"), engine_image()]
    assert set(widths(table_of(render(data, folder), "Times and errors"))) == {13}


def test_page_has_language_title_one_main_heading_and_landmarks(page):
    assert page.attributes("html") == [{"lang": "en"}]
    assert "2026-11-21" in page.text
    assert len(page.attributes("h1")) == len(page.attributes("main")) == 1
    names = {attributes["id"] for _, attributes in page.tags if "id" in attributes}
    assert all(attributes["href"][1:] in names for attributes in page.attributes("a") if attributes["href"][0] == "#")
    assert all(attributes["aria-labelledby"] in names for attributes in page.attributes("section"))


def test_names_are_unique(page):
    names = [attributes["id"] for _, attributes in page.tags if "id" in attributes]
    assert len(names) == len(set(names))


EVIL = "</script><script>alert('1')</script> & \"q\" $x^2$ {{ 7 * 7 }}"


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
    # Claim twice, name, purpose, published, note, plan twice, label, refusal, command, environment: all as they came.
    assert page.text.count(EVIL) >= 12
    index = json.loads(page.script("images"))
    assert index["scenes"][0]["name"] == index["scenes"][0]["methods"][0]["label"] == EVIL


@pytest.mark.parametrize("name", ["50$ a$", "$", "a_b^c", "日本", "$\\frac{$"])
@pytest.mark.filterwarnings("ignore:Glyph .* missing from font")
def test_scene_may_have_any_name_in_the_chart(data, name):
    """A dollar begins mathematics in matplotlib; half a formula would end the report after all its work."""
    data["scenes"][0]["name"] = name
    assert speed_error_chart(data["scenes"]).startswith("<svg")


def test_missing_values_are_dashes(data, folder):
    scene = data["scenes"][0]
    scene["truth"] |= {"mean": None, "relative_bound": None, "missed": None}
    scene["methods"][0]["error"] |= {"relative_rmse": None, "relative_bias": None, "p50": None, "p99": None}
    scene["methods"].append(refused("bad", "no series"))
    scene["agreement"]["airlight"]["statistics"] |= {
        "relative_bias": None,
        "relative_bias_ci": [None, None],
        "detectable_bias": None,
        "equivalent": None,
        "z_mean": None,
        "z_std": None,
    }
    text = render(data, folder).text
    assert "None" not in text
    assert "nan" not in text.lower().replace("airlight", "").split()
    assert DASH in text
    assert "refused: no series" in text
    assert "NO" in text


def test_scene_without_agreement_and_published_figure(data, folder):
    data["scenes"][0] |= {"agreement": {}, "published": ""}
    page = render(data, folder)
    assert len(page.tables) == 9
    assert "Answers to" not in page.text


def test_scene_of_which_everything_was_refused_has_no_viewer(data, folder):
    blank = report_data()["scenes"][0] | {"name": "dark", "methods": [refused("x", "too dark")]}
    page = render(data | {"scenes": [blank, data["scenes"][0]]}, folder)
    assert len([1 for _, attributes in page.tags if attributes.get("class") == "viewer"]) == 1
    assert [scene["name"] for scene in json.loads(page.script("images"))["scenes"]] == ["hall"]
    assert "viewer-0" in {attributes.get("id") for _, attributes in page.tags}


def test_failures_are_marked_and_not_by_colour_alone(data, folder):
    statistics = data["scenes"][0]["agreement"]["surface"]["statistics"]
    data["scenes"][0]["agreement"]["surface"]["statistics"] = statistics | {"equivalent": False}
    data["scenes"][0]["methods"][0]["error"]["nonfinite"] = 9
    data["claims"] = [{"kind": "truth", "text": "The truth is NOT confirmed.", "good": False}]
    page = render(data, folder)
    marked = [tag for tag, attributes in page.tags if "bad" in (attributes.get("class") or "").split()]
    # Claim, words for who has no scripts; trust, a shadow ray that is not settled, agreement, not finite.
    assert sorted(marked) == ["li", "p", "td", "td", "td", "td"]
    assert "NO" in page.text
    assert "Truth NOT confirmed in 1 of 2 comparisons" in page.text
    assert "does not hold: The truth is NOT confirmed." in page.text


def test_agreement_that_ran_out_of_time_is_neither_yes_nor_no(data, folder):
    late = data["scenes"][0]["agreement"]["airlight"]
    late["statistics"] = late["statistics"] | {"equivalent": False, "relative_bias_ci": [-0.01, 0.002]}
    late["finished"] = False
    assert "not decided in time" in render(data, folder).text


def test_method_without_shadows_is_marked_where_there_are_shadows(data, folder):
    assert render(data, folder).text.count("(no shadows)") == 1
    data["scenes"][0]["plan"]["shadows"] = "none: nothing casts a shadow"
    assert "(no shadows)" not in render(data, folder).text


def test_image_of_an_engine_has_no_times_and_says_what_is_judged(data, folder):
    data["scenes"][0]["methods"].append(engine_image())
    page = render(data, folder)
    assert "(image, total)" in page.text
    assert set(json.loads(page.script("images"))["scenes"][0]["methods"][2]["layers"]) == {"total"}


def test_viewer_begins_with_the_fastest_within_one_per_cent(data, folder):
    good, flat = data["scenes"][0]["methods"]
    good["error"]["relative_rmse"] = flat["error"]["relative_rmse"] = 0.001
    flat["times"] = flat["times"] | {"frame": timing(1.0)}

    def first():
        (viewer,) = (a for _, a in render(data, folder).tags if a.get("class") == "viewer")
        return viewer["data-method"]

    assert first() == "1"
    flat["error"]["nonfinite"] = 1  # pixels that are left out of the error must not win
    assert first() == "0"
    good["error"]["relative_rmse"], flat["error"] = 0.5, flat["error"] | {"relative_rmse": 0.4, "nonfinite": 0}
    assert first() == "1"


def test_the_scene_with_the_most_edges_of_shadow_leads(data, folder):
    plain = report_data()["scenes"][0] | {"name": "plain"}
    plain["truth"] = plain["truth"] | {"transitions": 3}
    text = render(data | {"scenes": [plain, data["scenes"][0]]}, folder).text
    assert "hall: the truth, a method and its error" in text
    assert text.index("hall: the truth") < text.index("Can the truth be trusted?") < text.index("The fastest method")


def test_charts_of_one_page_share_no_names(data):
    lead, every = scene_chart(data["scenes"], 0), speed_error_chart(data["scenes"])
    names = [re.findall(r'id="([^"]+)"', chart) for chart in (lead, every)]
    assert len(set(names[0] + names[1])) == len(names[0]) + len(names[1])
    assert {"point-0", "point-1"} <= set(names[0])
    assert "<title>good (k): 3.21 ms, relative RMSE 0.012</title>" in lead


def test_what_is_wrong_as_published_is_a_peer_and_stands_last(data, folder):
    data["scenes"][0]["methods"].insert(0, method("shadow-planes (exact, order=none)", parameters={"order": "none"}))
    page = render(data, folder)
    rows = page.source[page.source.index("<caption>Times and errors") :]
    assert rows.index('<th scope="row" style="text-align:left">flat') < rows.index("order=none")
    assert "published peer, Biri 2006 without its stencil" in page.text


def test_columns_are_explained_below_their_table(page):
    assert page.text.count("What the columns mean") == 2  # methods, agreement
    assert "root of the mean squared error over the mean of the truth" in page.text


def test_entry_that_is_missing_is_an_error_rather_than_a_blank(data, folder):
    import jinja2

    del data["scenes"][0]["truth"]["mean"]
    with pytest.raises((jinja2.UndefinedError, TypeError)):
        render_page(data, folder)


def test_page_that_cannot_be_made_small_enough_is_refused(data, folder):
    with pytest.raises(InputError, match="MB"):
        render_page(data, folder, limit=2_500_100)


def test_same_data_give_the_same_page(data, folder):
    assert render_page(data, folder) == render_page(report_data(), folder)


def test_chart_is_the_same_for_the_same_data(data):
    assert speed_error_chart(data["scenes"]) == speed_error_chart(report_data()["scenes"])


@pytest.mark.parametrize("count", [1, 2, 3])
def test_chart_has_a_panel_for_each_scene_and_names_every_method(count):
    scenes = [report_data()["scenes"][0] | {"name": f"scene{k}"} for k in range(count)]
    scenes[-1]["methods"].append(method("third"))
    svg = speed_error_chart(scenes)
    assert all(f">scene{k}<" in svg for k in range(count))
    assert all(svg.count(f">{label}<") == 1 for label in ("good (k)", "flat", "third"))


def test_chart_leaves_out_what_has_no_place_on_a_logarithmic_axis(data):
    """Refused, without an error, without any error at all, without times: no point, no warning, no crash."""
    scene = data["scenes"][0]
    scene["methods"] = [
        refused("refused", "x"),
        method("none", error={"relative_rmse": None}),
        method("exact", error={"relative_rmse": 0.0}),
        engine_image(),
    ]
    assert ">exact<" in speed_error_chart([scene])


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, DASH),
        (0, "0"),
        (0.0, "0"),
        (1234.5, "1.23·10³"),
        (0.00123, "0.00123"),
        (2e-5, "2·10⁻⁵"),
        (-4.56e-7, "-4.56·10⁻⁷"),
        (99.95, "100"),
        (12, "12"),
    ],
)
def test_number(value, text):
    assert number(value) == text


def test_percent_and_words():
    assert percent(None) == words(None) == DASH
    assert percent(0.01234) == "1.23 %"
    assert words({"a": [1, 2, 3], "b": True, "c": []}) == f"a 1, 2, 3, b yes, c {DASH}"
    assert words([320, 240]) == "320 \N{MULTIPLICATION SIGN} 240"


def test_page_says_what_came_from_earlier_runs(data, folder):
    assert kept_words(data) == ""
    data["kept"] = 7
    assert "7 of 16 results were kept from earlier runs" in render(data, folder).text


def test_page_says_where_the_time_went_and_when_it_was_measured(data, folder):
    data["measured"] = {"first": "2026-11-20 01:02:03 +0000", "last": "2026-11-21 04:05:06 +0000"}
    data["scenes"][0]["seconds"] = {"truth": 0.9, "methods": 16.2}
    page = render(data, folder)
    assert "between 2026-11-20 01:02:03 +0000 and 2026-11-21 04:05:06 +0000" in page.text
    assert set(widths(table_of(page, "Where the time went"))) == {3}
    assert "16.2" in page.text


def test_same_picture_gives_the_same_bytes():
    picture = np.random.default_rng(0).integers(0, 255, (4, 5, 3), dtype=np.uint8)
    assert png_bytes(picture) == png_bytes(picture.copy())


def test_kernels_have_a_table_where_they_were_tried(data, folder):
    page = render(data | {"stability": STABILITY}, folder)
    assert "my-kernel" in page.text
    assert "4.5·10⁻⁶" in page.text
    assert "my-kernel breaks what it claims: law of scale" in page.text
    assert "bad" in [attributes.get("class") for attributes in page.attributes("td")]
    assert set(widths(table_of(page, "Stability of the kernels"))) == {9}
    assert "Where kernels break" not in render(data, folder).text


def test_missing_flip_is_a_note_and_a_dash(data, folder):
    data["scenes"][0]["methods"][0]["flip"] = {"value": None, "note": "flip-evaluator is not installed"}
    text = render(data, folder).text
    assert "No HDR-FLIP for some of these: flip-evaluator is not installed." in text
    assert text.count("No HDR-FLIP") == 1


def test_mutations_have_a_table_where_they_were_tried(data, folder):
    data["mutations"] = MUTATIONS
    text = render(data, folder).text
    assert "0 of 1 faults of the physics" in text
    assert "no-falloff" in text
    assert "too small" in text


def test_page_shows_how_times_grow(data, folder):
    assert "As the work grows" not in render(data, folder).text
    data["scaling"] = [growth_record()]
    page = render(data, folder)
    assert ("a", {"href": "#scaling"}) in page.tags
    assert "hall by triangles, 80 \N{MULTIPLICATION SIGN} 60" in page.text
    assert "0.47" in page.text
