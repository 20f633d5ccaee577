# SPDX-License-Identifier: BSD-3-Clause
"""What a scene needs of a method: a frame runs the code its plan names and nothing else (DESIGN section 5)."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Plan:
    """What a scene needs; every field chooses code, none is data."""

    shadows: bool  #: there is something that can cast a shadow
    surfaces: bool  #: there is something that the camera can see
    extinctions: int  #: 1 for a grey medium, 3 for a coloured one
    isotropic: bool  #: the phase function is a constant
    bounded: bool  #: the medium ends somewhere
    vacuum: bool  #: nothing is extinguished in at least one channel
    point_lights: int
    spot_lights: int
    soft_spots: bool  #: a spot's intensity falls off inside its cone
    directional_lights: int = 0
    clear: bool = False  #: bounded: nothing fills the space between the media
    notes: tuple[str, ...] = ()  #: what the user should know of this scene


def describe(plan: Plan) -> dict[str, str]:
    """Return the plan in words, one entry for each decision."""
    counts = (("point", plan.point_lights), ("spot", plan.spot_lights), ("directional", plan.directional_lights))
    lights = [f"{count} {kind}" for kind, count in counts if count]
    words = {
        "surfaces": "lit surfaces" if plan.surfaces else "none: no ray is cast for the camera",
        "shadows": "visibility tests" if plan.shadows else "none: nothing casts a shadow",
        "extinction": "one for all channels"
        if plan.extinctions == 1
        else "one for each channel: three integrals a ray",
        "phase function": "isotropic: left out of the integrand"
        if plan.isotropic
        else "anisotropic: split at the foot point",
        "medium": f"bounded, in {'clear air' if plan.clear else 'another medium'}: rays clipped, no kernel"
        if plan.bounded
        else "unbounded: every ray lies in it whole",
        "lights": " and ".join(lights),
        "spot falloff": "inside the cone: integrand weighted"
        if plan.soft_spots
        else "none: rays are clipped to cones at most",
    }
    return words
