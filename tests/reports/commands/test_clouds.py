# SPDX-License-Identifier: BSD-3-Clause
"""`airlight clouds`: its record and tables, and what it refuses."""

import pytest

from realtime.clouds.canonical.sets import SETS
from realtime.clouds.canonical.tables import Grid
from reports.commands.main import WRONG_INPUT, run
from reports.tables.clouds import clouds_sentence, clouds_tables
from validation.canonical.record import canonical_record

SMALL = Grid(4, 4, 4, 7, 8)


@pytest.mark.slow
def test_the_record_has_the_names_of_the_page(variant, own_cache):
    first = canonical_record("hg:0.3", 0.9, check=2, grid=SMALL)
    assert list(first) == ["phase", "albedo", "bytes", "seconds", "kept", "grid", "sets", "check"]
    assert not first["kept"]
    assert [row["orders"] for row in first["sets"]] == ["2", "3-4", "5-6", "7-8", "9-12", "13-18", "19-30", "31-inf"]
    assert list(first["check"]) == ["points", "slabs", "seed", "seconds", "sets"]
    row = first["check"]["sets"][0]
    assert list(row) == ["orders", "points", "negligible", "T", "c", "sigma"]
    assert row["points"] + row["negligible"] == 2
    assert list(row["T"]) == ["p50", "p95"]
    kept, errors = clouds_tables(first)
    assert len(kept.rows) == len(errors.rows) == len(SETS)
    again = canonical_record("hg:0.3", 0.9, grid=SMALL)
    assert again["kept"]
    assert again["seconds"] == first["seconds"]
    assert "from the cache" in clouds_sentence(again)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "--tables"),
        (["--tables", "--albedo", "0"], "albedo"),
        (["--tables", "--albedo", "1.2"], "albedo"),
        (["--tables", "--phase", "hg:2"], "mean cosine"),
        (["--tables", "--check", "-1"], "--check"),
        (["--tables", "--seed", "-1"], "--seed"),
    ],
)
def test_mistakes_are_one_line(arguments, words, capsys):
    assert run(["clouds", *arguments]) == WRONG_INPUT
    printed = capsys.readouterr()
    assert not printed.out
    assert words in printed.err
    assert printed.err.count("\n") == 1
