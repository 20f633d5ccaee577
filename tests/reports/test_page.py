# SPDX-License-Identifier: BSD-3-Clause
import base64
import copy
from html.parser import HTMLParser

import numpy as np
import pytest

from reports.charts import speed_error_chart
from reports.page import _interval, _number, _percent, render_page
from reports.pictures import png_bytes, write_png

EN_DASH = "\N{EN DASH}"
VOID = {"meta", "img", "br", "hr", "link", "input"}


class Page(HTMLParser):
    """The page as a reader of HTML sees it; every tag must be closed in order."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.tags, self.words, self.tables = [], [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag == "table":
            self.tables.append([])
        elif self.tables and "table" in self.open:
            self.tables[-1].append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not {"style", "svg"} & set(self.open):
            self.words.append(data)

    def attributes(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())


def timing(median):
    return {"median_ms": median, "low_ms": 0.9 * median, "high_ms": 1.2 * median, "repetitions": 7}


def method(label, **changes):
    error = {"relative_rmse": 0.0123, "relative_bias": -0.0045, "p50": 0.0011, "p99": 0.0555, "nonfinite": 0}
    return {
        "label": label,
        "refused": None,
        "note": None,
        "knows_shadows": True,
        "times": {name: timing(3.21) for name in ("frame", "surface", "airlight", "rebuild")},
        "error": error,
        "flip": {"value": 0.0321, "note": ""},
        "files": {"picture": "s/a.png", "error": "s/a.png", "exr": "s/a.exr"},
    } | changes


STATISTICS = {
    "relative_bias": 0.00017,
    "relative_bias_ci": [-0.0011, 0.0014],
    "margin": 0.005,
    "equivalent": True,
    "detectable_bias": 0.0021,
    "z_mean": 0.013,
    "z_std": 1.021,
    "rejected": 3,
    "expected_rejections": 0.01,
}
AGREEMENT = {
    "estimator": "volpath",
    "layer": "airlight",
    "width": 160,
    "height": 120,
    "batches": 48,
    "samples": 64,
    "epsilon": 8.94e-4,
    "masked": 11,
    "uncorrected_bias": 0.0013,
    "statistics": STATISTICS,
}
DATA = {
    "schema": "airlight-report/1",
    "created": "2026-11-21 12:34:56 +0000",
    "command": "airlight report --quick",
    "seconds": 12.3,
    "settings": {"name": "quick", "image": [32, 24], "timed": [64, 48]},
    "environment": {"versions": {"airlight": "0.1.0", "mitsuba": "3.9.1"}, "variant": "llvm_ad_rgb", "threads": 2},
    "claims": ["The truth is confirmed.", "hall: the fastest method is good."],
    "scenes": [
        {
            "name": "hall",
            "purpose": "A hall.",
            "published": "Billeter 2010",
            "path": None,
            "size": [32, 24],
            "plan": {"shadows": "visibility tests", "medium": "unbounded"},
            "notes": [],
            "truth": {
                "mean": 0.98765,
                "relative_bound": 1.2e-6,
                "transitions": 4321,
                "missed": 0.0007,
                "checked": 98765,
                "disagreements": 12,
                "refined": 11,
                "left": 1,
            },
            "multiple": {
                "medium": {"value": 0.123, "interval": [0.12, 0.126]},
                "everything": {"value": 0.21, "interval": [0.2, 0.22]},
                "max_depth": 64,
            },
            "agreement": {"airlight": AGREEMENT, "surface": AGREEMENT | {"layer": "surface"}},
            "methods": [method("good (k)"), method("flat", knows_shadows=False)],
            "exposure": 2.5,
            "files": {"picture": "s/a.png"},
        }
    ],
}


@pytest.fixture
def data():
    return copy.deepcopy(DATA)


@pytest.fixture
def folder(tmp_path):
    write_png(tmp_path / "s" / "a.png", np.full((2, 3, 3), 77, dtype=np.uint8))
    return tmp_path


def render(data, folder):
    return Page(render_page(data, folder))


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    write_png(folder / "s" / "a.png", np.full((2, 3, 3), 77, dtype=np.uint8))
    text = render_page(copy.deepcopy(DATA), folder)
    parsed = Page(text)
    parsed.source = text
    parsed.picture = base64.b64encode((folder / "s" / "a.png").read_bytes()).decode()
    return parsed


def test_page_shows_the_numbers_of_the_data(page):
    text = page.text
    for shown in ("1.23 %", "-0.45 %", "5.55 %", "3.21", "312", "0.98765", "4321", "-0.110 … +0.140 %", "±0.5 %", "11"):
        assert shown in text, shown
    for claim in DATA["claims"]:
        assert claim in text
    assert "Answers to: Billeter 2010." in text
    assert "airlight report --quick" in text
    assert "mitsuba 3.9.1" in text


def test_page_needs_nothing_but_itself(page):
    for _, attributes in page.tags:
        for name in ("src", "href", "xlink:href", "data", "poster", "srcset", "action"):
            target = attributes.get(name)
            assert target is None or target.startswith(("data:image/png;base64,", "#")), target
    tags = {tag for tag, _ in page.tags}
    assert not tags & {"script", "link", "iframe", "object", "embed"}
    assert "@import" not in page.source
    assert "url(http" not in page.source


def test_pictures_are_in_the_page_and_have_words_beside_them(page):
    images = page.attributes("img")
    assert len(images) == 1 + 2 * 3
    assert all(image["alt"].strip() for image in images)
    assert sum(image["src"].endswith("," + page.picture) for image in images) == 6
    assert len({image["alt"] for image in images if "error" in image["alt"]}) == 3  # the scale and two methods


def test_tables_have_headers_and_captions(page):
    assert len(page.tables) == 3
    for table in page.tables:
        assert any(tag == "caption" for tag, _ in table)
        headers = [attributes for tag, attributes in table if tag == "th"]
        assert headers
        assert all(attributes.get("scope") in ("col", "row") for attributes in headers)
        rows = sum(tag == "tr" for tag, _ in table)
        # Every row begins with a header of its own but for the row of column headers.
        assert sum(attributes["scope"] == "row" for attributes in headers) >= rows - 1


def test_rows_of_the_methods_are_as_wide_as_their_headers(data, folder):
    data["scenes"][0]["methods"].append(method("bad", refused="no", times=None, error=None, files={}))
    table = render(data, folder).tables[0]
    widths, row = [], 0
    for tag, attributes in table:
        if tag == "tr":
            widths.append(row)
            row = 0
        row += int(attributes.get("colspan", 1)) if tag in ("td", "th") else 0
    widths.append(row)
    assert set(widths[1:]) == {12}


def test_page_has_language_title_and_one_main_heading(page):
    assert page.attributes("html") == [{"lang": "en"}]
    assert "2026-11-21" in page.text
    assert len(page.attributes("h1")) == 1
    assert [attributes["id"] for attributes in page.attributes("h2") if "id" in attributes] == ["hall"]


EVIL = "<script>alert('1')</script> & \"q\" $x^2$ {{ 7 * 7 }}"


def test_names_and_notes_are_words_and_never_html(data, folder):
    scene = data["scenes"][0]
    scene["name"] = scene["purpose"] = scene["published"] = EVIL
    scene["notes"] = [EVIL]
    scene["plan"][EVIL] = EVIL
    scene["methods"][0]["label"] = EVIL
    scene["methods"].append(method("x", refused=EVIL, times=None, error=None, files={}))
    data["claims"].append(EVIL)
    data["command"] = data["environment"]["variant"] = EVIL
    page = render(data, folder)
    assert "script" not in {tag for tag, _ in page.tags}
    # Claim, name, purpose, published, note, plan twice, label, refusal, command, environment: all as they came.
    assert page.text.count(EVIL) >= 10
    assert any(image["alt"].startswith(EVIL) for image in page.attributes("img"))


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
    scene["methods"].append(method("bad", refused="no series", times=None, error=None, files={}))
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
    assert EN_DASH in text
    assert "refused: no series" in text
    assert "NO" in text


def test_scene_without_agreement_and_published_figure(data, folder):
    data["scenes"][0] |= {"agreement": {}, "published": ""}
    page = render(data, folder)
    assert len(page.tables) == 2
    assert "Answers to" not in page.text


def test_failures_are_marked(data, folder):
    statistics = data["scenes"][0]["agreement"]["surface"]["statistics"]
    data["scenes"][0]["agreement"]["surface"]["statistics"] = statistics | {"equivalent": False}
    data["scenes"][0]["methods"][0]["error"]["nonfinite"] = 9
    data["claims"] = ["The truth is NOT confirmed."]
    page = render(data, folder)
    assert sum("bad" in (attributes.get("class") or "") for tag, attributes in page.tags) == 3
    assert "NO, ±0.5 %" in page.text


def test_method_without_shadows_is_marked_where_there_are_shadows(data, folder):
    assert render(data, folder).text.count("(no shadows)") == 1
    data["scenes"][0]["plan"]["shadows"] = "none: nothing casts a shadow"
    assert "(no shadows)" not in render(data, folder).text


def test_entry_that_is_missing_is_an_error_rather_than_a_blank(data, folder):
    import jinja2

    del data["scenes"][0]["truth"]["mean"]
    with pytest.raises((jinja2.UndefinedError, TypeError)):
        render_page(data, folder)


def test_chart_is_the_same_for_the_same_data(data):
    assert speed_error_chart(data["scenes"]) == speed_error_chart(copy.deepcopy(data["scenes"]))


@pytest.mark.parametrize("count", [1, 2, 3])
def test_chart_has_a_panel_for_each_scene_and_names_every_method(data, count):
    scenes = [copy.deepcopy(data["scenes"][0]) | {"name": f"scene{k}"} for k in range(count)]
    scenes[-1]["methods"].append(method("third"))
    svg = speed_error_chart(scenes)
    assert all(f">scene{k}<" in svg for k in range(count))
    assert all(svg.count(f">{label}<") == 1 for label in ("good (k)", "flat", "third"))


def test_chart_leaves_out_what_has_no_place_on_a_logarithmic_axis(data):
    """Refused, without an error, without any error at all: no point, no warning, no crash."""
    scene = data["scenes"][0]
    scene["methods"] = [
        method("refused", refused="x", times=None, error=None),
        method("none", error={"relative_rmse": None}),
        method("exact", error={"relative_rmse": 0.0}),
    ]
    assert ">exact<" in speed_error_chart([scene])


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, EN_DASH),
        (0, "0"),
        (0.0, "0"),
        (1234.5, "1.23·10³"),
        (0.00123, "0.00123"),
        (2e-5, "2.00·10⁻⁵"),
        (-4.56e-7, "-4.56·10⁻⁷"),
        (99.95, "100"),
        (12, "12"),
    ],
)
def test_number(value, text):
    assert _number(value) == text


def test_percent_and_interval():
    assert _percent(None) == _interval(None) == _interval([None, None]) == EN_DASH
    assert _percent(0.01234) == "1.23 %"
    assert _interval([-0.001, 0.0123456]) == "-0.100 … +1.235 %"


def test_same_picture_gives_the_same_bytes():
    picture = np.random.default_rng(0).integers(0, 255, (4, 5, 3), dtype=np.uint8)
    assert png_bytes(picture) == png_bytes(picture.copy())


def test_kernels_have_a_table_where_they_were_tried(data, folder):
    errors = {
        "rays": 77,
        "refused": 5,
        "median": 1.5e-7,
        "p99": 2.5e-6,
        "max": 4.5e-6,
        "nan": 0,
        "infinite": 0,
        "negative": 2,
    }
    kernel = {
        "kernel": "my-kernel",
        "sets": [{"name": "certified", "single": {"all": errors}, "double": {"all": errors}}],
    }
    page = render(data | {"kernels": [kernel]}, folder)
    assert "my-kernel" in page.text
    assert "4.5·10⁻⁶" in page.text
    assert "bad" in [attributes.get("class") for attributes in page.attributes("td")]
    assert "Where kernels break" not in render(data, folder).text


def test_missing_flip_is_a_note_and_a_dash(data, folder):
    data["scenes"][0]["methods"][0]["flip"] = {"value": None, "note": "flip-evaluator is not installed"}
    text = render(data, folder).text
    assert "No HDR-FLIP for some of these: flip-evaluator is not installed." in text
    assert text.count("No HDR-FLIP") == 1


def test_mutations_have_a_table_where_they_were_tried(data, folder):
    one = {"name": "no-falloff", "meaning": "1/r not squared", "estimator": "quadrature", "caught": False}
    data["mutations"] = {"caught": 0, "count": 1, "passed": False, "results": [one | {"reason": "too small"}]}
    text = render(data, folder).text
    assert "0 of 1 faults of the physics" in text
    assert "no-falloff" in text
    assert "too small" in text
