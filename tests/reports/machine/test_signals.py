# SPDX-License-Identifier: BSD-3-Clause
"""Claim: Ctrl-C and SIGTERM end a command at any moment, with 130 and 143 for the shell, and say nothing.

Each program says when it is where the signal shall meet it: no test hangs on the clock.
"""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
STATUS = {signal.SIGINT: 130, signal.SIGTERM: 143}
HEAD = "import functools, sys, time\nfrom reports.machine.process_start import default_signals\ndefault_signals()\n"
READY = "print('ready', flush=True)\n"
KERNEL = """
from reports.machine.environment import activate
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
    "an exception that is caught": f"{READY}while True:\n try:\n  time.sleep(600)\n except BaseException: pass",
    "a kernel": KERNEL,
}


@pytest.fixture
def shell():
    """A function that lets a shell run a program, says when it is ready, and returns the shell and its number."""
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
    process, number = shell(MOMENTS[moment], "import signal\nsignal.signal(2, signal.default_int_handler)\n" + HEAD)
    os.kill(number, sign)
    out, err = process.communicate(timeout=60)
    assert (out, err.replace("Terminated", "").strip()) == (f"{STATUS[sign]}\n", "")


def test_what_the_parent_ignores_stays_ignored(shell):
    """As by nohup, and as a shell does it for programs in the background."""
    process, _ = shell(f"{READY}import os, signal\nos.kill(os.getpid(), signal.SIGINT)\nprint('done')")
    assert process.stdout.read() == "done\n0\n"
