# SPDX-License-Identifier: BSD-3-Clause
"""Work of an hour, or for more memory than there is, is asked about before it starts; usual work is not."""

import pytest

from analytic.errors import InputError
from realtime.memory import Memory
from reports.commands.main import run
from validation.study import cost as expected_work
from validation.study.cost import Work, check_work


def test_an_hour_and_the_memory_are_the_bounds(variant, monkeypatch):
    monkeypatch.setattr(expected_work.dr, "thread_count", lambda: 2)
    monkeypatch.setattr(expected_work, "usable_memory", lambda: Memory(10**9, "this machine has"))
    monkeypatch.setattr(expected_work.mi, "variant", lambda: "llvm_ad_rgb")
    check_work("x", [Work(3600, 1e9), Work(3600, 1e9)])
    with pytest.raises(
        InputError, match=r"^x: would take about 1 hours; ask for less, or set AIRLIGHT_FORCE=1 to start it"
    ):
        check_work("x", [Work(3700), Work(3600)])
    with pytest.raises(InputError, match=r"^x: needs about 2 GB of memory, of which this machine has 1 GB; ask"):
        check_work("x", [Work(1, 2e9)])
    with pytest.raises(InputError, match=r"about 6\.[0-9]* years and needs"):
        check_work("x", [Work(4e8, 2e9)])
    check_work("x", [])
    monkeypatch.setenv("AIRLIGHT_FORCE", "1")
    check_work("x", [Work(1e9, 2e9)])


@pytest.mark.parametrize(
    "command",
    [
        ["render", "open-fog", "--size", "16384x16384"],
        ["render", "open-fog", "--size", "8x6", "--set", "steps=9999999999999"],
        ["reference", "open-fog", "--estimator", "volpath", "--samples", "100000000000"],
        ["study", "methods", "open-fog", "--size", "16384x16384"],
        ["study", "map-size", "sphere-spot", "--size", "16384x16384", "--sizes", "32"],
    ],
    ids=" ".join,
)
def test_every_command_that_renders_asks(variant, tmp_path, monkeypatch, capsys, command):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(expected_work.dr, "thread_count", lambda: 2)
    monkeypatch.setattr(expected_work, "usable_memory", lambda: Memory(16 * 10**9, "this machine has"))
    assert run(command) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "set AIRLIGHT_FORCE=1 to start it" in err
    assert not list(tmp_path.iterdir())
