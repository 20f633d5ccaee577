# SPDX-License-Identifier: BSD-3-Clause
"""How many small faults of the code do the default tests not see?

`python docs/tools/mutations.py` draws a sample of mutations in the rooms that decide what users are
told, makes each in a copy of the checkout, and runs the default tests that run the line. A mutation
survives if all of these pass; one on a line that no test runs survives too. Survivors are written
to `docs/data/mutations.json`: each gets a judgement there, in words, since a mutation may change
nothing that anybody sees.

The mutations are those of Cosmic Ray (`pip install cosmic-ray pytest-cov`): a comparison, an
operator or a number is replaced, a condition is turned, a loop does not run. They are drawn from
all mutations of the rooms with equal chances. The tests of a line come from a run of the default
tests with coverage, whose contexts say which test runs which line; `--baseline` keeps that run for
another draw. A line that runs once, when its file is imported, has the tests that run anything of
the file, and a line that no test runs, or only a process of its own, those that run anything of its
folder. The fastest are run first, and no more of them than take LONGEST. `--again FILES` tries the
survivors of the record by all tests of these files, such as new ones, and keeps their judgements.
`--more` adds another draw to the record, which keeps what survived before.
"""

import argparse
import ast
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from queue import SimpleQueue
from typing import Any
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[2]
RECORD = ROOT / "docs/data/mutations.json"
ROOMS = (
    "reports/api",
    "validation/motion",
    "validation/engine",
    "validation/papers",
    "validation/study",
    "realtime/methods",
)
# each of one kind: two comparisons that differ in equality alone are one mutation here
OPERATORS = (
    "AddNot",
    "NumberReplacer",
    "ReplaceAndWithOr",
    "ReplaceOrWithAnd",
    "ReplaceTrueWithFalse",
    "ReplaceFalseWithTrue",
    "ReplaceUnaryOperator_Delete_Not",
    "ReplaceUnaryOperator_Delete_USub",
    "ReplaceBinaryOperator_Add_Sub",
    "ReplaceBinaryOperator_Sub_Add",
    "ReplaceBinaryOperator_Mul_Div",
    "ReplaceBinaryOperator_Div_Mul",
    "ReplaceComparisonOperator_Eq_NotEq",
    "ReplaceComparisonOperator_NotEq_Eq",
    "ReplaceComparisonOperator_Lt_GtE",
    "ReplaceComparisonOperator_Gt_LtE",
    "ReplaceComparisonOperator_LtE_Lt",
    "ReplaceComparisonOperator_GtE_Gt",
    "ZeroIterationForLoop",
)
#: A mutation may make a loop that never ends. Tests take longer beside other work; a
#: process starts in ten seconds.
PATIENCE, START = 5.0, 60.0
LONGEST = 120.0  #: what the tests of a mutation may take together, without START [s]


@dataclass(frozen=True)
class Mutation:
    """One mutation of a file."""

    path: str  #: from the root of the checkout
    line: int  #: from 1 on
    operator: str  #: Cosmic Ray's name
    occurrence: int  #: its number in the file, among those of the operator


@dataclass(frozen=True)
class Outcome:
    """The answer of the tests to a mutation."""

    mutation: Mutation
    survived: bool
    tests: int  #: how many run the line
    change: str  #: the line before, and after
    judgement: str = ""  #: of a survivor: why nobody would feel it, or the test that it got


def mutations(rooms: Sequence[str]) -> Iterator[Mutation]:
    """Yield all mutations of the files of some rooms."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator

    operators = {name: get_operator(f"core/{name}")() for name in OPERATORS}
    for path in (path for room in rooms for path in sorted((ROOT / room).rglob("*.py"))):
        nodes = list(ast_nodes(get_ast(path.read_text(encoding="utf-8"))))
        for name, operator in operators.items():
            places = [place for node in nodes for place in operator.mutation_positions(node)]
            for occurrence, ((line, _), _) in enumerate(places):
                yield Mutation(path.relative_to(ROOT).as_posix(), line, name, occurrence)


def mutated(mutation: Mutation, text: str) -> str | None:
    """Return the text of a file with a mutation; None if it changes nothing."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    changed = mutate_code(text, get_operator(f"core/{mutation.operator}")(), mutation.occurrence)
    return None if changed in (None, text) else str(changed)


