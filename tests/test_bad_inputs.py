# SPDX-License-Identifier: BSD-3-Clause
"""Protects that no input ends a command by a traceback or an abort, or makes it
write what is not finite.
"""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers.bad_inputs import KINDS


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_every_bad_input_is_refused_or_gives_finite_results(kind):
    """In a process of its own, whose children have Dr.Jit to themselves: what ends
    one of them ends no test.
    """
    command = [sys.executable, "-m", "tests.helpers.bad_inputs", kind]
    done = subprocess.run(
        command, cwd=Path(__file__).parents[1], capture_output=True, text=True, timeout=3600
    )
    assert done.returncode == 0, done.stdout + done.stderr
