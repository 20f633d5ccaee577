# SPDX-License-Identifier: BSD-3-Clause
"""Tables 1 and 2 and the times of section 6 of Biri, Arques, Michelin 2006 measured again, at the published sizes.

*As published* has everything that the paper has at once: its polynomial, its order of the planes, Gamma at vertices, a
frame buffer of 8 bits, the cone of 32 planes about a spot. "A reasonable intensity for the light source" leaves nothing
to clamp: the buffer is full at the radiance that all but one in a thousand pixels of the true frame stay below.

The stages of Table 1 are wall-clock times, measured in turns with the whole frame:

1. Silhouettes: of the parts whose shadow is in view, on the host.
2. The scene with surface shadows: camera rays and lit surface. Stage 5 provides the shadows, since it counts the layers
   of shadow anyway.
3. The airlight of the scene without shadows: that of the method `unshadowed` with the same kernel. `shadow-planes`
   never computes it alone, because each lit segment is a part of it. So this is the cost of one evaluation per ray, and
   stage 5 is reduced by it.
4. Sorting: the planes with their bins, that is the rest of the preparation on the host, and the tile lists.
5. Shadow planes: the airlight after the tile lists, less stage 3.
"""

from collections.abc import Callable, Mapping
from typing import Any

import drjit as dr
import numpy as np

from realtime.frame.renderer import FrameRenderer, render_frame, run_cast_and_shade, run_method, run_shade
from realtime.methods.shadow_planes.method import PlanePreparation
from realtime.methods.shadow_planes.silhouettes import components_in_view, silhouette
from realtime.scene.camera import read_camera
from realtime.scene.read_scene import Scene, read_scene
from validation.clock import time_in_turns
from validation.estimates.quadrature import reference_image
from validation.metrics.errors import error_metrics, known
from validation.scenes.loading import load_scene
from validation.study.configuration import Configuration, configuration, prepared
from validation.study.frame_times import first_frame, moved_light
from validation.timing import Timing

STAGES = ("silhouettes", "scene", "airlight", "sorting", "planes")  #: of Table 1
_COMPARED = (320, 240)  # size of the frames that are compared: the default report keeps these references [pixels]
_SECONDS = 0.1  # for each timing [s]


#: By the name of its figures a scene that stands for one of the paper, its size [pixels], the edges of the paper's cone
#: over the spot, 0 where there is none, and whether Table 1 has it.
ENTRIES: Mapping[str, tuple[str, tuple[int, int], int, bool]] = {
    "sphere-spot 800": ("sphere-spot", (800, 600), 32, False),
    "sphere-spot 1024": ("sphere-spot", (1024, 768), 32, False),
    "two-pens": ("two-pens", (800, 600), 0, True),
    "three-media": ("three-media", (800, 600), 0, False),
    "clutter": ("clutter", (800, 600), 0, True),
    "hall": ("hall", (800, 600), 0, False),
}


def biri_tables(*, scale: float = 1.0, seconds: float = _SECONDS) -> dict[str, Any]:
    """Return rates as published and by our exact form, fractions of stages [%], and the largest median error.

    All images have the published width and height times `scale`; each timing takes about so many `seconds`.
    """
    figures: dict[str, Any] = {}
    errors = []
    for name, (scene_name, full, cone, staged) in ENTRIES.items():
        size, compared = _scaled(full, scale), _scaled(_COMPARED, scale)
        scene = read_scene(load_scene(scene_name, size).scene)
        small = load_scene(scene_name, compared).scene
        reference = reference_image(small)
        whole = reference.airlight + reference.surface
        chosen = as_published("taylor", white=float(np.quantile(whole.max(axis=-1), 0.999)), cone=cone)
        frame = render_frame(prepared(read_scene(small), chosen))
        errors.append(known(error_metrics(whole, frame.airlight + frame.surface).p50))
        published, ours = prepared(scene, chosen), prepared(scene, configuration("shadow-planes", "exact"))
        works = [moved_light(published), moved_light(ours)]
        stages = _stage_works(published, "taylor") if staged else []
        times = time_in_turns(works + stages, seconds=(len(works) + len(stages)) * seconds)
        figures |= {f"{name} fps": times[0].rate, f"{name} ours fps": times[1].rate}
        if staged:
            figures |= {f"{name} {stage}": each for stage, each in fractions(times[2:]).items()}
    return figures | {"median error": max(errors)}


def as_published(kernel: str, *, white: float, cone: int = 0) -> Configuration:
    """Return shadow planes with all that the paper has.

    The kernel is 'taylor' or 'taylor-printed', `white` the radiance that fills the buffer [W/(m^2 sr)], and `cone` the
    edges of the cone over a spot, 0 for other lights.
    """
    media = {"media": "printed"} if kernel == "taylor-printed" else {}
    values = {"order": "paper", "evaluation": "vertex", "buffer": "8bit", "white": white, "cone": cone}
    return configuration("shadow-planes", kernel, values | media)


def fractions(times: list[Timing]) -> dict[str, list[float]]:
    """Return of the stages their fraction in the sum [%], and of the planes the time over that of the next stage.

    Each has the ends of its interval: the quartile of the stage that is least, with the others' that are most, and the
    other way round.
    """
    silhouettes, surface, unshadowed, host, airlight = (time.interval for time in times)

    def less(whole: list[float], part: list[float]) -> list[float]:
        return [max(0.0, whole[at] - part[other]) for at, other in ((0, 0), (1, 2), (2, 1))]

    stages = silhouettes, surface, unshadowed, less(host, silhouettes), less(airlight, unshadowed)
    sums = [sum(stage[at] for stage in stages) for at in range(3)]
    found = {}
    for name, (middle, low, high) in zip(STAGES, stages):
        ends = middle / sums[0], low / (low + sums[2] - high), high / (high + sums[1] - low)
        found[name] = [100 * end for end in ends]
    *others, planes = stages
    next_stage = [max(stage[at] for stage in others) for at in range(3)]
    found["main cost"] = [planes[at] / next_stage[other] for at, other in ((0, 0), (1, 2), (2, 1))]
    return found


def _stage_works(renderer: FrameRenderer, kernel: str) -> list[Callable[[], Any]]:
    """Return the work of silhouettes, scene, unshadowed airlight, all on the host, and airlight."""
    scene, cached = renderer.scene, first_frame(renderer)
    cast = cached.cast
    by_light = run_shade(renderer, cast)
    dr.eval(cast, by_light)
    plain = prepared(scene, Configuration("unshadowed", kernel))
    return [
        lambda: _silhouettes(renderer, scene),
        lambda: dr.eval(run_cast_and_shade(renderer)),
        lambda: dr.eval(run_method(plain, plain.prepare(scene), cast, by_light)),
        lambda: renderer.prepare(scene),
        lambda: dr.eval(run_method(renderer, cached.state, cast, by_light)),
    ]


def _silhouettes(renderer: FrameRenderer, scene: Scene) -> None:
    preparation = renderer.stages.prepare
    assert isinstance(preparation, PlanePreparation)
    occluders, camera = preparation.standing(scene), read_camera(scene.camera)
    for light in scene.lights:
        position = np.array(light.position, dtype=np.float64).ravel()
        silhouette(occluders, position, used=components_in_view(occluders, camera, position))


def _scaled(size: tuple[int, int], scale: float) -> tuple[int, int]:
    """Return a size times a scale, in whole tiles of four pixels."""
    width, height = (max(16, 4 * round(scale * side / 4)) for side in size)
    return width, height
