# SPDX-License-Identifier: BSD-3-Clause
"""The documentation builds without a warning, holds all that the program has, and loads nothing from a network."""

import importlib
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
import typer

from reports.docs.build import build_docs, source_folder
from reports.machine.environment import MissingError

DOCS = Path(__file__).resolve().parents[3] / "docs"


@pytest.fixture
def extension(monkeypatch):
    """Return the function that imports one of the documentation's own extensions."""
    monkeypatch.syspath_prepend(str(DOCS / "_ext"))
    return importlib.import_module


def page(name):
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


# --- the build -------------------------------------------------------------------------------------------------------


class Loaded(HTMLParser):
    """Collects what a page makes a browser load, and its headings and formulas."""

    def __init__(self):
        super().__init__()
        self.resources, self.formulas, self.without_words = [], 0, []

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.formulas += tag == "math"
        if tag == "link" and values.get("rel") not in ("index", "search", "next", "prev", "canonical"):
            self.resources.append(values["href"])
        if tag in ("script", "img", "iframe", "source", "video", "audio", "embed", "object", "use"):
            addresses = ("src", "data", "srcset", "href", "xlink:href")
            self.resources += [values[name] for name in addresses if name in values]
        if tag == "img" and not values.get("alt"):
            self.without_words.append(values["src"])


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    complaints = build_docs(source_folder(), folder)
    assert complaints == ""
    return folder


@pytest.mark.claim("docs-without-a-network")
@pytest.mark.slow
def test_pages_hold_everything_and_load_nothing_from_a_network(built):
    from realtime.kernels.registry import KERNELS
    from realtime.methods.registry import METHODS
    from reports.commands.main import app
    from validation.scenes.registry import SCENES

    pages = {path.stem: path.read_text(encoding="utf-8") for path in built.glob("*.html")}
    loaded = {}
    for name, text in pages.items():
        loaded[name] = Loaded()
        loaded[name].feed(text)
        outside = [address for address in loaded[name].resources if re.match(r"(https?:)?//", address)]
        assert not outside, (name, outside)
        assert not loaded[name].without_words, (name, loaded[name].without_words)
        for address in loaded[name].resources:
            local = address.split("?")[0].split("#")[0]
            assert not local or local.startswith("data:") or (built / local).exists(), (name, address)
    for path in built.rglob("*.css"):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"(url\(\s*['\"]?|@import\s+['\"])(https?:)?//", text), path
    for name in METHODS:
        assert "How wrong it is".lower() in pages[name].lower(), name
        assert f'href="{name}.html"' in pages["methods"], name
        assert loaded[name].resources, name
    for name, where in [*((kernel, "kernels") for kernel in KERNELS), *((scene, "scenes") for scene in SCENES)]:
        assert f">{name}<" in pages[where], name
    for name, command in typer.main.get_group(app).commands.items():
        assert (f'id="airlight-{name}"' in pages["commands"]) != command.hidden, name
    assert loaded["conventions"].formulas > 40
    assert "<!-- generated" not in "".join(pages.values())


@pytest.mark.slow
def test_every_public_name_has_its_docstring(built):
    import airlight

    text = (built / "api.html").read_text(encoding="utf-8")
    for name in airlight._API:
        value = getattr(airlight, name)
        if isinstance(value, type) or callable(value):
            assert f'id="{value.__module__}.{name}"' in text, name
    assert "Width and height [pixels]" in text


