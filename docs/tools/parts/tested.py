# SPDX-License-Identifier: BSD-3-Clause
"""Every claim with the tests that protect it, and the last run of all tests."""

import ast
import json
import tomllib
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]


def tested_claims() -> str:
    """Return the claims of `docs/claims.toml` by topic, each with its tests, their
    tier and what they allow.

    A claim without a test, or a test of a claim that is not listed, ends the work.
    """
    topics = tomllib.loads((ROOT / "docs/claims.toml").read_text(encoding="utf-8"))
    tests: dict[str, list[str]] = {}
    # Tests are read, not imported: the page needs no Mitsuba.
    for path in sorted((ROOT / "tests").rglob("test_*.py")):
        for claim, line in _marks(path):
            tests.setdefault(claim, []).append(line)
    listed = {claim for claims in topics.values() for claim in claims}
    if wrong := sorted(listed ^ set(tests)):
        raise SystemExit(
            f"docs/claims.toml: claims without a test, or tests of no claim: {', '.join(wrong)}"
        )
    # Topics and claims in the order of the file.
    lines = []
    for topic, claims in topics.items():
        lines += [f"## {topic}", ""]
        for claim, words in claims.items():
            lines += [f"**{words}**", "", *dict.fromkeys(tests[claim]), ""]
    return "\n".join(lines)


def _marks(path: Path) -> Iterator[tuple[str, str]]:
    """Yield each claim that a file of tests names, with a line on the test."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    module = path.relative_to(ROOT).as_posix()
    # Marks of a module hold for each of its tests, marks of a test for itself.
    of_all = [
        node
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "pytestmark"
    ]
    marked = [("", of_all)] + [
        (f"::{node.name}", [*of_all, *node.decorator_list])
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")
    ]
    for name, expressions in marked:
        words = " ".join(ast.unparse(each) for each in expressions)
        # The tier of a test may come from the mark of its module.
        tiers = [tier for tier in ("statistical", "slow") if f"mark.{tier}" in words] or ["default"]
        for call in (
            node for each in expressions for node in ast.walk(each) if isinstance(node, ast.Call)
        ):
            if ast.unparse(call.func) == "pytest.mark.claim" and (
                name or call in ast.walk(of_all[0])
            ):
                allowed = [ast.literal_eval(option.value) for option in call.keywords]
                line = f"- `{module}{name}` ({', '.join([*tiers, *allowed])})"
                for claim in call.args:
                    yield ast.literal_eval(claim), line


def last_run() -> str:
    """Return when all tests were run, on which machine, and what came of it."""
    path = ROOT / "docs/data/full_run.json"
    if not path.exists():
        return "No run of all tests is on record."
    run = json.loads(path.read_text(encoding="utf-8"))
    outcome = ", ".join(f"{run[name]} {name}" for name in ("passed", "failed", "skipped"))
    words = f"{outcome} in {run['seconds'] / 60:.0f} minutes"
    compiled = f"kernels compiled {'quickly' if run.get('compilation') == 'quick' else 'in full'}"
    return (
        f"{run['date'][:10]}, commit {run['commit'][:12]}, {run['machine']}, {compiled}: {words}."
    )
