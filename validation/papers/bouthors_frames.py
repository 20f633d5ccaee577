# SPDX-License-Identifier: BSD-3-Clause
"""Section 9 of Bouthors, Neyret, Max, Bruneton, Crassin 2008 again: frames a second with `cloud-collectors`, 800 x 600.

The paper has a stratocumulus of 130 000 triangles at 10 frames a second, and a cumulus of 5 000 at 10 without and at 2
with procedural noise, on a graphics card of 2007. Frames here go on with the collectors of the last one, and the light
moves, so that its maps are made anew. The clouds are of the paper's kinds and sizes, and shapes of our own; noise is in
a grid of 128^3 voxels, where the paper's shader evaluates noise at each step and stores distances in 512^3.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from realtime.scene.read_scene import read_scene
from validation.frames.cloud_frames import time_frames
from validation.scenes.loading import load_scene

Progress = Callable[[float, str], None]

SIZE = (800, 600)


@dataclass(frozen=True)
class Rate:
    """A rate of the paper."""

    scene: str
    words: str
    fps: float


PUBLISHED = (
    Rate("stratocumulus", "a stratocumulus of 130 000 triangles", 10.0),
    Rate("cumulus", "a cumulus of 5 000 triangles without procedural noise", 10.0),
    Rate("cumulus-detail", "a cumulus of 5 000 triangles with procedural noise", 2.0),
)


def frames_study(*, progress: Progress | None = None) -> dict[str, Any]:
    """Measure the frames of section 9.

    Returns
    -------
    dict
        `frames`: by scene `frame` and `light_moved`, timings [ms].
    """
    times = {}
    for number, rate in enumerate(PUBLISHED):
        if progress is not None:
            progress(number / len(PUBLISHED), rate.scene)
        timings = time_frames(read_scene(load_scene(rate.scene, SIZE).scene))
        times[rate.scene] = {name: asdict(timing) for name, timing in timings.items()}
    return {"frames": times}
