# SPDX-License-Identifier: BSD-3-Clause
"""Nodes of a parsed scene file: their references, their names, and which of them the scene uses."""

from collections.abc import Iterator
from typing import Any

import mitsuba as mi

_KINDS = ("Medium", "Sensor", "Emitter", "Shape")


def properties(state: Any, index: int) -> Any:
    """Return the properties of a node, which are changed in place."""
    return state.nodes[index].props


def references(props: Any) -> Iterator[tuple[str, int]]:
    """Yield the nodes that properties refer to, by key; Mitsuba does not
    count it as use of them.
    """
    for key in list(props.keys()):
        if props.type(key) == mi.Properties.Type.ResolvedReference:
            index = props[key].index()
            # Mitsuba refuses a file with properties that nothing has read: looking at a reference
            # must not count as a use.
            props.mark_queried(key, False)
            yield key, index


def kind(state: Any, index: int) -> str:
    """Return the type of a node: 'Shape', 'Medium', ..."""
    return str(state.nodes[index].type).rpartition(".")[2]


def child(state: Any, index: int, wanted: str) -> int | None:
    """Return the number of the first node of a kind that a node refers to."""
    return next(
        (at for _, at in references(properties(state, index)) if kind(state, at) == wanted), None
    )


def used(state: Any) -> list[int]:
    """Return the numbers of the nodes that the scene holds, each after the
    first that refers to it.
    """
    return reached(state, 0)


def reached(state: Any, index: int) -> list[int]:
    """Return the numbers of a node and of the nodes below it, each after the
    first that refers to it.
    """
    found: dict[int, None] = {index: None}
    waiting = [index]
    # Breadth first; a dictionary keeps the order and holds each node once, also where two shapes
    # share a material.
    while waiting:
        for _, at in references(properties(state, waiting.pop(0))):
            if at not in found:
                found[at] = None
                waiting.append(at)
    return list(found)


def of_kind(state: Any, wanted: str) -> list[int]:
    """Return the numbers of the nodes of a kind that the scene holds."""
    return [index for index in used(state) if kind(state, index) == wanted]


def name_nodes(state: Any) -> None:
    """Name what messages speak of and has no id by its plugin, such as 'sphere-2'."""
    taken = {node.props.id() for node in state.nodes}
    for wanted in _KINDS:
        for number, index in enumerate(of_kind(state, wanted), 1):
            props = properties(state, index)
            if not props.id():
                props.set_id(free_name(f"{props.plugin_name()}-{number}", taken))


def free_name(name: str, taken: set[str]) -> str:
    """Return a name that is not taken yet, and take it."""
    while name in taken:
        name += "-unnamed"
    taken.add(name)
    return name
