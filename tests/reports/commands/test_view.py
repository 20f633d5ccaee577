# SPDX-License-Identifier: BSD-3-Clause
"""`airlight view`: it listens here alone, refuses in one line, and Ctrl-C ends it
with all that it started.
"""

import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from types import SimpleNamespace

import pytest

from airlight.reports.commands import main as cli
from airlight.reports.machine.quick_compilation import CACHE_VARIABLE, VARIABLE

ROOT = Path(__file__).resolve().parents[3]
SMALL = ["--size", "16x12"]


def run(*arguments, status):
    assert cli.run(["view", *arguments]) == status


@pytest.mark.claim("view-extra")
def test_without_the_extra_one_line_says_what_to_type(monkeypatch, capfd):
    monkeypatch.setitem(sys.modules, "websockets", None)
    run("sphere-spot", status=3)
    said = capfd.readouterr()
    assert said.err == (
        "airlight: error: the live view needs the package websockets: "
        "`./airlight` brings it in a clone, `pip install websockets` elsewhere\n"
    )


def test_a_port_that_is_taken_is_said_and_the_reference_ends(variant, monkeypatch, capfd):
    pytest.importorskip("websockets", reason="the extra `view` is not installed")
    ended = []
    reference = SimpleNamespace(end=lambda: ended.append(True))
    session = SimpleNamespace(reference=reference, opened=None, told=None, closed=None)
    monkeypatch.setattr("airlight.reports.view.session.Session", lambda state, variant: session)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        run("open-fog", *SMALL, "--address", f"127.0.0.1:{port}", status=2)
    printed = capfd.readouterr()
    assert printed.out == ""
    assert (
        f"address: cannot listen at 127.0.0.1, port {port}: Address already in use" in printed.err
    )
    assert ended == [True]


def _children(parent):
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = path.read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        if fields[1] == str(parent) and fields[0] != "Z":
            found.append(int(path.parent.name))
    return found


@pytest.mark.slow
@pytest.mark.claim("view-ends")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_ends_it_and_its_processes_without_a_word(number):
    process = subprocess.Popen(
        [sys.executable, "-m", "airlight", "view", "sphere-spot", *SMALL, "--set", "points=4"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # Quick compilation has a child of its own.
        env={
            name: value
            for name, value in os.environ.items()
            if name not in (VARIABLE, CACHE_VARIABLE)
        },
    )
    address = process.stdout.readline().strip()
    assert address.startswith("http://127.0.0.1:")
    assert process.stdout.readline() == "Ctrl-C ends the view.\n"
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with opener.open(address, timeout=120) as response:
        assert response.status == 200
    children = _children(process.pid) if sys.platform == "linux" else []
    assert children or sys.platform != "linux"  # the reference
    process.send_signal(number)
    assert process.communicate(timeout=120) == ("", "")
    assert process.returncode == -number  # 130 and 143 for a shell
    stop = time.monotonic() + 10
    while any(os.path.exists(f"/proc/{child}") for child in children):
        assert time.monotonic() < stop, "what it started goes on"
        time.sleep(0.05)
