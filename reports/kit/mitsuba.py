# SPDX-License-Identifier: BSD-3-Clause
"""A certified scene as Mitsuba XML, from the dictionary that the certified file has of it."""

from collections.abc import Mapping
from typing import Any

from airlight.reports.interchange.mitsuba_xml import scene_xml

#: A single scattering, by paths of light - fog - eye; Russian roulette would only add noise.
_INTEGRATOR = {"type": "volpath", "max_depth": 2, "rr_depth": 1000}
_SAMPLES = 4096  # of a pixel: noise of about a per cent, in seconds


def mitsuba_xml(scene: Mapping[str, Any], head: str) -> str:
    """Return a scene of the certified file as XML of Mitsuba 3; `head` is a comment."""
    parts: dict[str, Any] = {"integrator": _INTEGRATOR, **scene["mitsuba"]}
    # The film has no samples: they belong to a sampler, which the dictionary leaves to the user.
    sampler = {"type": "independent", "sample_count": _SAMPLES}
    parts["sensor"] = parts["sensor"] | {"sampler": sampler}
    return scene_xml(parts, head)
