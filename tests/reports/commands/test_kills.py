# SPDX-License-Identifier: BSD-3-Clause
"""Sixty kills by three signals at random moments of four commands: the status, whole files, and the next run goes on.

`pytest -m slow tests/reports/commands/test_kills.py -k "reference or bench"` takes some of them.
"""

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from reference.storage.exr import read_exr

ROOT = Path(__file__).resolve().parents[3]
COMMANDS = {
    "render": ["render", "sphere-spot", "--size", "64x48", "--frames", "40", "-o", "frames/a.exr"],
    "reference": [
        "reference",
        "open-fog",
        "--size",
        "64x48",
        "--estimator",
        "volpath",
        "--spp",
        "16384",
        "-o",
        "a.exr",
    ],
    "report": [
        "report",
        "--quick",
        "open-fog",
        "--method",
        "realtime.methods.unshadowed:unshadowed",
        "-o",
        "r",
    ],
    "bench": ["bench", "open-fog", "--size", "64x48", "--method", "unshadowed", "--method", "ray-march", "--no-truth"],
}
KILLS = 15  #: of each command
# The shell's status; and for the first milliseconds, in which `env` starts, what it is made from.
STATUS = {signal.SIGINT: (130, -2), signal.SIGTERM: (143, -15), signal.SIGKILL: (-9,)}
FIRST = 0.02  #: seconds, on a busy machine
# As the launcher starts it; where `env` cannot, Python itself starts in the first milliseconds.
START = [sys.executable, "-S", str(ROOT / "airlight.py")]
HELD = ["env", "--block-signal=INT,TERM"]
if subprocess.run([*HELD, "true"], capture_output=True).returncode == 0:
    START = [*HELD, *START]
WORDS = {signal.SIGINT: "interrupted: ", signal.SIGTERM: "terminated: "}


def run(command, folder, *, stop=None, after=0.0):
    """Run a command in a folder, with a cache beside it; send it a signal after a time [s]."""
    process = subprocess.Popen(
        [*START, *COMMANDS[command]],
        cwd=folder,
        env=os.environ | {"AIRLIGHT_CACHE_DIR": str(folder.parent / "cache")},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    if stop is not None:
        time.sleep(after)
        process.send_signal(stop)
    out, err = process.communicate(timeout=600)
    return process.returncode, out, err


def check_files(folder, *, killed):
    """Every file that has its name is whole; only a kill that no process can see leaves others, which are hidden."""
    files = [path for path in folder.rglob("*") if path.is_file()]
    hidden = [path for path in files if any(part.startswith(".") for part in path.relative_to(folder).parts)]
    assert killed or not hidden
    for path in set(files) - set(hidden):
        if path.suffix == ".exr":
            assert read_exr(path).layers
        elif path.suffix == ".npz":
            with np.load(path) as arrays:
                assert all(arrays[name].size >= 0 for name in arrays.files)
        elif path.suffix == ".json":
            assert json.loads(path.read_text(encoding="utf-8"))
        elif path.suffix == ".html":
            assert path.read_text(encoding="utf-8").rstrip().endswith("</html>")


@pytest.mark.slow
@pytest.mark.claim("runs-go-on")
@pytest.mark.parametrize("command", COMMANDS)
def test_a_kill_at_any_moment_has_its_status_and_leaves_whole_files(command, variant, tmp_path):
    folder = tmp_path / "work"
    folder.mkdir()
    start = time.monotonic()
    status, _, err = run(command, folder)
    assert status == 0, err
    longest = time.monotonic() - start
    for path in folder.rglob("*"):
        if path.is_file():
            path.unlink()
    if (tmp_path / "cache").exists():
        os.rename(tmp_path / "cache", tmp_path / "first")
    rng = random.Random(command)
    for kill in range(KILLS):
        stop = list(STATUS)[kill % 3]
        # A third of them while Python and the packages start.
        after = rng.uniform(0, 0.8 if kill % 5 < 2 else longest)
        status, _, err = run(command, folder, stop=stop, after=after)
        what = f"{stop.name} after {after:.3f} s: status {status}\n{err}"
        if status != 0:  # it was faster
            assert status in STATUS[stop][: 1 + (after < FIRST)], what
            assert "rror" not in err, what
            assert "Traceback" not in err, what
            if status > 0:
                assert err.splitlines()[-1].startswith(WORDS[stop]), what
        check_files(tmp_path / "work", killed=True)
        check_files(tmp_path / "cache", killed=True)
    before = {path for path in tmp_path.rglob("*") if path.is_file() and path.name.startswith(".")}
    for stop in (signal.SIGINT, signal.SIGTERM):
        run(command, folder, stop=stop, after=rng.uniform(0.5, longest))
        left = {path for path in tmp_path.rglob("*") if path.is_file() and path.name.startswith(".")}
        assert left <= before
    status, out, err = run(command, folder)
    assert status == 0, err
    check_files(folder, killed=True)
    if command == "reference":
        assert "from the cache" in out
