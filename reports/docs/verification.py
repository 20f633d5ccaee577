# SPDX-License-Identifier: BSD-3-Clause
"""The page of verification: every claim of the documents with the tests and mutations that protect it.

`docs/claims.toml` says what is claimed, where it is stated and which mutations would break it. A test names the claims
that it protects, `@pytest.mark.claim("identifier", tolerance="...")`. Both are read as text here, no test is imported.
`docs/verification.md` is made from them and from `docs/data/full_run.json`, which a full run of `./airlight test --all`
writes; a test fails where the page is not what `python -m reports.docs.verification` makes it.
"""

import ast
import json
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reports.docs.marked import with_part

ROOT = Path(__file__).resolve().parents[2]
RECORD = "docs/data/full_run.json"
_PAGE = "docs/verification.md"
_TIERS = ("statistical", "slow")


@dataclass(frozen=True)
class Claim:
    """A statement that a program can check."""

    identifier: str
    topic: str
    says: str
    stated: tuple[str, ...]  #: documents with the anchor of a heading, as in README.md#limits
    mutations: tuple[str, ...]  #: mutations that would break it


@dataclass(frozen=True)
class Mark:
    """One claim of one test, or of a whole module of tests."""

    claim: str
    module: str  #: path from the root
    test: str  #: its name; empty for all tests of the module
    tier: str  #: "unit", "statistical", "slow", or several of these
    tolerance: str


def read_claims(root: Path = ROOT) -> dict[str, Claim]:
    """Return the claims of `docs/claims.toml` by identifier, in its order."""
    topics = tomllib.loads((root / "docs/claims.toml").read_text(encoding="utf-8"))["topic"]
    return {
        name: Claim(name, topic["name"], claim["says"], tuple(claim["stated"]), tuple(claim.get("mutations", ())))
        for topic in topics
        for name, claim in topic["claim"].items()
    }


def read_marks(root: Path = ROOT) -> list[Mark]:
    """Return the marks of all tests, in the order of their files.

    Raises
    ------
    ValueError
        For a mark whose arguments are not written out as strings.
    """
    return [mark for path in sorted((root / "tests").rglob("test_*.py")) for mark in _marks_of(path, root)]


def _marks_of(path: Path, root: Path) -> Iterator[Mark]:
    module = path.relative_to(root).as_posix()
    tree = ast.parse(path.read_text(encoding="utf-8"))
    of_all = [
        node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and any(ast.unparse(target) == "pytestmark" for target in node.targets)
    ]
    for expression in of_all:
        yield from _claims_in(expression, module, "", _tier(of_all))
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            for decorator in node.decorator_list:
                yield from _claims_in(decorator, module, node.name, _tier([*of_all, *node.decorator_list]))


def _claims_in(expression: ast.expr, module: str, test: str, tier: str) -> Iterator[Mark]:
    for node in ast.walk(expression):
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "pytest.mark.claim":
            try:
                names = [ast.literal_eval(argument) for argument in node.args]
                options = {str(option.arg): ast.literal_eval(option.value) for option in node.keywords}
            except ValueError as error:
                raise ValueError(f"{module}, line {node.lineno}: write the arguments of the mark out") from error
            for name in names:
                yield Mark(name, module, test, tier, options.get("tolerance", ""))


def _tier(expressions: Sequence[ast.expr]) -> str:
    """Return the tiers of a test from its marks; if only some parameters are marked, the first tier as well."""
    tiers = []
    for expression in expressions:
        text = ast.unparse(expression)
        names = [name for name in _TIERS if f"pytest.mark.{name}" in text]
        tiers += ["unit", *names] if names and "parametrize" in text else names
    return " and ".join(dict.fromkeys(tiers)) or "unit"


def page(text: str, claims: Iterable[Claim], marks: Sequence[Mark], record: Mapping[str, Any] | None) -> str:
    """Return the page with its generated parts made anew.

    Parameters
    ----------
    text
        The page as it stands; what lies outside the marked parts is kept.
    claims, marks
        What is claimed, and by which tests it is protected.
    record
        What the last full run of all tests wrote; None if there was none.
    """
    for name, content in (("claims", _all_claims(list(claims), marks)), ("full run", _full_run(record))):
        text = with_part(text, name, content)
    return text


def _all_claims(claims: Sequence[Claim], marks: Sequence[Mark]) -> str:
    tests = len({(mark.module, mark.test) for mark in marks})
    mutations = sum(len(claim.mutations) for claim in claims)
    words = [f"Claims: {len(claims)}; tests: {tests}; mutations: {mutations}.", ""]
    topic = ""
    for claim in claims:
        if claim.topic != topic:
            topic = claim.topic
            words += [f"## {topic}", ""]
        words += [f"**{claim.says}** (`{claim.identifier}`)", ""]
        words.append(f"- Stated in {'; '.join(map(_place, claim.stated))}.")
        of_claim = [mark for mark in marks if mark.claim == claim.identifier]
        for module in dict.fromkeys(mark.module for mark in of_claim):
            named = ", ".join(_test(mark) for mark in of_claim if mark.module == module)
            words.append(f"- `{module}`: {named}")
        if claim.mutations:
            words.append(f"- Mutations: {', '.join(f'`{name}`' for name in claim.mutations)}")
        words.append("")
    return "\n".join(words)


def _test(mark: Mark) -> str:
    return f"{f'`{mark.test}`' if mark.test else 'all tests'} ({'; '.join(filter(None, (mark.tier, mark.tolerance)))})"


def headings(document: str) -> dict[str, str]:
    """Return the headings of a Markdown document by the anchors that links name."""
    text = re.sub(r"^```.*?^```", "", document, flags=re.DOTALL | re.MULTILINE)
    titles = re.findall(r"^#+ (.*)", text, flags=re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-"): title for title in titles}


def _place(stated: str) -> str:
    """Return where a claim is stated: a link, or words where the pages of the documentation cannot link."""
    path, _, anchor = stated.partition("#")
    title = headings((ROOT / path).read_text(encoding="utf-8"))[anchor]
    name = path.removeprefix("docs/")
    return f"[{name}, {title}]({name}#{anchor})" if name != path else f"{path}, {title}"


def _full_run(record: Mapping[str, Any] | None) -> str:
    if record is None:
        return "No full run has been recorded.\n"
    keys = ("name", "passed", "failed", "skipped")
    rows = [
        f"| {' | '.join(str(part[key]) for key in keys)} | {duration(part['seconds'])} | {part['remark']} |"
        for part in record["parts"]
    ]
    commit = f"{record['commit']}{', with changes that were not committed' if record['changed'] else ''}"
    return "\n".join(
        [
            f"{record['date']}, {record['machine']}, commit {commit}: {duration(record['seconds'])}.",
            "",
            "| part | passed | failed | skipped | time | remark |",
            "| --- | ---: | ---: | ---: | ---: | --- |",
            *rows,
            "",
        ]
    )


def duration(seconds: float) -> str:
    """Return a time in words, as in 3 min 07 s."""
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


def current_page(root: Path = ROOT) -> str:
    """Return the up-to-date content of `docs/verification.md`."""
    path = root / RECORD
    record = json.loads(path.read_text(encoding="utf-8")) if path.exists() else None
    return page((root / _PAGE).read_text(encoding="utf-8"), read_claims(root).values(), read_marks(root), record)


def redraw(root: Path = ROOT) -> Path:
    """Write `docs/verification.md` anew and return its path."""
    from reference.storage.files import write_text

    write_text(root / _PAGE, current_page(root))
    return root / _PAGE


if __name__ == "__main__":
    print(redraw())
