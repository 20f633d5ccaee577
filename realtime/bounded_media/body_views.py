# SPDX-License-Identifier: BSD-3-Clause
"""Bodies of media as the camera and the lights see them: what a frame needs of them before there are rays."""

from dataclasses import dataclass
from typing import Any

from realtime.bounded_media.convex_clip import Seen, seen_from
from realtime.bounded_media.directional_legs import seen_along
from realtime.bounded_media.facet_walk import EntryPlanes, entry_planes, exit_planes
from realtime.scene.lights import Light
from realtime.scene.medium import Body, Medium


@dataclass(frozen=True)
class BodySides:
    """A body as one point sees it, with the planes through which lines from there enter and leave it."""

    seen: Seen
    entering: EntryPlanes | None  #: None for a sphere
    leaving: EntryPlanes | None  #: None for a sphere, and where nobody asks


@dataclass(frozen=True)
class MediaSides:
    """All bodies of a scene as its camera and its lights see them."""

    camera: tuple[BodySides, ...]
    lights: tuple[Any, ...]  #: by light, from `light_sides`


def body_sides(body: Body, point, *, leaving: bool = True) -> BodySides:
    """Return a body as a point sees it, one for all lanes [m]."""
    seen = seen_from(body, point)
    return BodySides(seen, entry_planes(seen), exit_planes(seen) if leaving else None)


def light_sides(medium: Medium, light: Light) -> tuple[Any, ...]:
    """Return the bodies as a light sees them: `BodySides` of one with a place, else `ParallelSeen`."""
    if not light.w:
        return tuple(seen_along(body, light.axis) for body in medium.bodies)
    # Where legs leave a body matters only to those in another one.
    several = len(medium.bodies) > 1
    return tuple(body_sides(body, light.position, leaving=several) for body in medium.bodies)


def media_sides(medium: Medium, lights: tuple[Light, ...], origin) -> MediaSides:
    """Return the bodies of a scene as its camera, at `origin` [m], and its lights see them."""
    camera = tuple(body_sides(body, origin) for body in medium.bodies)
    return MediaSides(camera, tuple(light_sides(medium, light) for light in lights))
