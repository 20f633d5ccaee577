# SPDX-License-Identifier: BSD-3-Clause
"""Output that is closed, full or in ASCII: no traceback, and JSON stays JSON."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


def run(line, **environment):
    """Run a line of the shell in which $AIRLIGHT is the command."""
    environment = os.environ | {"AIRLIGHT": f"{sys.executable} {ROOT / 'airlight.py'}"} | environment
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
    code = "from reports.machine.process_start import usable_streams; usable_streams()\n"
    code += f"file = open({str(tmp_path / 'a')!r}, 'w'); print('printed'); import os; os.write(1, b'said')"
    assert run(f'cd {ROOT}; {sys.executable} -c "{code}" >&-').returncode == 0
    assert (tmp_path / "a").read_bytes() == b""


def test_json_loses_nothing_in_ascii():
    code = "from reports.machine.process_start import usable_streams; usable_streams()\n"
    code += "print('\\u2500')\n"
    code += "from reports.tables.terminal import print_json; print_json({'name': '\\u2500 \\udcff'})"
    ran = run(f'cd {ROOT}; {sys.executable} -c "{code}"', PYTHONIOENCODING="ascii")
    shown, _, printed = ran.stdout.partition(b"\n")
    assert shown == b"?"
    assert json.loads(printed) == {"name": "\u2500 \udcff"}