def test_what_is_missing_is_named_with_the_line_that_installs_it(monkeypatch, tmp_path):
    from reports.docs import build as docs_build

    monkeypatch.setattr(docs_build.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingError, match=r"sphinx, myst-parser, furo.*pip install"):
        build_docs(DOCS, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_the_command_fails_with_sphinx_own_words(monkeypatch, capsys, tmp_path):
    from reports.commands.main import run

    monkeypatch.setattr("reports.docs.build.build_docs", lambda source, output: "index.md:3: WARNING: no such thing")
    assert run(["docs", "-o", str(tmp_path)]) == 1
    assert "index.md:3: WARNING: no such thing" in capsys.readouterr().out
    monkeypatch.setattr("reports.docs.build.build_docs", lambda source, output: "")
    assert run(["docs", "-o", str(tmp_path)]) == 0
    assert str(tmp_path / "index.html") in capsys.readouterr().out


# --- what is made from the program and from the report ---------------------------------------------------------------


def test_every_method_kernel_and_scene_has_its_place(extension):
    from realtime.kernels.registry import KERNELS
    from realtime.methods.registry import METHODS

    fill = extension("generated").fill
    for name, record in METHODS.items():
        assert f"<!-- generated: method {name} -->" in page(name), name
        text = fill(page(name))
        assert f"[`{name}`]({name}.md)" in fill("<!-- generated: methods -->")
        for parameter, default in record.defaults.items():
            said = f"{default:g}" if isinstance(default, float) else str(default)
            assert re.search(rf"`{parameter}` \| `?{said}\b|`{parameter}={said}`", text), (name, parameter)
    for name in KERNELS:
        assert f"| `{name}` |" in fill("<!-- generated: kernels -->")


def test_a_method_s_table_holds_the_numbers_of_the_report(extension):
    from reports.tables.table import number

    measured = extension("measured")
    table = measured.method("shadow-planes")
    entries = [
        (scene["name"], entry)
        for scene in measured.data()["scenes"]
        for entry in scene["methods"]
        if entry["method"] == "shadow-planes" and entry["error"]
    ]
    assert entries
    for scene, entry in entries:
        beginning = f"| `{scene}` | {measured._inside(entry['label'])} |"
        row = next(line for line in table.splitlines() if line.startswith(beginning))
        assert f"| {number(entry['error']['relative_rmse'], 2)} |" in row
        if entry["times"]:
            assert f"| {number(entry['times']['frame']['median_ms'])} |" in row
    assert measured.data()["report"]["created"][:10] in table
    assert "did not measure" in measured.method("no-such-method")


def test_a_mark_that_names_nothing_is_an_error(extension):
    from sphinx.errors import ExtensionError

    with pytest.raises(ExtensionError, match=r"no-such-part.*wanted one of"):
        extension("generated").fill("<!-- generated: no-such-part -->")


def test_links_to_source_are_the_names_of_the_files(extension):
    generated = extension("generated")
    text = ["See [`spheres.py`](../reference/visibility/spheres.py) and [it](../CONTRIBUTING.md)."]
    generated._replace(None, "page", text)
    assert text == ["See `spheres.py` and [it](contributing.md)."]


def test_formulas_are_mathml_and_slips_are_named(extension):
    from sphinx.errors import ExtensionError

    markup = extension("mathml").markup
    assert markup(r"h \tan\theta", block=False).count("<mspace") == 2
    assert "<mspace" not in markup(r"\exp(-a)", block=False)
    assert 'display="block"' in markup(r"\frac{a}{b}", block=True)
    for slip in (r"\fraction{a}{b}", r"\frac{a}", r"\frac{a", "x_{", "x^", "a & b", r"\sqrt"):
        with pytest.raises(ExtensionError, match="formula"):
            markup(slip, block=False)


def test_no_page_sets_a_formula_in_typewriter_letters():
    """Text that is set in by four outside a list is a literal block, which only formulas were."""
    for path in sorted(DOCS.glob("*.md")):
        text = re.sub(r"^( *)```.*?^\1```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
        assert not re.findall(r"(?<=\n\n)    \S.*", text), path.name


def test_every_scene_and_method_has_its_picture_and_command(extension):
    from realtime.methods.registry import FOG_METHODS, METHODS
    from validation.scenes.registry import SCENES

    fill = extension("generated").fill
    scenes, methods = fill("<!-- generated: gallery-scenes -->"), fill("<!-- generated: gallery-methods -->")
    for name in SCENES:
        assert f"](gallery/scene-{name}.jpg)" in scenes, name
        assert f"`airlight render {name} --method " in scenes, name
        assert f"](gallery/scene-{name}.jpg)" in fill("<!-- generated: scenes -->"), name
    for name in METHODS:
        assert f"](gallery/method-{name}.jpg)" in methods, name
        first = page(name).index(f"<!-- generated: pictures {name} -->")
        assert first < page(name).index("\n## "), name
        if name in FOG_METHODS:
            assert f"relative RMSE {extension('shown').number(_error(extension, name), 2)}" in fill(page(name)), name


def _error(extension, name):
    return extension("shown").kept()[f"method-{name}-error"]["relative_rmse"]


def test_docstrings_are_shown_as_they_stand(extension):
    plain = extension("plain_docstrings")
    assert plain.escaped("|x| is a*b, see *Title* and x_n_") == r"\|x| is a\*b, see *Title* and x_n\_"
    assert plain.escaped("``|x|`` and `a*b`") == "``|x|`` and `a*b`"
    assert plain.formulas_as_blocks(["The law:", "", "    y = x", "", "holds."]) == [
        "The law:",
        "",
        "::",
        "",
        "    y = x",
        "",
        "holds.",
    ]
    sections = ["Parameters", "----------", "x", "    A length [m].", "", "y", "    Another."]
    assert plain.formulas_as_blocks(sections) == sections
    assert plain.hanging_lists(["* one", "more", "* two", "", "text"]) == ["* one", "  more", "* two", "", "text"]


# --- what the pages say ----------------------------------------------------------------------------------------------


@pytest.mark.claim("errata-of-biri", tolerance="1e-7 relative")
def test_the_derived_coefficients_of_the_errata_are_those_of_the_program():
    from analytic.phase import PhaseFunction
    from analytic.series import taylor_coefficients

    means = {"isotropic": 1, "rayleigh": 1, "hazy": 2, "murky": 83 / 33}
    rows = re.findall(r"^\| (\w+) \$c_(\d)\$ \| \$(.*?)\$ \| (.*?) \|$", page("errata"), flags=re.MULTILINE)
    assert len(rows) == 7
    for name, index, printed, derived in rows:
        name = name.lower()
        same = derived == "the same"
        for a in (0.3, 1.7):
            expected = float(taylor_coefficients(a, PhaseFunction(name))[..., int(index)]) * means[name]
            assert _value(printed if same else derived.strip("$"), a) == pytest.approx(expected, rel=1e-7)
            assert same or abs(_value(printed, a) - expected) > 1e-8


def _value(formula, a):
    words = formula.replace("^{31}", "**31").replace("^", "**")
    words = re.sub(r"(\d) ?(a|\()", r"\1*\2", words)
    assert re.fullmatch(r"[\da+\-*/(). ]+", words), words
    return eval(words, {"a": a})


@pytest.mark.claim("kernel-of-the-page")
def test_the_kernel_of_the_page_on_adding_one(variant, tmp_path, monkeypatch):
    """The snippet is what it says: `equiangular` with twelve steps."""
    import numpy as np

    from analytic.cases import read_cases
    from validation.kernels.cases import integrate_cases

    (code,) = re.findall(r"```python\n(.*?)```", page("extending"), flags=re.DOTALL)
    (tmp_path / "twelve_steps_of_a_page.py").write_text(code)
    monkeypatch.syspath_prepend(str(tmp_path))
    cases = read_cases(DOCS.parent / "validation/certified/airlight_integral.csv")
    kernels = ("twelve_steps_of_a_page:midpoint", "equiangular-12")
    own, expected = (integrate_cases(cases, kernel, "double") for kernel in kernels)
    both = np.isfinite(own) & np.isfinite(expected)
    assert both.mean() > 0.9
    # Operations in another order; where theta nears pi/2 the tangent makes more of their rounding.
    difference = np.abs(own - expected)[both] / np.maximum(np.abs(expected[both]), 1e-300)
    assert np.percentile(difference, 90) < 1e-9
