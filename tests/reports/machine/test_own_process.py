# SPDX-License-Identifier: BSD-3-Clause
"""The user's code in a separate process: it can neither end the command nor get into its output."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from airlight.errors import InputError
from airlight.realtime.child_process import EndedError
from airlight.reports.machine.own_process import in_own_process

ROOT = Path(__file__).resolve().parents[3]


def run(function, *arguments, limit=60.0):
    return in_own_process(function, *arguments, name="fog.py:f", limit=limit)


@pytest.mark.claim("own-method-process")
def test_what_is_returned_comes_back_and_what_is_printed_goes_to_the_error_stream(variant, capfd):
    assert run(divmod, 17, 5) == (3, 2)
    assert run(print, "from within") is None
    assert capfd.readouterr() == ("", "from within\n")


@pytest.mark.parametrize(
    ("function", "arguments", "words"),
    [(os.abort, (), "killed by SIGABRT"), (sys.exit, (0,), "exit status 0")],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_a_process_that_ends_says_how(variant, function, arguments, words):
    with pytest.raises(
        EndedError, match=rf"^method fog\.py:f: ended its process, {words}; expected"
    ):
        run(function, *arguments)


def test_a_hang_is_ended_in_time(variant, monkeypatch):
    start = time.monotonic()
    monkeypatch.setenv("AIRLIGHT_METHOD_LIMIT", "0.5")
    with pytest.raises(
        EndedError,
        match=r"no answer within 0\.5 s; its process was ended; AIRLIGHT_METHOD_LIMIT=1 a",
    ):
        run(time.sleep, 600, limit=None)
    assert time.monotonic() - start < 60


def refuse(words):
    raise InputError(words)


def test_a_refusal_comes_back_as_it_is(variant):
    with pytest.raises(InputError, match=r"^expected fog$") as caught:
        run(refuse, "expected fog")
    assert type(caught.value) is InputError


@pytest.mark.slow
@pytest.mark.parametrize("sign", [2, 15, 9])
def test_the_process_ends_with_the_one_that_started_it(variant, tmp_path, sign):
    """Also with all that the user's code started itself."""
    method = tmp_path / "hangs.py"
    method.write_text(
        "import os, subprocess\nfrom pathlib import Path\n\n\ndef f(view):\n"
        "    child = subprocess.Popen(['sleep', '600'])\n"
        f"    Path({str(tmp_path / 'half')!r}).write_text(f'{{os.getpid()}} {{child.pid}}')\n"
        f"    os.rename({str(tmp_path / 'half')!r}, {str(tmp_path / 'pids')!r})\n"
        "    while True:\n        pass\n"
    )
    command = [
        sys.executable,
        "-m",
        "airlight",
        "render",
        "open-fog",
        "--size",
        "8x6",
        "--method",
        f"{method}:f",
    ]
    process = subprocess.Popen(
        command, cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    while not (tmp_path / "pids").exists() and process.poll() is None:
        time.sleep(0.05)
    process.send_signal(sign)
    assert process.communicate(timeout=60) == ("", "")
    assert process.returncode == -sign
    for pid in map(int, (tmp_path / "pids").read_text().split()):
        while alive(pid):  # for half a second
            time.sleep(0.05)


def alive(pid):
    """Whether a process runs; one that nobody waits for stays as a zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False
