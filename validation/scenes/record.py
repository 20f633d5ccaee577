# SPDX-License-Identifier: BSD-3-Clause
"""The entry of a built-in scene in the registry."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

MOVES = ("light", "objects", "medium", "colour")


@dataclass(frozen=True)
class Animation:
    """What moves in the frames of a scene; see `validation.scenes.animation`."""

    moves: tuple[str, ...] = ("light",)  #: of `MOVES`
    about: tuple[float, float, float] | None = None  #: where the axis of the lights' circle is [m]; None: in the middle
    objects: tuple[str, ...] = ()  #: names of the shapes that turn; none: all closed ones


@dataclass(frozen=True)
class SceneRecord:
    """A built-in scene."""

    name: str
    build: Callable[[], dict[str, Any]]  #: the dictionary for `mi.load_dict`; needs an active Mitsuba variant
    purpose: str  #: what it is for, one sentence
    published: str  #: the published figure that it answers to
    animation: Animation = field(default_factory=Animation)
