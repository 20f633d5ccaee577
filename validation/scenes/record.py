# SPDX-License-Identifier: BSD-3-Clause
"""The entry of a built-in scene in the registry."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class SceneRecord:
    """A built-in scene."""

    name: str
    build: Callable[[], dict[str, Any]]  #: the dictionary for `mi.load_dict`; needs an active Mitsuba variant
    purpose: str  #: what it is for, one sentence
    published: str  #: the published figure that it answers to