def covering_tests(
    rooms: Sequence[str], folder: Path
) -> tuple[dict[tuple[str, int], set[str]], dict[str, float]]:
    """Return the tests of each line of the rooms, and what each test took [s], from a run
    whose data are in a folder.

    Without data the default tests are run there.
    """
    from coverage import CoverageData

    if not (folder / "tests.xml").exists():
        folder.mkdir(parents=True, exist_ok=True)
        measured = [f"--cov={room}" for room in rooms]
        options = ["--cov-context=test", "--cov-report=", "--cov-fail-under=0"]
        options.append(f"--junit-xml={folder.resolve()}/tests.xml")
        where = os.environ | {"COVERAGE_FILE": str(folder.resolve() / "coverage")}
        subprocess.run(
            [ROOT / "airlight", "test", "-q", *measured, *options], cwd=ROOT, env=where, check=True
        )
    took: dict[str, float] = {}
    for case in ElementTree.parse(folder / "tests.xml").iter("testcase"):
        place = case.get("classname", "").replace(".", "/")
        took[f"{place}.py::{case.get('name')}"] = float(case.get("time", 0))
    data = CoverageData(str(folder / "coverage"))
    data.read()
    tests = defaultdict(set)
    for path in (path for room in rooms for path in sorted((ROOT / room).rglob("*.py"))):
        name = path.relative_to(ROOT).as_posix()
        for file in (file for file in data.measured_files() if file.endswith("/" + name)):
            for line, contexts in data.contexts_by_lineno(file).items():
                # A context is 'tests/a/test_b.py::test_c[d]|run'; what is set
                # up for a test is no test.
                tests[name, line] |= {
                    each.partition("|")[0] for each in contexts if each.endswith("|run")
                }
    return tests, took


def tests_of(
    mutation: Mutation, found: Mapping[tuple[str, int], set[str]], took: Mapping[str, float]
) -> list[str]:
    """Return the tests that run the statement of a mutation, the fastest first."""
    text = (ROOT / mutation.path).read_text(encoding="utf-8")
    around = [each for each in ast.walk(ast.parse(text)) if isinstance(each, ast.stmt)]
    around = [
        each for each in around if _begin(each) <= mutation.line <= (each.end_lineno or each.lineno)
    ]
    innermost = max(around, key=lambda each: each.lineno)
    body = getattr(innermost, "body", None)
    end = body[0].lineno - 1 if body else innermost.end_lineno or innermost.lineno
    tests = set().union(
        *(found.get((mutation.path, line), set()) for line in range(innermost.lineno, end + 1))
    )
    at_import = not any(
        isinstance(each, ast.FunctionDef) and each is not innermost for each in around
    )
    if at_import:
        tests = set().union(*(those for (path, _), those in found.items() if path == mutation.path))
    if not tests:  # the line runs in a process of its own, or never
        folder = mutation.path.rpartition("/")[0] + "/"
        tests = set().union(
            *(those for (path, _), those in found.items() if path.startswith(folder))
        )
    chosen, seconds = [], 0.0
    for test in sorted(tests, key=lambda test: took.get(test, 0.0)):
        seconds += took.get(test, 0.0)
        if chosen and seconds > LONGEST:
            break
        chosen.append(test)
    return chosen


def _begin(statement: ast.stmt) -> int:
    """Return the first line of a statement, that of its first decorator where it has some."""
    return min(
        [statement.lineno, *(each.lineno for each in getattr(statement, "decorator_list", ()))]
    )


