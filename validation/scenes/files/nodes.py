# SPDX-License-Identifier: BSD-3-Clause
"""Nodes of a parsed scene file: their references, their names, and which of them the scene uses."""

from __future__ import annotations

from collections.abc import Iterator

import mitsuba as mi

_KINDS = ("Medium", "Sensor", "Emitter", "Shape")


def properties(state: mi.parser.ParserState, index: int) -> mi.Properties:
    """Return the properties of a node, which are changed in place."""
    return state.nodes[index].props


def references(props: mi.Properties) -> Iterator[tuple[str, int]]:
    """Yield the keys of properties that refer to nodes, and the numbers of these nodes.

    Mitsuba does not count it as a use of the properties.
    """
    for key in list(props.keys()):
        if props.type(key) == mi.Properties.Type.ResolvedReference:
            index = props[key].index()
            # Mitsuba refuses a file with properties that nothing has read: looking at a reference
            # must not count as a use.
            props.mark_queried(key, False)
            yield key, index


def kind(state: mi.parser.ParserState, index: int) -> str:
    """Return the type of a node: 'Shape', 'Medium', ..."""
    return str(state.nodes[index].type).rpartition(".")[2]


def child(state: mi.parser.ParserState, index: int, wanted: str) -> int | None:
    """Return the number of the first node of a kind that a node refers to."""
    return next(
        (at for _, at in references(properties(state, index)) if kind(state, at) == wanted), None
    )


def used(state: mi.parser.ParserState) -> list[int]:
    """Return the numbers of the nodes that the scene holds, each after the
    first that refers to it.
    """
    return reached(state, 0)


def reached(state: mi.parser.ParserState, index: int) -> list[int]:
    """Return the numbers of a node and of the nodes below it, each after the
    first that refers to it.
    """
    reached_nodes: dict[int, None] = {index: None}
    queue = [index]
    # Breadth first. A dictionary has an order and holds each node once, also where two shapes share
    # a material.
    while queue:
        for _, at in references(properties(state, queue.pop(0))):
            if at not in reached_nodes:
                reached_nodes[at] = None
                queue.append(at)
    return list(reached_nodes)


def of_kind(state: mi.parser.ParserState, wanted: str) -> list[int]:
    """Return the numbers of the nodes of a kind that the scene holds."""
    return [index for index in used(state) if kind(state, index) == wanted]


def name_nodes(state: mi.parser.ParserState) -> None:
    """Give nodes that messages name and that have no id the name of their plugin, as 'sphere-2'."""
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
