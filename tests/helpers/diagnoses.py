# SPDX-License-Identifier: BSD-3-Clause
"""A diagnosis that nobody searched for."""

from typing import Any

from airlight.validation.engine.diagnose import Diagnosis


def diagnosis(**changed: Any) -> Diagnosis:
    """Return a diagnosis of an image that nothing explains, but for what is said otherwise."""
    said: dict[str, Any] = {
        "scene": "scene",
        "path": "path",
        "layer": "total",
        "pixel": "centre",
        "first": "unexplained",
        "ranked": (),
        "residual": 0.07,
        "left": 0.05,
        "rest": "",
        "explained": False,
        "place": "",
        "few": "",
        "verdict": "not right",
    }
    return Diagnosis(**said | changed)
