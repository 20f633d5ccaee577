# SPDX-License-Identifier: BSD-3-Clause
"""Every claim of the documents has a test, every mark a claim, and the page of verification shows them all."""

import re
from pathlib import Path

import pytest

from reports.docs.verification import ROOT, Claim, Mark, current_page, duration, headings, page, read_claims, read_marks

CLAIMS = read_claims()
MARKS = read_marks()


def test_every_claim_has_a_test():
    assert set(CLAIMS) - {mark.claim for mark in MARKS} == set()


def test_every_mark_names_a_claim():
    unknown = [(mark.module, mark.test, mark.claim) for mark in MARKS if mark.claim not in CLAIMS]
    assert unknown == []


def test_claims_are_stated_where_they_say_with_the_same_numbers():
    documents = {path: (ROOT / path).read_text(encoding="utf-8") for path in _documents()}
    for claim in CLAIMS.values():
        assert claim.stated, claim.identifier
        sections = ""
        for stated in claim.stated:
            path, _, anchor = stated.partition("#")
            assert anchor in headings(documents[path]), (claim.identifier, stated)
            sections += _section(documents[path], headings(documents[path])[anchor])
        for number in re.findall(r"\d+(?:\.\d+)?(?:e-?\d+)?", claim.says):
            assert re.search(rf"(?<![\d.]){re.escape(number)}(?!\d)", sections), (claim.identifier, number)


def _documents() -> set[str]:
    return {stated.partition("#")[0] for claim in CLAIMS.values() for stated in claim.stated}


def _section(document: str, title: str) -> str:
    """Return what stands between a heading and the next one."""
    text = document.split(f"# {title}\n", 1)[1]
    return re.split(r"^#+ ", text, flags=re.MULTILINE)[0]


def test_every_document_with_a_statement_has_claims():
    """Pages that state nothing of their own: of contents, of what is to be done, and those made from the code."""
    without = {"index", "api", "changelog", "contributing", "verification"}
    pages = {path.name for path in (ROOT / "docs").glob("*.md")}
    stated = {Path(path).name for path in _documents()}
    assert pages - stated == {f"{name}.md" for name in without}
    assert {"README.md", "CONTRIBUTING.md"} <= stated


def test_every_mutation_would_break_one_claim():
    from validation.mutations.catalogue import MUTATIONS

    named = [name for claim in CLAIMS.values() for name in claim.mutations]
    assert sorted(named) == sorted(mutation.name for mutation in MUTATIONS)


def test_the_page_is_up_to_date():
    text = (ROOT / "docs/verification.md").read_text(encoding="utf-8")
    assert text == current_page(), "run `python -m reports.docs.verification`"


def test_marks_are_read_from_functions_and_modules_with_their_tiers(tmp_path):
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests/test_a.py").write_text(
        "import pytest\n"
        'pytestmark = [pytest.mark.claim("of-all"), pytest.mark.statistical]\n'
        '@pytest.mark.claim("one", "two", tolerance="1e-3")\n'
        "@pytest.mark.slow\n"
        "def test_first(): pass\n"
        '@pytest.mark.claim("one")\n'
        '@pytest.mark.parametrize("x", [1, pytest.param(2, marks=pytest.mark.slow)])\n'
        "def test_second(x): pass\n"
    )
    assert read_marks(tmp_path) == [
        Mark("of-all", "tests/test_a.py", "", "statistical", ""),
        Mark("one", "tests/test_a.py", "test_first", "statistical and slow", "1e-3"),
        Mark("two", "tests/test_a.py", "test_first", "statistical and slow", "1e-3"),
        Mark("one", "tests/test_a.py", "test_second", "statistical and unit and slow", ""),
    ]
    (tmp_path / "tests/test_b.py").write_text("@pytest.mark.claim(NAME)\ndef test_third(): pass\n")
    with pytest.raises(ValueError, match=r"test_b\.py, line 1: write the arguments"):
        read_marks(tmp_path)


def test_the_page_shows_claims_and_the_last_full_run():
    empty = "before\n<!-- claims: begin -->\nold\n<!-- claims: end -->\n"
    empty += "<!-- full run: begin -->\n<!-- full run: end -->\n"
    claim = Claim("limits", "Topic", "It holds.", ("README.md#limits", "docs/kernels.md#the-kernels"), ("a-fault",))
    mark = Mark("limits", "tests/test_a.py", "test_it", "slow", "1e-3")
    record = {
        "date": "2026-11-22 17:00:00 +0000",
        "machine": "a processor, 2 threads",
        "commit": "0c99b83",
        "changed": True,
        "seconds": 187.2,
        "parts": [{"name": "unit", "passed": 4141, "failed": 1, "skipped": 2, "seconds": 61.0, "remark": "so"}],
    }
    assert page(empty, [claim], [mark], record).splitlines() == [
        "before",
        "<!-- claims: begin -->",
        "Claims: 1; tests: 1; mutations: 1.",
        "",
        "## Topic",
        "",
        "**It holds.** (`limits`)",
        "",
        "- Stated in README.md, Limits; [kernels.md, The kernels](kernels.md#the-kernels).",
        "- `tests/test_a.py`: `test_it` (slow; 1e-3)",
        "- Mutations: `a-fault`",
        "<!-- claims: end -->",
        "<!-- full run: begin -->",
        "2026-11-22 17:00:00 +0000, a processor, 2 threads, commit 0c99b83, with changes that were not committed: "
        "3 min 07 s.",
        "",
        "| part | passed | failed | skipped | time | remark |",
        "| --- | ---: | ---: | ---: | ---: | --- |",
        "| unit | 4141 | 1 | 2 | 1 min 01 s | so |",
        "<!-- full run: end -->",
    ]
    assert "No full run has been recorded." in page(empty, [claim], [mark], None)
    assert duration(59.4) == "59 s"
