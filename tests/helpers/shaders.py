# SPDX-License-Identifier: BSD-3-Clause
"""Shaders for tests, and the machines that draw none."""

from functools import cache
from pathlib import Path

import pytest

from airlight.reports.machine.opengl import opengl_status

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"


@cache
def _why_not() -> str:
    status = opengl_status(judged=False)
    return "" if status.works else status.reason


def need_opengl() -> None:
    """Skip a test, by the name of what is missing, where no shader can be drawn."""
    if _why_not():
        pytest.skip(_why_not())
