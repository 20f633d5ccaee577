# SPDX-License-Identifier: BSD-3-Clause
"""A challenge has the same bytes on a processor with other instructions."""

import os
import subprocess
import sys

import numpy as np
import pytest

from airlight.reference.storage.exr import Image, read_exr, write_exr
from airlight.reports.commands.main import run
from tests.helpers.lesser_machine import ENVIRONMENT


@pytest.mark.slow
@pytest.mark.claim("challenge-bytes", tolerance="none: the bytes are equal")
def test_a_processor_of_2013_draws_the_same_scenes_and_scores_the_same_bytes(perfect, tmp_path):
    """The entry is 1 % off at random: its errors have digits that a changed reference would turn."""
    entry, other = perfect("here"), tmp_path / "there"
    draws = np.random.default_rng(1)
    for path in entry.glob("*.exr"):
        airlight = read_exr(path).layers["airlight"]
        noise = 1 + 0.01 * draws.standard_normal(airlight.shape)
        write_exr(path, Image({"airlight": (airlight * noise).astype(np.float32)}))
    home = tmp_path / "home"
    home.mkdir()
    # No result of this processor is found there, and no kernel: Dr.Jit keeps them in the home.
    kept = {"HOME": str(home), "AIRLIGHT_CACHE_DIR": str(home / "cache")}
    scores = {"here": tmp_path / "here.json", "there": tmp_path / "there.json"}

    def there(*arguments):
        words = [sys.executable, "-P", "-m", "tests.helpers.lesser_machine", *arguments]
        done = subprocess.run(
            words, env=os.environ | ENVIRONMENT | kept, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr

    assert run(["challenge", "new", "7", "-o", str(tmp_path / "new")]) == 0
    there("new", "7", "-o", str(other))
    assert files(tmp_path / "new") == files(other)
    assert run(["challenge", "score", str(entry), "-o", str(scores["here"])]) == 0
    there("score", str(entry), "-o", str(scores["there"]))
    assert scores["here"].read_bytes() == scores["there"].read_bytes()


def files(folder):
    """Return the bytes of the scenes and their descriptions in a folder by their paths.

    Matrices of glTF nodes have the last bit of the processor; challenge.json has the digests of the
    files beside it.
    """
    paths = (path for path in (folder / "scenes").iterdir() if path.suffix != ".glb")
    return {path.relative_to(folder): path.read_bytes() for path in paths}
