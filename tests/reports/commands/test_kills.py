# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a command that is killed at any moment leaves whole files, and the next run goes on."""

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
SMALL = ["sphere-spot", "--size", "32x24"]
COMMANDS = {
    "render": ["render", *SMALL, "--frames", "40", "-o", "frames/a.exr"],
    "reference": ["reference", *SMALL, "--estimator", "single-scatter", "--spp", "16384", "-o", "a.exr"],
    "report": ["report", "--quick", "open-fog", "--method", "unshadowed", "-o", "r"],
}
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
KILLS = 6  #: of each command


def run(command, folder, *, stop=None, after=0.0):
    """Run a command in a folder, with a cache beside it; send it a signal after a time [s]."""
    environment = os.environ | {"AIRLIGHT_CACHE_DIR": str(folder.parent / "cache"), "PYTHONPATH": str(ROOT)}
    code = "from reports.commands.start import main\nmain()"  # without the first milliseconds of Python itself
    how = {"cwd": folder, "env": environment, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen([sys.executable, "-c", code, *COMMANDS[command]], **how)
    if stop is not None:
        time.sleep(after)
        process.send_signal(stop)
    out, err = process.communicate(timeout=600)
    return process.returncode, out, err


def check_files(folder):
    """Every file that has its name is whole; unfinished ones are hidden."""
    for path in folder.rglob("*"):
        if not path.is_file() or any(part.startswith(".") for part in path.relative_to(folder).parts):
            continue
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
def test_a_kill_at_any_moment_leaves_whole_files_and_the_next_run_goes_on(command, variant, tmp_path):
    (tmp_path / "work").mkdir()
    (tmp_path / "first" / "work").mkdir(parents=True)
    start = time.monotonic()
    status, _, err = run(command, tmp_path / "first" / "work")
    assert status == 0, err
    longest, rng = time.monotonic() - start, random.Random(command)
    for kill in range(KILLS):
        stop = SIGNALS[kill % 3]
        status, _, err = run(command, tmp_path / "work", stop=stop, after=rng.uniform(0.5, longest))
        assert status in (0, -stop), err  # 0: it was faster
        assert "Traceback" not in err
        check_files(tmp_path)
    status, out, err = run(command, tmp_path / "work")
    assert status == 0, err
    check_files(tmp_path)
    if command == "reference":
        assert "from the cache" in out
