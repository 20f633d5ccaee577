# SPDX-License-Identifier: BSD-3-Clause
"""The record of a method: its function, and what a user and a frame must know of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

#: What of a scene may change from frame to frame; `look` is all that moves nothing: the medium and the lights' colours.
MOVABLE = ("camera", "geometry", "light", "look")


@dataclass(frozen=True)
class Method:
    """A method under its name, with what a user must know of it."""

    name: str
    function: Callable[..., Any]
    summary: str
    source: str
    uses_kernel: bool = True
    prepare: Callable[..., Any] | None = None  #: (scene, **parameters) -> function of the scene, run when things moved
    prepared_from: frozenset[str] = frozenset(MOVABLE)  #: what `prepare` looks at; while it stands still, it is not run
    tiles: Callable[..., tuple[Any, ...] | None] | None = (
        None  #: (view, **parameters) -> `view.tiles`, from camera, geometry and lights, without their colours and media
    )
    provides_visibility: Callable[[Mapping[str, Any]], bool] = lambda settings: (
        False
    )  #: parameters -> whether it returns, after the radiance, by light whether it reaches the surface
    casts_rays: Callable[[Mapping[str, Any]], bool] = lambda settings: False  #: parameters -> whether it casts rays
    frozen: Callable[[Mapping[str, Any]], bool] = lambda settings: True  #: parameters -> whether it can be frozen
    tiled: Callable[[Mapping[str, Any]], bool] | None = (
        None  #: parameters -> whether it computes each ray by itself, as its parameter `tolerance` wants
    )
    shadows: bool = True  #: whether it knows shadows; one that does not is wrong where there are occluders
    parameters: Mapping[str, int | float | str] = field(
        default_factory=lambda: MappingProxyType({})
    )  #: name -> default
    check: Callable[[Any], None] | None = None  #: airlight (height, width, 3) -> raises what is wrong with it
