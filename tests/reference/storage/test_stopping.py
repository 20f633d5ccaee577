# SPDX-License-Identifier: BSD-3-Clause
"""A signal ends a process at any moment with its status and one line, and leaves nothing unfinished behind."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from reference.storage.stopping import cleaned_up, hint_when_stopped

ROOT = Path(__file__).resolve().parents[3]
STATUS = {signal.SIGINT: 130, signal.SIGTERM: 143}
HEAD = "import time\nfrom pathlib import Path\nfrom reference.storage.stopping import *\nstop_on_signals()\n"


@pytest.fixture
def start():
    """A function that starts a program and waits for its first line; none outlives its test."""
    started = []

    def begin(code, *, head=HEAD):
        program = [sys.executable, "-c", f"{head}{code}"]
        process = subprocess.Popen(program, cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        started.append(process)
        assert process.stdout.readline() == "ready\n"
        return process

    yield begin
    for process in started:
        process.kill()
        process.communicate()


@pytest.mark.parametrize("sign", STATUS)
@pytest.mark.parametrize(
    "busy",
    [
        "time.sleep(60)",
        "while True: pass",
        # Python's own exception would be lost here, or a traceback.
        "class A:\n    def __del__(self): time.sleep(60)\nA()",
        "import functools\nsorted(range(10), key=lambda n: time.sleep(60))",
        "try:\n    time.sleep(60)\nexcept BaseException:\n    time.sleep(60)",
    ],
)
def test_a_signal_is_a_status_and_one_line(start, sign, busy):
    process = start(f"print('ready', flush=True)\n{busy}")
    time.sleep(0.05)
    process.send_signal(sign)
    out, err = process.communicate(timeout=20)
    assert (process.returncode, out) == (STATUS[sign], "")
    assert err.count("\n") == 1
    assert err.endswith("no file is left half-written; run the same command again\n")


def test_what_is_unfinished_is_removed_and_the_outermost_hint_said(start, tmp_path):
    code = f"""
folder = Path({str(tmp_path)!r})
with hint_when_stopped(lambda: "three are kept"), hint_when_stopped(lambda: "two are kept"):
    with cleaned_up((folder / "done").unlink):
        pass
    with cleaned_up(lambda: 1 / 0), cleaned_up((folder / "half").unlink):
        print("ready", flush=True)
        time.sleep(60)
"""
    for name in ("half", "done"):
        (tmp_path / name).touch()
    process = start(code)
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=20)[1] == "interrupted: three are kept\n"
    assert [path.name for path in tmp_path.iterdir()] == ["done"]


def test_a_second_signal_does_not_wait(start):
    code = "with cleaned_up(lambda: time.sleep(60)):\n    print('ready', flush=True)\n    time.sleep(60)"
    process = start(code)
    process.send_signal(signal.SIGINT)
    time.sleep(0.3)
    assert process.poll() is None
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=4) == 130
    process.communicate()


def test_what_the_parent_ignores_stays_ignored(start):
    code = "print('ready', flush=True)\ntime.sleep(0.5)\nprint('done')"
    process = start(code, head="import signal\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n" + HEAD)
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=20) == ("done\n", "")


@pytest.mark.parametrize("sign", STATUS)
def test_the_status_of_work_that_is_done_stays_while_python_ends(start, sign):
    """An object of the module is destroyed after Python has given its handlers up: a signal then ended the process."""
    code = f"""
import os
class Late:
    def __del__(self, kill=os.kill, own=os.getpid()):
        kill(own, {int(sign)})
late = Late()
end_unstopped()
print("ready", flush=True)
"""
    process = start(code)
    assert process.communicate(timeout=20) == ("", "")
    assert process.returncode == 0


def test_without_the_handler_nothing_is_registered():
    """In a notebook and in these tests a Ctrl-C stays Python's exception."""
    with cleaned_up(pytest.fail), hint_when_stopped(str), pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
