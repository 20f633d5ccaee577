# SPDX-License-Identifier: BSD-3-Clause
"""A small challenge, a scene of each kind in few pixels, and entries to it."""

import json

import numpy as np
import pytest

from airlight.reference.storage.exr import Image, write_exr
from tests.helpers.challenge import make_small, references

SEED = "7"


@pytest.fixture
def small(variant, monkeypatch):
    """Let challenges have three scenes of 32 x 24 pixels."""
    make_small(monkeypatch.setattr)


@pytest.fixture(scope="session")
def place(tmp_path_factory):
    """A folder for the files of scenes."""
    return tmp_path_factory.mktemp("challenge")


@pytest.fixture
def perfect(small, tmp_path, place):
    """Return a function that writes the reference, times a factor, as an entry."""

    def write(name, factor=1.0, **said):
        folder = tmp_path / name
        folder.mkdir()
        lines = {"method": name, "seed": SEED} | said
        text = "".join(f"{key} = {json.dumps(value)}\n" for key, value in lines.items())
        (folder / "entry.toml").write_text(text)
        for scene, airlight in references(lines["seed"], place).items():
            image = Image({"airlight": (factor * airlight).astype(np.float32)})
            write_exr(folder / f"{scene}.exr", image)
        return folder

    return write
