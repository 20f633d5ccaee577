# SPDX-License-Identifier: BSD-3-Clause
"""Table 1 of Billeter, Sintorn, Assarsson 2010 measured again: static and adaptive tessellation, and their passes.

The published views are the Sponza atrium and the mesh "Yeah Right", each with a light that has one map, probably at the
image size of Fig. 7, 1024 x 1024. Here the hall is `colonnade` with a spot in place of its lamp, which would have six
maps; the irregular mesh is `tangle`. Figures that are illegible in our copy of the paper are left out. Some have lost
their decimal point: these are transcribed "as read", with the point where the other rows and the frames a second have
it.

The passes, in wall-clock time:

- surface: camera rays and lit surface;
- shadow map: its rays;
- laplacian, edge map, tessellate, vertices: those of
  `realtime.methods.light_volumes.published.mesh.tessellation_stages`;
- prepare: all before the airlight, that is the shadow map and the mesh or the height field;
- volume: the rasterisation of the triangles and the signed sum; without triangles the airlight.

Times of frames are those after the light moved, with everything rebuilt, as published; and beside them those of frames
that keep what stood still.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from analytic.errors import InputError
from realtime.errors import InputError as RealtimeError
from realtime.frame.renderer import Frame, FrameRenderer, run_cast_and_shade, run_method
from realtime.methods.light_volumes.published.mesh import tessellation_stages
from realtime.scene.read_scene import Scene, read_scene
from realtime.shadow_maps.projection import light_faces
from realtime.shadow_maps.shadow_map import ShadowMap, cast_shadow_map
from validation.configurations.methods import configuration, prepared
from validation.configurations.timing import Timing, time_repeated
from validation.metrics.errors import Metrics, error_metrics
from validation.papers.billeter_images import LIMIT, SIZE, frame_within, time_rates
from validation.scenes.colonnade import colonnade
from validation.scenes.loading import load_scene, resize

MAPS = (1024, 2048, 4096)  #: of the published table [texels]
#: Parameters by evaluation: static and adaptive as published, the walk without triangles, and with upright walls.
EVALUATIONS: Mapping[str, Mapping[str, str]] = {
    "static": {"evaluation": "mesh", "tessellation": "static"},
    "adaptive": {"evaluation": "mesh", "tessellation": "adaptive"},
    "walk": {"evaluation": "walk", "walls": "slanted"},
    "upright": {"evaluation": "walk", "walls": "upright"},
}
PASSES = ("surface", "shadow map", "laplacian", "edge map", "tessellate", "vertices", "prepare", "volume")


@dataclass(frozen=True)
class PublishedTable:
    """One view of the table."""

    scene: str  #: the built-in scene that stands for it here
    what: str
    fps: Mapping[int, tuple[float, float]]  #: by map, static and adaptive
    passes: Mapping[tuple[int, str], Mapping[str, float]]  #: by map and tessellation, the legible passes [ms]
    #: By map and tessellation, the passes whose figures are "as read".
    as_read: Mapping[tuple[int, str], tuple[str, ...]] = field(default_factory=dict)


TABLE = (
    PublishedTable(
        "colonnade",
        "Sponza, 66 000 triangles",
        {1024: (86, 64), 2048: (35, 35), 4096: (10, 18)},
        {
            (1024, "static"): {"volume": 9.0},
            (1024, "adaptive"): {"laplacian": 0.66, "tessellate": 3.11, "volume": 7.51},
            (4096, "static"): {"volume": 93.9},
            (4096, "adaptive"): {"laplacian": 10.41, "edge map": 0.14, "tessellate": 4.13, "volume": 17.75},
        },
        {
            (1024, "adaptive"): ("laplacian", "tessellate"),
            (4096, "static"): ("volume",),
            (4096, "adaptive"): ("laplacian", "edge map", "tessellate", "volume"),
        },
    ),
    PublishedTable(
        "tangle",
        "Yeah Right, 188 000 triangles",
        {1024: (32, 29), 2048: (21, 21), 4096: (8, 12)},
        {
            (1024, "adaptive"): {"laplacian": 0.74, "edge map": 0.68, "tessellate": 2.59, "volume": 12.27},
            (4096, "static"): {"volume": 96.35},
            (4096, "adaptive"): {"laplacian": 10.19, "tessellate": 15.54, "volume": 27.54},
        },
        {(1024, "adaptive"): ("volume",)},
    ),
)


@dataclass(frozen=True)
class TableRow:
    """A view at a size of the map with one evaluation; if it has no times, `missing` says why."""

    published: PublishedTable  #: the view in the paper
    map: int  #: [texels]
    evaluation: str  #: of `EVALUATIONS`
    size: tuple[int, int]  #: of the frame [pixels]
    faces: int = 1  #: of the shadow map
    triangles: int = 0  #: of the light volume; 0 where it has none
    light_moved: Timing | None = None  #: times as in `validation.papers.billeter_images.FigureRow`
    static: Timing | None = None
    light_moved_camera_kept: Timing | None = None
    colours_changed: Timing | None = None
    passes: Mapping[str, float] = field(default_factory=dict)  #: [ms]
    against_static: Metrics | None = None  #: of the airlight against that of the static mesh
    missing: str | None = None

    @property
    def published_fps(self) -> float | None:
        """Published frames a second; None if the paper has none."""
        place = {"static": 0, "adaptive": 1}.get(self.evaluation)
        rates = self.published.fps.get(self.map)
        return None if place is None or rates is None else rates[place]


def table_rows(
    tables: Sequence[PublishedTable] = TABLE,
    *,
    maps: Sequence[int] = MAPS,
    kernel: str = "exact",
    size: tuple[int, int] = SIZE,
    seconds: float = 0.6,
    limit: float = LIMIT,
    progress: Callable[[float, str], None] | None = None,
) -> list[TableRow]:
    """Measure the table.

    Parameters
    ----------
    tables
        Which views.
    maps
        Sizes of the shadow map, ascending [texels].
    kernel, size, seconds, limit, progress
        See `validation.papers.billeter_images.figure_rows`. A row whose frame must be expected to take longer than
        `limit`, by the last size and the number of texels, is not begun.
    """
    rows: list[TableRow] = []
    total = len(tables) * len(maps) * len(EVALUATIONS)
    for table in tables:
        scene = read_scene(table_scene(table.scene, size))
        last: dict[str, TableRow] = {}
        for texels in maps:
            frames: dict[str, Frame] = {}
            for evaluation in EVALUATIONS:
                if progress is not None:
                    progress(len(rows) / total, f"Table 1, {table.scene}, map {texels}, {evaluation}")
                empty = TableRow(table, texels, evaluation, size, light_faces(scene.lights[0]))
                row = expected_missing(empty, last.get(evaluation), limit)
                if row is None:
                    row = _measured(empty, scene, frames, kernel=kernel, seconds=seconds, limit=limit)
                rows.append(row)
                last[evaluation] = row
    return rows


def table_scene(name: str, size: tuple[int, int]) -> Any:
    """Return the `mi.Scene` of a view: a built-in scene, the hall with a spot in place of its lamp."""
    if name != "colonnade":
        return load_scene(name, size).scene
    described = colonnade()
    lamp = described["lamp"]
    described["lamp"] = {
        "type": "spot",
        "to_world": mi.ScalarTransform4f().look_at(lamp["position"], [-1.13, 0.97, 1.67], [0, 0, 1]),
        "cutoff_angle": 56.7,
        "beam_width": 56.7,
        "intensity": lamp["intensity"],
    }
    scene = mi.load_dict(described)
    resize(scene, size)
    return scene


def expected_missing(empty: TableRow, last: TableRow | None, limit: float) -> TableRow | None:
    """Return a row without measurements and the reason, if the row of the last map predicts a time beyond the limit."""
    if last is None:
        return None
    if last.light_moved is None:
        return replace(empty, missing=f"not begun after map {last.map}: {last.missing}")
    expected = 1e-3 * last.light_moved.median_ms * (empty.map / last.map) ** 2
    if expected <= limit:
        return None
    words = f"a frame may take {expected:.0f} s, by that of map {last.map}: more than the limit of {limit:g} s"
    return replace(empty, missing=words)


def _measured(
    empty: TableRow, scene: Scene, frames: dict[str, Frame], *, kernel: str, seconds: float, limit: float
) -> TableRow:
    """Measure a row; `frames` holds the frames of the same map by evaluation, and receives the new one."""
    values = dict(EVALUATIONS[empty.evaluation]) | {"map": empty.map}
    try:
        renderer = prepared(scene, configuration("light-volumes", kernel, values))
        frame = frames[empty.evaluation] = frame_within(renderer, limit)
        passes, triangles = view_passes(renderer, empty, seconds)
        rates = time_rates(renderer, seconds)
    except (InputError, RealtimeError, MemoryError, TimeoutError) as reason:
        return replace(empty, missing=str(reason) or "out of memory")
    against = frames["static"].airlight if "static" in frames and empty.evaluation != "static" else None
    return replace(
        empty,
        triangles=triangles,
        **rates,
        passes=passes,
        against_static=None if against is None else error_metrics(against, frame.airlight),
    )


def view_passes(renderer: FrameRenderer, row: TableRow, seconds: float) -> tuple[dict[str, float], int]:
    """Return the times of the passes [ms], and the number of triangles of all light volumes."""
    scene = renderer.scene
    ready = renderer.prepare(scene)
    cast, by_light = run_cast_and_shade(renderer)
    dr.eval(cast, by_light)
    works: dict[str, Callable[[], Any]] = {
        "surface": lambda: dr.eval(run_cast_and_shade(renderer)),
        "shadow map": lambda: _shadow_maps(scene, row.map),
        "prepare": lambda: renderer.prepare(scene),
        "volume": lambda: dr.eval(run_method(renderer, ready, cast, by_light)),
    }
    times = {name: time_repeated(work, seconds=seconds, least=3).median_ms for name, work in works.items()}
    if row.evaluation == "adaptive":
        times |= _tessellation(scene, row.map)
    is_mesh = EVALUATIONS[row.evaluation]["evaluation"] == "mesh"
    triangles = sum(len(mesh.triangles) for mesh in ready) if is_mesh else 0
    return {name: times[name] for name in PASSES if name in times}, triangles


def _shadow_maps(scene: Scene, texels: int) -> list[ShadowMap]:
    return [cast_shadow_map(scene.geometry, light, texels) for light in scene.lights]


def _tessellation(scene: Scene, texels: int) -> dict[str, float]:
    """Return the times of the passes of the tessellation, summed over the lights [ms], medians of three."""
    pairs = list(zip(_shadow_maps(scene, texels), scene.lights, strict=True))
    runs = [[tessellation_stages(shadow_map, light)[0] for shadow_map, light in pairs] for _ in range(3)]
    return {name: float(np.median([sum(times[name] for times in run) for run in runs])) for name in runs[0][0]}
