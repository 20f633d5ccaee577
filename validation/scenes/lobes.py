# SPDX-License-Identifier: BSD-3-Clause
"""Isotropic media that scatter with a mean cosine g: scenes built with another phase function in their place.

Mitsuba changes the numbers of a phase function that it has built, not its kind. So the description of the scene is
changed before it is built. A g of 0 leaves it as it is, isotropic.
"""

from collections.abc import Mapping
from typing import Any

import mitsuba as mi

from analytic.errors import InputError


def scene_with_lobes(description: dict[str, Any], lobes: Mapping[str, float]):
    """Return the Mitsuba scene of a dictionary, see `give_lobes`."""
    config = mi.parser.ParserConfig(mi.variant())
    config.merge_meshes = False
    state = mi.parser.parse_dict(config, description)
    give_lobes(state, lobes)
    mi.parser.transform_all(config, state)
    return mi.parser.instantiate(config, state)


def give_lobes(state: Any, lobes: Mapping[str, float]) -> None:
    """Give isotropic media of a parsed scene Henyey-Greenstein phase functions, mean cosines by the ids of the media.

    A medium that has no description of its own, as part of a shape that was built before, is refused.
    """
    for name, g in lobes.items():
        phase = _isotropic_phase(state, name)
        if phase is None:
            raise InputError(f"medium '{name}': its g cannot be changed: give it a phase function of type 'hg'")
        phase.set_plugin_name("hg")
        phase["g"] = g


def _isotropic_phase(state: Any, name: str) -> Any:
    """Return the properties of the phase function of a medium, None where there are none to change."""
    nodes = [node.props for node in state.nodes]
    for medium in nodes:
        if medium.plugin_name() != "homogeneous" or medium.id() != name:
            continue
        for key in medium.keys():  # noqa: SIM118 - properties iterate over pairs
            value = medium[key]
            if isinstance(value, mi.Properties.ResolvedReference):
                phase = nodes[value.index()]
            elif isinstance(value, mi.Properties.Reference):
                phase = next((node for node in nodes if node.id() == value.id()), medium)
            else:
                continue
            if phase.plugin_name() == "isotropic":
                return phase
    return None
