# SPDX-License-Identifier: BSD-3-Clause
"""The entry of a built-in scene in the registry."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

MOVES = ("light", "objects", "medium", "colour")


@dataclass(frozen=True)
class Animation:
    """What moves in the frames of a scene; `validation.scenes.animation` says how."""

    moves: tuple[str, ...] = ("light",)  #: of `MOVES`
    about: tuple[float, float, float] | None = (
        None  #: a point on the axis that lights circle [m]; None: the middle of the scene
    )
    objects: tuple[str, ...] = ()  #: names of the shapes that turn; empty: all closed ones


@dataclass(frozen=True)
class SceneRecord:
    """A built-in scene."""

    name: str
    build: Callable[[], dict[str, Any]]  #: the dictionary for `mi.load_dict`; needs an active Mitsuba variant
    purpose: str  #: one sentence: what the scene is for
    published: str  #: the published figure that the scene stands for
    animation: Animation = field(default_factory=Animation)  #: what moves in it
    clouds: bool = (
        False  #: whether light is scattered many times in it: then `cloud-paths` is its truth, and few methods fit
    )
