# SPDX-License-Identifier: BSD-3-Clause
"""A Python that has Blender's module `bpy`: named by the user, this one, or one with the wheel in a scratch folder."""

import importlib.util
import os
import subprocess
import sys
from functools import cache
from tempfile import mkdtemp

import pytest

VARIABLE = "AIRLIGHT_CYCLES_PYTHON"
_WHEEL = "bpy==5.0.1"  # for Python 3.11 alone


@cache
def cycles_python():
    """Return its path, or skip the test that asks, with the reason."""
    python, reason = _found()
    if python is None:
        pytest.skip(f"{reason}; {VARIABLE} can name a Python that has bpy")
    return python


@cache
def _found():
    named = os.environ.get(VARIABLE)
    if named:
        return named, ""
    if importlib.util.find_spec("bpy") is not None:
        return sys.executable, ""
    if sys.version_info[:2] != (3, 11):
        return None, f"{_WHEEL} is a wheel for Python 3.11"
    folder = mkdtemp(prefix="airlight-bpy-")
    python = os.path.join(folder, "bin", "python")
    for command in ([sys.executable, "-m", "venv", folder], [python, "-m", "pip", "install", "-q", _WHEEL]):
        try:
            subprocess.run(command, check=True, capture_output=True, timeout=900)
        except (OSError, subprocess.SubprocessError) as error:
            return None, f"{_WHEEL} cannot be installed here: {type(error).__name__}"
    return python, ""
