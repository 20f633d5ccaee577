# SPDX-License-Identifier: BSD-3-Clause
"""`airlight doctor`: whole, piped, and on machines where something is wrong."""

import json

import numpy as np
import pytest

from reference.storage.cache import store_arrays
from reports.commands.main import run
from reports.machine import doctor
from reports.machine.environment import MissingError


@pytest.fixture(scope="module")
def diagnosis(variant):
    """Return the diagnosis of this machine, made once."""
    return doctor.diagnose()


def test_this_machine_works(diagnosis, variant):
    assert diagnosis["works"]
    assert diagnosis["problem"] is None
    assert diagnosis["variant"] == variant
    # 15 000 roundings of float32, as Mitsuba 3.9 has it; a later rule would be of the same order or smaller
    assert 0 < diagnosis["kernel"]["epsilon"] < 2e-3
    assert json.loads(json.dumps(diagnosis)) == diagnosis


def test_a_missing_library_is_shown_with_what_to_do(monkeypatch, capsys):
    def missing():
        raise MissingError("no libLLVM found: install it")

    monkeypatch.setattr(doctor, "prepare", missing)
    monkeypatch.setattr(doctor, "find_llvm", lambda: [])
    assert run(["doctor", "--json"]) == 3
    printed = json.loads(capsys.readouterr().out)
    assert (printed["works"], printed["problem"]) == (False, "no libLLVM found: install it")
    assert {"what": "LLVM", "works": False, "details": "none found"} in printed["checks"]
    assert run(["doctor"]) == 3
    assert "Not ready: no libLLVM found: install it" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("code", "words"),
    [("import os; os.abort()", "killed by SIGABRT"), ("import time; time.sleep(30)", "did not end within")],
)
def test_a_kernel_that_crashes_is_shown_and_crashes_nothing(code, words, monkeypatch):
    real = doctor.subprocess.run

    def other_program(command, **options):
        return real([command[0], "-c", code], **options)

    monkeypatch.setattr(doctor.subprocess, "run", other_program)
    # half a second is enough for an interpreter to start and fail, and not for the one that sleeps
    assert words in doctor.try_kernel("llvm_ad_rgb", patience=5.0 if "sleep" not in code else 0.5)["problem"]


@pytest.fixture
def filled(own_cache):
    for kind in ("quadrature", "report-reference", "report-method"):
        for number in range(2):
            store_arrays(f"{kind}-{number:032x}", {"a": np.zeros(2000)})
    return own_cache


def test_the_cache_is_shown_and_cleared(filled, monkeypatch):
    monkeypatch.setattr(doctor, "diagnose", lambda: {"works": True})
    monkeypatch.setenv("AIRLIGHT_CACHE_SIZE", "1GiB")
    size = sum(path.stat().st_size for path in filled.rglob("*.npz"))
    shown = doctor.doctor().cache
    assert (shown["folder"], shown["limit"], shown["bytes"]) == (str(filled), 2**30, size)
    assert {kind: of["files"] for kind, of in shown["kinds"].items()} == {
        "quadrature": 2,
        "report-method": 2,
        "report-reference": 2,
    }
    cleared = doctor.doctor(clear_cache=True)
    assert (cleared.cache["removed"], cleared.cache["freed"], cleared.cache["files"]) == (6, size, 0)
    assert not list(filled.rglob("*.npz"))
    assert cleared.passed
