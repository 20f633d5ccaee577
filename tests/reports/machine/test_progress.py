# SPDX-License-Identifier: BSD-3-Clause
import io
from types import SimpleNamespace

import pytest

import airlight.reports.machine.progress
from airlight.reports.machine.progress import progress_bar


@pytest.fixture
def clock(monkeypatch):
    """A clock of our own; `clock.now` is what it shows [s]."""
    clock = SimpleNamespace(now=100.0)
    monkeypatch.setattr(airlight.reports.machine.progress, "_PATIENCE", 2.0)
    monkeypatch.setattr(
        airlight.reports.machine.progress, "time", SimpleNamespace(monotonic=lambda: clock.now)
    )
    return clock


def test_long_work_says_what_is_left_in_plain_lines(capsys, clock):
    with progress_bar("report") as progress:
        clock.now += 30
        progress(0.25, "sphere-spot: volpath")
    captured = capsys.readouterr()
    # A quarter took 30 s: three quarters take 90 s.
    assert captured.err == "report: 25 %, about 1:30 left, sphere-spot: volpath\n"
    assert captured.out == ""  # --json must stay JSON


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.claim("progress")
@pytest.mark.parametrize(("seconds", "shown"), [(0.5, False), (5.0, True)])
def test_bar_on_a_terminal_appears_after_two_seconds_and_goes_away(
    monkeypatch, clock, seconds, shown
):
    screen = Terminal()
    monkeypatch.setattr("sys.stderr", screen)
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "120")
    with progress_bar("report") as progress:
        clock.now += seconds
        progress(0.25, "open-fog: volpath")
    text = screen.getvalue()
    assert ("open-fog: volpath" in text) is shown
    assert ("25 %" in text) is shown
    if shown:
        assert text.endswith("\x1b[2K")  # the line is erased at the end
    else:
        assert text == ""
