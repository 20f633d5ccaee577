# SPDX-License-Identifier: BSD-3-Clause
"""Claim: `airlight fidelity` prints the rows of the papers with their verdicts."""

import json

import pytest

from reports.commands import main as cli
from validation.fidelity.catalogue import ROWS

KEYS = ["paper", "item", "claim", "verdict", "published", "measured", "unit", "command", "why"]


@pytest.mark.claim("fidelity-command")
def test_the_command_prints_rows(variant, own_cache, capfd):
    assert cli.run(["fidelity", "--quick", "--paper", "biri", "--json"]) == 0
    data = json.loads(capfd.readouterr().out)
    rows = {row["item"]: row for row in data["fidelity"]}
    assert all(list(row) == KEYS for row in rows.values())
    assert {row["paper"] for row in rows.values()} == {"biri"}
    assert len(rows) + data["left_out"] == sum(row.paper == "biri" for row in ROWS)
    assert rows["annex, isotropic c2"]["verdict"] == "refuted"
    assert rows["annex, isotropic c4"]["verdict"] == "reproduced"
    assert rows["6, two pens"]["published"] == 35
    assert data["environment"]["variant"]


def test_the_command_prints_tables(variant, own_cache, capfd):
    assert cli.run(["fidelity", "--quick", "--paper", "bouthors"]) == 0
    out = capfd.readouterr().out
    assert "Bouthors" in out
    assert "27 rows: 8 reproduced, 19 refuted." in out
    assert cli.run(["fidelity", "--quick", "--paper", "sun", "--markdown"]) == 0
    assert "| 3, dimensionless |" in capfd.readouterr().out


def test_an_unknown_paper_is_refused(capfd):
    assert cli.run(["fidelity", "--paper", "kajiya"]) == cli.WRONG_INPUT
    assert "--paper: got 'kajiya', wanted one of biri, billeter" in capfd.readouterr().err
