# SPDX-License-Identifier: BSD-3-Clause
"""Anti-aliased pictures: the mean of several frames whose camera rays pass through
other points of the pixels.

The n-th of N rays of a pixel passes through the point ((n + 1/2)/N, phi(n)) of Hammersley's set,
phi the binary digits of n mirrored at the point (Hammersley 1960), moved so that the middle of all
is the centre of the pixel. The set fills the pixel evenly, and the mean weighs it alike everywhere,
a box filter. One sample is the centre itself. All pixels share the points, so that a frame costs
what it always does.

This is for pictures. The reference that methods are judged by is that of pixel centres.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from airlight.errors import InputError
from airlight.realtime.area_lights.points import bit_reversed
from airlight.realtime.frame.image import Frame, render_frame
from airlight.realtime.frame.renderer import FrameRenderer
from airlight.realtime.scene.camera import shifted_camera


def pixel_offsets(samples: int) -> Iterator[tuple[float, float]]:
    """Yield where rays pass a pixel, to the right of and below its centre [pixels].

    Both are between -1/2 and 1/2, and 0 in the mean.

    Raises InputError for no sample at all.
    """
    if samples < 1:
        raise InputError(f"samples: got {samples}, expected 1 or more")
    down = bit_reversed(np.arange(samples, dtype=np.uint32)) / 2.0**32
    middle = down.mean()
    for number in range(samples):
        yield (number + 0.5) / samples - 0.5, float(down[number] - middle)


def render_samples(
    renderer: FrameRenderer, samples: int, progress: Callable[[float], None] | None = None
) -> Frame:
    """Render the mean over some rays of each pixel.

    `renderer`: from `realtime.frame.renderer.frame_renderer`. The method prepares the scene again
    for each ray. `samples`: rays of each pixel; 1 is `render_frame`. `progress`: called with the
    fraction done. Returns `Frame`: means of all layers; the distance is that of the first ray.
    """
    camera, frame = renderer.scene.camera, None
    for number, (right, down) in enumerate(pixel_offsets(samples), 1):
        beside = shifted_camera(camera, right, down) if right or down else camera
        # each sample has its own random numbers
        numbered = replace(renderer, frame=renderer.frame + number - 1)
        last = render_frame(replace(numbered, scene=replace(renderer.scene, camera=beside)))
        if samples == 1:
            return last
        airlight, surface, *extra = (
            np.asarray(layer, dtype=np.float64) / samples
            for layer in (last.airlight, last.surface, *last.extra.values())
        )
        part = Frame(airlight, surface, last.distance, dict(zip(last.extra, extra)))
        frame = part if frame is None else _sum(frame, part)
        if progress is not None:
            progress(number / samples)
    assert frame is not None
    return frame


def _sum(frame: Frame, part: Frame) -> Frame:
    extra = {name: layer + part.extra[name] for name, layer in frame.extra.items()}
    return Frame(
        frame.airlight + part.airlight, frame.surface + part.surface, frame.distance, extra
    )
