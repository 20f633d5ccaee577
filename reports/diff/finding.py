# SPDX-License-Identifier: BSD-3-Clause
"""A difference between two reports."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

Report = Mapping[str, Any]


@dataclass(frozen=True)
class Finding:
    """A difference between two reports."""

    verdict: str  #: 'worse', 'better' or 'note'
    scene: str  #: empty for what concerns the whole report
    method: str  #: label of the configuration; empty for what concerns the scene
    what: str  #: the number, or a sentence
    old: float | None = None
    new: float | None = None
