# SPDX-License-Identifier: BSD-3-Clause
"""What the shell completes, and how long it takes: no library that computes is imported for it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from reports.commands import completion

ROOT = Path(__file__).resolve().parents[3]


def test_names_are_those_of_the_registries():
    from realtime.kernels.registry import KERNELS
    from realtime.methods.registry import METHODS
    from validation.scenes.registry import SCENES

    assert completion.scene_names() == sorted(SCENES)
    assert completion.method_names() == list(METHODS)
    assert completion.kernel_names() == list(KERNELS)


def _completed(line: str, *python: str, **variables: str) -> list[str]:
    """Return what bash is told for a line whose last word is being typed."""
    words = line.split(" ")
    environment = os.environ | {
        "_AIRLIGHT_COMPLETE": "complete_bash",
        "COMP_WORDS": line.replace(" ", "\n"),
        "COMP_CWORD": str(len(words) - 1),
    }
    command = [sys.executable, *python, str(ROOT / "airlight.py")]
    ran = subprocess.run(command, env=environment | variables, capture_output=True, text=True, timeout=60)
    assert (ran.returncode, ran.stderr) == (0, ""), ran.stderr
    return ran.stdout.split()


@pytest.mark.claim("completion")
def test_bash_is_told_what_fits():
    assert _completed("airlight report --method shad") == ["shadow-planes"]


@pytest.mark.claim("completion")
def test_completion_imports_nothing_heavy():
    """Ends in an error if it does: modules that cannot be imported stand before those that can."""
    program = (
        "import sys, runpy\n"
        "for name in ('mitsuba', 'drjit', 'numpy', 'scipy', 'matplotlib', 'OpenEXR'): sys.modules[name] = None\n"
        f"sys.path.insert(0, {str(ROOT)!r}); sys.argv = ['airlight']\n"
        "runpy.run_module('airlight', run_name='__main__')\n"
    )
    environment = os.environ | {
        "_AIRLIGHT_COMPLETE": "complete_bash",
        "COMP_WORDS": "airlight\nrender\nhal",
        "COMP_CWORD": "2",
    }
    command = [sys.executable, "-c", program]
    ran = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)
    assert (ran.stdout.split(), ran.returncode) == (["hall"], 0), ran.stderr
