# SPDX-License-Identifier: BSD-3-Clause
"""A frame as images on the host, in the order of the image; it has to be finite everywhere.

The device computes pixels in the order of its lanes (`realtime.scene.camera.tiled_pixels`), and a
large image in parts.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import drjit as dr
import numpy as np

from airlight.realtime.frame.light_on_ray import check_radiance
from airlight.realtime.frame.renderer import (
    FrameRenderer,
    evaluated,
    give_memory_back,
    is_large,
    parts,
    run_cast_and_shade,
    run_method,
)
from airlight.realtime.frame.surface import Cast
from airlight.realtime.numerics.array_types import PerRay


@dataclass(frozen=True)
class Frame:
    """A rendered frame, as float arrays of shape (height, width[, 3])."""

    airlight: Any  #: in-scattered radiance [W/(m^2 sr)]
    surface: Any  #: radiance of the lit surface through the medium [W/(m^2 sr)]
    distance: Any  #: to the visible surface, infinite where there is none [m]
    #: further layers by their names, colours
    extra: Mapping[str, Any] = field(default_factory=dict)


def render_frame(renderer: FrameRenderer) -> Frame:
    """Render one frame and bring it to the host.

    Parameters
    ----------
    renderer
        The stages of the frame, from `frame_renderer`.
    """
    state, frame = renderer.prepare(renderer.scene), None
    for part in parts(renderer):
        cast, surface = run_cast_and_shade(part)
        if is_large(renderer) and not renderer.method.provides_visibility:
            cast = Cast(cast.distance)  # nothing is shaded any more
        rendered = run_method(part, state, cast, surface)
        stages, extra = evaluated(cast, rendered), rendered.extra
        del cast, surface, rendered
        give_memory_back(renderer)  # the host's images need room now
        frame = frame_with_part(frame, part, stages, extra)
    assert frame is not None
    return _checked(renderer, frame)


def image_frame(
    renderer: FrameRenderer, stages, extra: Mapping[str, PerRay] | None = None
) -> Frame:
    """Bring `stages`, what `realtime.frame.renderer.run_stages` returned, to the host, and
    `extra` layers.
    """
    return _checked(renderer, unchecked_frame(renderer, stages, extra))


def unchecked_frame(
    renderer: FrameRenderer, stages, extra: Mapping[str, PerRay] | None = None
) -> Frame:
    """Do what `image_frame` does, and return radiance that is not finite too,
    for anyone who counts it.
    """
    return frame_with_part(None, renderer, stages, extra)


def frame_with_part(
    frame: Frame | None, renderer: FrameRenderer, stages, extra: Mapping[str, PerRay] | None
) -> Frame:
    """Return a frame with the pixels of a renderer written into it; a new one
    where there is none yet.
    """
    distance, surface, airlight = stages
    shown = {name: _colour(renderer, values) for name, values in (extra or {}).items()}
    return Frame(
        _image(renderer, airlight, frame and frame.airlight),
        _image(renderer, surface, frame and frame.surface),
        _image(renderer, distance, frame and frame.distance),
        {
            name: _image(renderer, values, frame and frame.extra[name])
            for name, values in shown.items()
        },
    )


def _checked(renderer: FrameRenderer, frame: Frame) -> Frame:
    """Return a frame that is finite everywhere; refuse another."""
    check_radiance(
        renderer.scene, renderer.method.name, frame.airlight, frame.surface, frame.distance
    )
    return frame


def _colour(renderer: FrameRenderer, values):
    """Return a layer as a colour: a number is grey."""
    Color = type(renderer.scene.medium.albedo)
    return values if isinstance(values, Color) else Color(values)


def _image(renderer: FrameRenderer, values, image=None):
    """Write values by lane to their pixels of an image (height, width[, 3]), a new one
    by default, and return it.
    """
    camera, pixel = renderer.scene.camera, np.array(renderer.pixel)
    channels = (
        [np.array(channel) for channel in values] if dr.depth_v(values) > 1 else [np.array(values)]
    )
    if image is None:
        image = np.empty((camera.height, camera.width, len(channels)), dtype=channels[0].dtype)
        image = image if dr.depth_v(values) > 1 else image[..., 0]
    by_pixel = image.reshape(-1, len(channels))
    for number, channel in enumerate(channels):
        by_pixel[pixel, number] = channel
    return image
