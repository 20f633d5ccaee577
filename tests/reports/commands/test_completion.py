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


@pytest.mark.claim("completion")
@pytest.mark.parametrize(("line", "told"), [("report --method shad", "shadow-planes"), ("render hal", "hall")])
def test_bash_is_told_what_fits_and_nothing_heavy_is_imported(line, told):
    """Ends in an error if it is: modules that cannot be imported stand before those that can."""
    program = (
        "import sys, runpy\n"
        "for name in ('mitsuba', 'drjit', 'numpy', 'scipy', 'matplotlib', 'OpenEXR'): sys.modules[name] = None\n"
        f"sys.path.insert(0, {str(ROOT)!r}); sys.argv = ['airlight']\n"
        "runpy.run_module('airlight', run_name='__main__')\n"
    )
    words = ["airlight", *line.split(" ")]
    asked = {"_AIRLIGHT_COMPLETE": "complete_bash", "COMP_WORDS": "\n".join(words), "COMP_CWORD": str(len(words) - 1)}
    command = [sys.executable, "-c", program]
    ran = subprocess.run(command, env=os.environ | asked, capture_output=True, text=True, timeout=60)
    assert (ran.stdout.split(), ran.returncode) == ([told], 0), ran.stderr
