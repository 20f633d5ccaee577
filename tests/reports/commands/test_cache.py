# SPDX-License-Identifier: BSD-3-Clause
"""Claim: `airlight cache` shows place, size and kinds of what is kept, and clears it."""

import json

import numpy as np
import pytest

from reference.storage.cache import store_arrays
from reports.commands.main import run


@pytest.fixture
def filled(own_cache):
    for kind in ("quadrature", "report-truth", "report-method"):
        for number in range(2):
            store_arrays(f"{kind}-{number:032x}", {"a": np.zeros(2000)})
    return own_cache


def printed(capsys, *arguments, status=0):
    assert run(["cache", *arguments]) == status
    return capsys.readouterr()


def test_place_size_and_kinds_are_shown(filled, capsys, monkeypatch):
    monkeypatch.setenv("AIRLIGHT_CACHE_SIZE", "1GiB")
    words = printed(capsys).out
    assert f"{filled}: 6 files" in words
    assert "of at most 1 GiB" in words
    size = sum(path.stat().st_size for path in filled.rglob("*.npz"))
    numbers = json.loads(printed(capsys, "--json").out)
    assert (numbers["folder"], numbers["limit"], numbers["bytes"]) == (str(filled), 2**30, size)
    assert {kind: counts["files"] for kind, counts in numbers["kinds"].items()} == {
        "quadrature": 2,
        "report-method": 2,
        "report-truth": 2,
    }


def test_clear_says_what_it_freed(filled, capsys):
    size = sum(path.stat().st_size for path in filled.rglob("*.npz"))
    numbers = json.loads(printed(capsys, "--clear", "--json").out)
    assert (numbers["removed"], numbers["freed"], numbers["files"]) == (6, size, 0)
    assert not list(filled.rglob("*.npz"))
    assert "0 files removed, 0 bytes freed" in printed(capsys, "--clear").out
