# SPDX-License-Identifier: BSD-3-Clause
"""Claims: the pages build without a warning, load nothing from a network, and name
only commands that exist.
"""

import importlib
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

from airlight.reports.commands.main import command_names, find_command

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"


class Loaded(HTMLParser):
    """Collects what a page makes a browser load."""

    def __init__(self):
        super().__init__()
        self.resources = []

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        if tag == "link" and values.get("rel") not in (
            "index",
            "search",
            "next",
            "prev",
            "canonical",
        ):
            self.resources.append(values["href"])
        if tag in ("script", "img", "iframe", "source", "video", "audio", "embed", "object", "use"):
            addresses = ("src", "data", "srcset", "href", "xlink:href")
            self.resources += [values[name] for name in addresses if name in values]


@pytest.mark.slow
@pytest.mark.claim("docs-without-a-network")
def test_pages_build_and_load_nothing_from_a_network(tmp_path):
    """Sphinx checks links, names of functions, formulas, and that each claim has a test."""
    command = [
        sys.executable,
        "-m",
        "sphinx",
        "-W",
        "--keep-going",
        "-q",
        "-b",
        "html",
        "-d",
        str(tmp_path / "trees"),
    ]
    ran = subprocess.run(
        [*command, str(DOCS), str(tmp_path / "pages")], capture_output=True, text=True
    )
    assert ran.returncode == 0, ran.stderr
    pages = list((tmp_path / "pages").glob("*.html"))
    assert len(pages) > 15
    for page in pages:
        text = page.read_text(encoding="utf-8")
        loaded = Loaded()
        loaded.feed(text)
        for address in loaded.resources:
            assert not re.match(r"(https?:)?//", address), (page.name, address)
            local = address.split("?")[0].split("#")[0]
            assert not local or local.startswith("data:") or (page.parent / local).exists(), (
                page.name,
                address,
            )
    for path in (tmp_path / "pages").rglob("*.css"):
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"(url\(\s*['\"]?|@import\s+['\"])(https?:)?//", text), path


@pytest.mark.claim("documented-commands")
def test_commands_and_options_that_documents_name_exist():
    """In blocks of shell and in code between backticks that begins with `airlight`."""
    known = {
        " ".join(words): {
            name
            for each in find_command(words).assemble_argument_collection()
            for name in each.names
        }
        for words in command_names()
    } | {"study": set()}
    found, wrong = 0, []
    for document in sorted([*ROOT.glob("*.md"), *DOCS.rglob("*.md"), DOCS / "claims.toml"]):
        if document.name == "CHANGELOG.md":
            continue  # tells of commands that have gone
        text = document.read_text(encoding="utf-8")
        blocks = re.findall(r"^```sh\n(.*?)^```", text, flags=re.DOTALL | re.MULTILINE)
        lines = [line for block in blocks for line in block.splitlines()]
        lines += re.findall(
            r"`([^`]+)`", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
        )
        for line in lines:
            match = re.match(
                r"(?:\./)?airlight\s+((?:study|challenge) [a-z-]+|[a-z]+)\b(.*)",
                line,
                flags=re.DOTALL,
            )
            if match is None or match[1] == "test":
                continue
            found += 1
            options = set(re.findall(r"(?<!\w)--?[a-z][a-z-]*", match[2]))
            if match[1] not in known or options - known[match[1]] - {"--help"}:
                wrong.append((document.name, line))
    assert wrong == []
    assert found > 40


def test_links_of_the_readme_lead_somewhere():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    targets = [
        target
        for target in re.findall(r"\]\(([^)\s]+)\)", text)
        if not re.match(r"https?:", target)
    ]
    assert targets
    for target in targets:
        path, _, anchor = target.partition("#")
        linked = ROOT / (path or "README.md")
        assert linked.exists(), target
        if anchor:
            headings = re.findall(
                r"^#+ (.*)", linked.read_text(encoding="utf-8"), flags=re.MULTILINE
            )
            assert anchor in [
                re.sub(r"[^\w -]", "", words.lower()).replace(" ", "-") for words in headings
            ], target


def test_formulas_are_mathml_and_slips_are_named(monkeypatch):
    from sphinx.errors import ExtensionError

    monkeypatch.syspath_prepend(str(DOCS / "_ext"))
    markup = importlib.import_module("mathml").markup
    assert 'display="block"' in markup(r"\frac{a}{b}", block=True)
    for slip in (r"\fraction{a}{b}", r"\frac{a}", r"\frac{a", "x_{", "x^", "a & b", r"\sqrt"):
        with pytest.raises(ExtensionError, match="formula"):
            markup(slip, block=False)


@pytest.mark.claim("errata-of-biri", tolerance="1e-7 relative")
def test_the_derived_coefficients_of_the_errata_are_those_of_the_program():
    from airlight.analytic.phase import phase_from_words
    from airlight.analytic.series import taylor_coefficients

    means = {"isotropic": 1, "rayleigh": 1, "hazy": 2, "murky": 83 / 33}
    text = (DOCS / "papers.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (\w+) \$c_(\d)\$ \| \$(.*?)\$ \| (.*?) \|$", text, flags=re.MULTILINE)
    assert len(rows) == 7
    for name, index, printed, derived in rows:
        same = derived == "the same"
        for a in (0.3, 1.7):
            coefficients = taylor_coefficients(a, phase_from_words(name.lower()))
            expected = float(coefficients[..., int(index)]) * means[name.lower()]
            assert _value(printed if same else derived.strip("$"), a) == pytest.approx(
                expected, rel=1e-7
            )
            assert same or abs(_value(printed, a) - expected) > 1e-8


def _value(formula, a):
    words = formula.replace("^{31}", "**31").replace("^", "**")
    words = re.sub(r"(\d) ?(a|\()", r"\1*\2", words)
    assert re.fullmatch(r"[\da+\-*/(). ]+", words), words
    return eval(words, {"a": a})
