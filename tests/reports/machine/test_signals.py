# SPDX-License-Identifier: BSD-3-Clause
"""Claim: signals end a command at once with the shell's status; output that is closed,
full or ASCII is no fault.

Each program says when it is where the signal shall meet it: no test hangs on the clock.
"""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
STATUS = {signal.SIGINT: 130, signal.SIGTERM: 143}
HEAD = "import functools, sys, time\nfrom airlight.reports.machine.process_start import default_signals\n"
HEAD += "default_signals()\n"
READY = "print('ready', flush=True)\n"
KERNEL = """
from airlight.reports.machine.environment import activate
activate()
import drjit as dr
import mitsuba as mi

def run(count):
    x, i = mi.Float(dr.arange(mi.UInt32, 1 << 16)), mi.UInt32(0)
    _, x = dr.while_loop((i, x), lambda i, x: i < count, lambda i, x: (i + 1, dr.fma(x, 0.5, 1.0)))
    dr.eval(x)
    dr.sync_thread()

run(dr.opaque(mi.UInt32, 1))  # compiled
print('ready', flush=True)
run(dr.opaque(mi.UInt32, 2**31))  # for minutes
"""
# Where Python's own exception would come too late, be lost, or show a traceback.
MOMENTS = {
    "sleep": READY + "time.sleep(600)",
    "a callback": f"{READY}sorted(range(10), key=lambda n: time.sleep(600))",
    "an exception that is caught": (
        f"{READY}while True:\n try:\n  time.sleep(600)\n except BaseException: pass"
    ),
    "a kernel": KERNEL,
}


@pytest.fixture
def shell():
    """A function that lets a shell run a program, says when it is ready, and returns
    the shell and its number.
    """
    started = []

    def start(code, head=HEAD):
        # The shell is waiting when the signal comes, as at a terminal, and says what status it saw.
        script = f'{sys.executable} -c "$1" & echo $!; wait $!; echo $?'
        process = subprocess.Popen(
            ["sh", "-c", f"trap : INT TERM; {script}", "sh", head + code],
            cwd=ROOT,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        started.append(process)
        assert process.stdout is not None
        number = int(process.stdout.readline())
        assert process.stdout.readline() == "ready\n"
        return process, number

    yield start
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("sign", STATUS)
@pytest.mark.parametrize("moment", MOMENTS)
def test_a_signal_ends_the_process_at_once_with_the_shells_status(shell, moment, sign):
    # A shell lets programs in the background ignore Ctrl-C.
    process, number = shell(
        MOMENTS[moment], "import signal\nsignal.signal(2, signal.default_int_handler)\n" + HEAD
    )
    os.kill(number, sign)
    out, err = process.communicate(timeout=60)
    assert (out, err.replace("Terminated", "").strip()) == (f"{STATUS[sign]}\n", "")


def test_what_the_parent_ignores_stays_ignored(shell):
    """As by nohup, and as a shell does it for programs in the background."""
    process, _ = shell(
        f"{READY}import os, signal\nos.kill(os.getpid(), signal.SIGINT)\nprint('done')"
    )
    assert process.stdout.read() == "done\n0\n"


ROOT = Path(__file__).resolve().parents[3]


def run(line, **environment):
    """Run a line of the shell in which $AIRLIGHT is the command."""
    environment = os.environ | {"AIRLIGHT": f"{sys.executable} -m airlight"} | environment
    return subprocess.run(["sh", "-c", line], capture_output=True, env=environment, timeout=120)


@pytest.mark.parametrize(
    ("line", "status"),
    [
        ("$AIRLIGHT list nowhere <&- >&- 2>&-", 2),
        ("($AIRLIGHT list kernels; echo $? >&2) | head -c 1 >/dev/null", 0),
        ("$AIRLIGHT list kernels >/dev/full", 2),
    ],
)
def test_closed_and_full_streams_are_no_fault(line, status):
    ran = run(line)
    assert ran.returncode == status
    assert b"Traceback" not in ran.stderr


def test_a_file_does_not_take_the_place_of_a_closed_output(tmp_path):
    code = "from airlight.reports.machine.process_start import usable_streams; usable_streams()\n"
    code += f"file = open({str(tmp_path / 'a')!r}, 'w'); print('printed'); import os; os.write(1, b'said')"
    assert run(f'cd {ROOT}; {sys.executable} -c "{code}" >&-').returncode == 0
    assert (tmp_path / "a").read_bytes() == b""


def test_json_loses_nothing_in_ascii():
    code = "from airlight.reports.machine.process_start import usable_streams; usable_streams()\n"
    code += "print('\\u2500')\n"
    code += "from airlight.reports.tables.record import print_json; print_json({'name': '\\u2500 \\udcff'})"
    ran = run(f'cd {ROOT}; {sys.executable} -c "{code}"', PYTHONIOENCODING="ascii")
    shown, _, printed = ran.stdout.partition(b"\n")
    assert shown == b"?"
    assert json.loads(printed) == {"name": "\u2500 \udcff"}