def outcome(mutation: Mutation, copy: Path, tests: Sequence[str], seconds: float) -> Outcome:
    """Run tests in a copy of the checkout that has a mutation; they take `seconds` without it."""
    path = copy / mutation.path
    before = path.read_text(encoding="utf-8")
    after = mutated(mutation, before) or before
    lines = [text.splitlines()[mutation.line - 1].strip() for text in (before, after)]
    try:
        path.write_text(after, encoding="utf-8")
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-x",
            "-q",
            "-n",
            "0",
            "-p",
            "no:cacheprovider",
            *tests,
        ]
        limit = START + PATIENCE * seconds
        status = (
            subprocess.run(command, cwd=copy, capture_output=True, timeout=limit).returncode
            if tests
            else 0
        )
    except subprocess.TimeoutExpired:
        status = 1
    finally:
        path.write_text(before, encoding="utf-8")
    return Outcome(mutation, status == 0, len(tests), " -> ".join(lines))


def survey(
    chosen: Sequence[Mutation],
    tests_for: Callable[[Mutation], tuple[Sequence[str], float]],
    jobs: int,
) -> Iterator[Outcome]:
    """Yield the outcome of each mutation; `jobs` of them are tried at a time,
    each in a copy of its own.

    `tests_for`: returns the tests of a mutation, and what they take together [s].
    """
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(jobs) as pool:
        copies: SimpleQueue[Path] = SimpleQueue()
        tracked = subprocess.run(
            ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout
        for number in range(jobs):
            for name in filter(None, tracked.split("\0")):
                place = Path(folder, str(number), name)
                place.parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, place, follow_symlinks=False)
            copies.put(Path(folder, str(number)))

        def tried(mutation: Mutation) -> Outcome:
            copy = copies.get()
            try:
                return outcome(mutation, copy, *tests_for(mutation))
            finally:
                copies.put(copy)

        yield from pool.map(tried, chosen)


def main() -> None:
    """Draw mutations, try them, and write what survived."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rooms", nargs="*", default=ROOMS, help="folders of the checkout")
    parser.add_argument("--sample", type=int, default=300, help="how many mutations are drawn")
    parser.add_argument("--seed", type=int, default=1, help="of the draw")
    parser.add_argument("--jobs", type=int, default=2, help="how many are tried at a time")
    parser.add_argument(
        "--baseline", type=Path, help="folder that keeps the run of all tests; by default none does"
    )
    parser.add_argument(
        "--again",
        nargs="+",
        metavar="FILE",
        help="test files that the survivors of the record meet",
    )
    parser.add_argument("--more", action="store_true", help="add the draw to the record")
    asked = parser.parse_args()
    kept = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.exists() else {}
    if asked.again:
        record = kept
        those = [
            Outcome(**(each | {"mutation": Mutation(**each["mutation"])}))
            for each in record["survivors"]
        ]
        record["survivors"] = []
        for old, each in zip(
            those,
            survey([each.mutation for each in those], lambda _: (asked.again, LONGEST), asked.jobs),
        ):
            if each.survived:
                record["survivors"].append(asdict(replace(old, change=each.change)))
        record |= {"survived": len(record["survivors"])}
        write(record)
        return
    every = list(mutations(asked.rooms))
    chosen = random.Random(asked.seed).sample(every, min(asked.sample, len(every)))
    with tempfile.TemporaryDirectory() as folder:
        found, took = covering_tests(asked.rooms, asked.baseline or Path(folder))

    def tests_for(mutation: Mutation) -> tuple[Sequence[str], float]:
        tests = tests_of(mutation, found, took)
        return tests, sum(took.get(test, 0.0) for test in tests)

    before: dict[str, Any] = kept if asked.more else {"sample": 0, "seeds": [], "survivors": []}
    outcomes = []
    for each in survey(chosen, tests_for, asked.jobs):
        outcomes.append(each)
        survivors = before["survivors"] + [asdict(each) for each in outcomes if each.survived]
        record = {
            "date": time.strftime("%Y-%m-%d"),
            "rooms": list(asked.rooms),
            "of": len(every),
            "sample": before["sample"] + len(outcomes),
            "seeds": [*before["seeds"], asked.seed],
            "survived": len(survivors),
            "survivors": survivors,
        }
        write(record)


def write(record: Mapping[str, Any]) -> None:
    """Write the record, and print how many survive."""
    RECORD.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
    print(f"{record['survived']} of {record['sample']} survived; written: {RECORD}", flush=True)


if __name__ == "__main__":
    main()
