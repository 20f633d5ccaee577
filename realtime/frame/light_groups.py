# SPDX-License-Identifier: BSD-3-Clause
"""Groups of lights: those that a method renders in one run of its recorded function.

A method that looks at all lights together has one group of all tables
(`realtime.scene.light_table`). One that sums a table in one loop has a group for each table. Every
other method has a group for each light, a table of one row, and lights of one structure share a
recording: neither the code of a kernel nor the time to compile it grows with the lights.

The states of all groups, such as shadow maps, stay from frame to frame as far as they have room.
The others are made when their group is rendered.
"""

from collections.abc import Callable
from dataclasses import dataclass, is_dataclass, replace
from functools import cached_property
from typing import Any

import drjit as dr

from airlight.realtime.methods.interface.method import Method
from airlight.realtime.scene.light_table import LightTable, alike
from airlight.realtime.scene.read_scene import Scene

_ROOM = 2**30  # of the states of all groups of lights [bytes]


@dataclass(frozen=True)
class LightGroup:
    """The lights of a scene that a method renders together."""

    scene: Scene  #: with these lights alone

    @property
    def source(self) -> int | None:
        """The number of the area light of whose samples the group is; None for other lights."""
        return self.scene.lights[0].source if self.scene.lights else None

    @property
    def from_infinity(self) -> bool:
        """Whether a light of the group has no place."""
        return any(not light.w for light in self.scene.lights)

    @cached_property
    def tables(self) -> tuple[LightTable, ...]:
        """The lights for recorded functions; a table by itself is of area light 0, as
        one recording serves all.
        """
        tables = self.scene.tables
        if len(tables) == 1 and self.source:
            tables = (replace(tables[0], rows=replace(tables[0].rows, source=0)),)
        return tables


def light_groups(scene: Scene, method: Method, *, together: bool) -> tuple[LightGroup, ...]:
    """Return the groups of the lights of a scene for a method; `together`: all in one."""
    if method.at_once or together:
        return (LightGroup(scene),)
    if method.by_table:
        return tuple(LightGroup(replace(scene, lights=group)) for group in alike(scene.lights))
    apart = replace(scene, sample_tables=())
    return tuple(LightGroup(replace(apart, lights=(light,))) for light in scene.lights)


def group_states(
    groups: tuple[LightGroup, ...], prepare: Callable[[Scene], Any]
) -> tuple[Any, ...]:
    """Return the state of a method by groups of lights, None for those that have no room."""
    states: list[Any] = []
    for group in groups:
        # All states are about as large as the first.
        room = not states or len(states) < _ROOM // max(_bytes_in(states[0]), 1)
        states.append(prepare(group.scene) if room else None)
    return tuple(states)


def _bytes_in(value: Any) -> int:
    """Return the size of the Dr.Jit arrays in a state [bytes]."""
    if isinstance(value, tuple | list):
        return sum(_bytes_in(item) for item in value)
    if is_dataclass(value):
        return sum(_bytes_in(item) for item in vars(value).values())
    if not dr.is_array_v(value):
        return 0
    if dr.depth_v(value) > 1:
        return sum(map(_bytes_in, value))
    return dr.width(value) * dr.itemsize_v(value)
