# SPDX-License-Identifier: BSD-3-Clause
"""What moves in the papers' scenes, and how frames depend on the number of triangles.

*Motion.* Six frames of each scene's own animation at the published size: pens that turn, a bar before the lamp that
turns between three media, a lamp that circles and changes its colour, a lamp that circles in the hall. The last frame
is rendered again by a renderer that saw none of the others: where both are the same, no precomputation is needed.

*Triangles.* The sphere of `sphere-spot` with ever finer facets. Timed in turns: the whole frame after the light moved,
and of `light-volumes` what is not the rendering of the view or of the shadow map, that is its volume.
"""

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from realtime.frame.incremental import FrameCache
from realtime.frame.renderer import image_frame, render_frame, run_cast_and_shade, run_method
from realtime.scene.read_scene import Scene, read_scene
from realtime.shadow_maps.shadow_map import cast_shadow_map
from validation.configurations.methods import configuration, prepared
from validation.configurations.timing import Timing, moved_light, time_in_turns, timed_frame
from validation.metrics.errors import error_metrics
from validation.scenes.animation import animate, moved_parts
from validation.scenes.loading import load_scene, resize
from validation.scenes.parts import lathe, mitsuba_mesh, placed
from validation.scenes.record import Animation
from validation.scenes.sphere_spot import sphere_spot

SIZE = (800, 600)  #: of the frames in motion [pixels]
MOTIONS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "pens": ("two-pens", ("objects",)),
    "media": ("three-media", ("objects", "medium")),
    "light": ("clutter", ("light", "colour")),
    "hall": ("hall", ("light",)),
}
_FRAMES = 7
FACETS = (16, 64, 256, 512)  #: of a ring of the sphere: 512 to half a million triangles
_TRIANGLE_SIZE, _MAP = (512, 512), 512


def motions(seconds: float = 0.0) -> dict[str, Any]:
    """Return for each motion the frames a second, and the relative RMSE of its last frame to one made afresh."""
    return {name: _moved(scene, moves) for name, (scene, moves) in MOTIONS.items()}


def _moved(name: str, moves: tuple[str, ...]) -> dict[str, Any]:
    loaded = load_scene(name, SIZE)
    animation: Animation = replace(loaded.animation, moves=moves)
    scene = read_scene(loaded.scene)
    chosen = configuration("shadow-planes", "exact")
    renderer = prepared(scene, chosen)
    cache: FrameCache | None = None
    times, error = [], 0.0
    for number, now in enumerate(animate(scene, animation, _FRAMES)):
        parts = moved_parts(animation)
        stages, cache, took = timed_frame(renderer, now, cache, **parts)
        times.append(took)
        if number == _FRAMES - 1:
            afresh = render_frame(prepared(now, chosen)).airlight
            error = error_metrics(afresh, image_frame(renderer, stages).airlight).relative_rmse
    # The first frame compiles the kernels, the second records.
    low, median, high = (float(value) for value in np.percentile(times[2:], [25, 50, 75]))
    return {"ms": {"median_ms": median, "low_ms": low, "high_ms": high}, "error": error}


def triangles(seconds: float = 0.3) -> dict[str, Any]:
    """Return timings by method and number of triangles.

    Returns
    -------
    dict
        `rows`: `triangles`, and timings [ms] of `frame` and `volume` (light volumes), `planes` (a frame of shadow
        planes).
    """
    return {"rows": [_timed(facets, seconds) for facets in FACETS]}


def _timed(facets: int, seconds: float) -> dict[str, Any]:
    scene, count = _sphere(facets)
    chosen = configuration("light-volumes", "exact", {"evaluation": "walk", "walls": "slanted", "map": _MAP})
    volumes = prepared(scene, chosen)
    planes = prepared(scene, configuration("shadow-planes", "exact"))
    state = volumes.prepare(scene)
    cast, by_light = run_cast_and_shade(volumes)
    dr.eval(cast, by_light)
    works = [
        moved_light(volumes),
        lambda: dr.eval(run_method(volumes, state, cast, by_light)),
        moved_light(planes),
        lambda: [cast_shadow_map(scene.geometry, light, _MAP) for light in scene.lights],
    ]
    frame, volume, all_planes, shadow_map = time_in_turns(works, seconds=seconds * len(works))
    return {"triangles": count} | {
        name: _plain(timing)
        for name, timing in (("frame", frame), ("volume", volume), ("planes", all_planes), ("shadow_map", shadow_map))
    }


def _plain(timing: Timing) -> dict[str, float]:
    return asdict(timing)


def _sphere(facets: int) -> tuple[Scene, int]:
    """Return `sphere-spot` with a round sphere of so many facets a ring, and its number of triangles."""
    described = sphere_spot()
    polar = np.pi * (1 - (np.arange(facets) + 0.5) / facets)
    mesh = placed(lathe(0.47 * np.sin(polar), 0.47 * np.cos(polar), facets), (0.11, -0.07, 1.93))
    described["sphere"] = mitsuba_mesh("sphere", mesh, (0.57, 0.31, 0.23))
    scene = mi.load_dict(described)
    resize(scene, _TRIANGLE_SIZE)
    return read_scene(scene), sum(shape.face_count() for shape in scene.shapes())
