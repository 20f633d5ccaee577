# SPDX-License-Identifier: BSD-3-Clause
"""Real-time methods: the in-scattered radiance of every pixel of a view.

A method is a function ``method(view, *, kernel, **parameters)``, see `realtime.view`. `METHODS` is the registry: add a
`Method` to it and every command and report knows it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from realtime.methods.ray_march import ray_march
from realtime.methods.unshadowed import unshadowed


@dataclass(frozen=True)
class Method:
    """A method under its name, with what a user must know of it."""

    name: str
    function: Callable[..., Any]
    summary: str
    source: str
    uses_kernel: bool = True
    shadows: bool = True  #: whether it knows shadows; one that does not is wrong where there are occluders
    parameters: Mapping[str, int | str] = field(default_factory=lambda: MappingProxyType({}))  #: name -> default


METHODS: dict[str, Method] = {
    "unshadowed": Method(
        "unshadowed",
        unshadowed,
        "one airlight integral a ray and light, no volumetric shadows",
        "Biri, Arques, Michelin 2006, section 4.1; Sun et al. 2005",
        shadows=False,
    ),
    "ray-march": Method(
        "ray-march",
        ray_march,
        "midpoint steps with one visibility test each: the baseline to beat",
        "Billeter, Sintorn, Assarsson 2010, section 2; Kulla and Fajardo 2012 (equi-angular steps)",
        uses_kernel=False,
        parameters=MappingProxyType({"steps": 100, "spacing": "equiangular", "shadow": "ray", "map": 512}),
    ),
}
