# SPDX-License-Identifier: BSD-3-Clause
import io
import itertools
import re
from types import SimpleNamespace

import pytest

import reports.machine.progress
from reports.machine.progress import counted, part_of, progress_bar


@pytest.fixture
def clock(monkeypatch):
    """A clock of our own; `clock.now` is what it shows [s]."""
    clock = SimpleNamespace(now=100.0)
    monkeypatch.setattr(reports.machine.progress, "time", SimpleNamespace(monotonic=lambda: clock.now))
    return clock


@pytest.mark.claim("progress")
def test_short_work_says_nothing(capsys, clock):
    with progress_bar("report") as progress:
        for step in range(10):
            clock.now += 0.19
            progress(step / 10, "working")
    captured = capsys.readouterr()
    assert captured.err == captured.out == ""


def test_long_work_says_what_is_left_in_plain_lines(capsys, clock):
    with progress_bar("report") as progress:
        clock.now += 30
        progress(0.25, "sphere-spot: volpath")
    captured = capsys.readouterr()
    # A quarter took 30 s: three quarters take 90 s.
    assert captured.err == "report: 25 %, about 90 s left, sphere-spot: volpath\n"
    assert captured.out == ""  # --json must stay JSON


def test_plain_lines_are_ten_seconds_apart(capsys, clock):
    with progress_bar("bench") as progress:
        for step in range(1, 101):
            clock.now += 0.5
            progress(step / 101, "x")
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 5
    shares = [int(re.findall(r"(\d+) %", line)[0]) for line in lines]
    assert shares == sorted(shares)


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.claim("progress")
@pytest.mark.parametrize(("seconds", "shown"), [(0.5, False), (5.0, True)])
def test_bar_on_a_terminal_appears_after_two_seconds_and_goes_away(monkeypatch, clock, seconds, shown):
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
        assert "\x1b[2K" in text  # the line is erased at the end
    else:
        assert text == ""


def test_parts_tell_shares_of_the_whole():
    """From end to end, where the parts meet too, to the last digit; and nothing goes wrong where nobody listens."""
    told = []
    whole = [0.0, 0.3, 0.9, 1.0]  # 0.3 + (0.9 - 0.3) is not 0.9
    for first, last in itertools.pairwise(whole):
        progress = counted(part_of(lambda share, what: told.append((share, what)), first, last, before="map: "))
        for done in range(3):
            progress(done, 2, str(done))
    assert [share for share, _ in told] == pytest.approx([0, 0.15, 0.3, 0.3, 0.6, 0.9, 0.9, 0.95, 1])
    assert [share for share, what in told if what != "map: 1"] == [0, 0.3, 0.3, 0.9, 0.9, 1]
    assert told[1][1] == "map: 1"
    counted(part_of(None, 0, 1))(1, 2, "nobody")
    counted(None)(1, 2, "nobody")
