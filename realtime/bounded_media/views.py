# SPDX-License-Identifier: BSD-3-Clause
"""Bounded media as the camera and the lights see them: what a frame needs of them before there are rays."""

from dataclasses import dataclass
from typing import Any

from realtime.bounded_media.convex_clip import Seen, seen_from
from realtime.bounded_media.directional_legs import seen_along
from realtime.bounded_media.facet_walk import EntryPlanes, entry_planes, exit_planes
from realtime.scene.lights import Light
from realtime.scene.medium import BoundedMedium, Medium


@dataclass(frozen=True)
class MediumView:
    """A bounded medium as one point sees it, with the planes through which lines from there enter and leave it."""

    seen: Seen
    entering: EntryPlanes | None  #: None for a sphere
    leaving: EntryPlanes | None  #: None for a sphere, and where the caller does not need them


@dataclass(frozen=True)
class MediaViews:
    """All bounded media of a scene as its camera and its lights see them."""

    camera: tuple[MediumView, ...]
    lights: tuple[Any, ...]  #: by light, from `light_views`


def medium_view(bounded_medium: BoundedMedium, point, *, leaving: bool = True) -> MediumView:
    """Return a bounded medium as a point sees it, one for all lanes [m]."""
    seen = seen_from(bounded_medium, point)
    return MediumView(seen, entry_planes(seen), exit_planes(seen) if leaving else None)


def light_views(medium: Medium, light: Light) -> tuple[Any, ...]:
    """Return the bounded media as a light sees them: `MediumView` of one with a place, else `ParallelSeen`."""
    if not light.w:
        return tuple(seen_along(bounded_medium, light.axis) for bounded_medium in medium.bounded_media)
    # Where legs leave a medium matters only to those in another one.
    several = len(medium.bounded_media) > 1
    return tuple(
        medium_view(bounded_medium, light.position, leaving=several) for bounded_medium in medium.bounded_media
    )


def media_views(medium: Medium, lights: tuple[Light, ...], origin) -> MediaViews:
    """Return the bounded media of a scene as its camera, at `origin` [m], and its lights see them."""
    camera = tuple(medium_view(bounded_medium, origin) for bounded_medium in medium.bounded_media)
    return MediaViews(camera, tuple(light_views(medium, light) for light in lights))
