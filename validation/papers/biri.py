# SPDX-License-Identifier: BSD-3-Clause
"""Tables 1 and 2 of Biri, Arques, Michelin 2006 measured again: share of time by stage, frames a second, errors.

The stages of Table 1 are medians of wall-clock times, measured in turns with the whole frame:

1. Silhouettes: `realtime.methods.shadow_planes.silhouettes.silhouette` of the parts whose shadow is in view, with view
   culling, on the host.
2. The scene with surface shadows: camera rays and lit surface, one frozen function. Stage 5 provides the shadows, since
   it counts the layers of shadow anyway.
3. The airlight of the scene without shadows: that of the method `unshadowed` with the same kernel. `shadow-planes`
never
   computes it alone, because each lit segment is a part of it. So this is the cost of one evaluation per ray, and
   stage 5 is reduced by it.
4. Sorting: the planes with their bins, that is the rest of the preparation on the host, and the tile lists.
5. Shadow planes: the airlight after the tile lists, less stage 3.

Rows *as published* have everything that the paper has at once (`as_published`): its polynomial, its order of the
planes, Gamma at vertices, a frame buffer of 8 bits, the cone of 32 planes about a spot. "A reasonable intensity for the
light source" leaves nothing to clamp: the buffer is full at the radiance that all but one in a thousand pixels of the
true frame stay below. Their error is that of the airlight as the buffer shows it, and beside it that of the whole
frame.

A frame takes less time than the sum of the stages, since the host finds planes while the device casts rays and shades.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import NDArray

from realtime.frame.incremental import FrameCache
from realtime.frame.renderer import (
    Frame,
    FrameRenderer,
    render_frame,
    run_cast_and_shade,
    run_cull,
    run_method,
    run_shade,
    run_stages,
)
from realtime.methods.shadow_planes.method import PlanePreparation
from realtime.methods.shadow_planes.silhouettes import silhouette
from realtime.methods.shadow_planes.view_culling import components_in_view
from realtime.scene.camera import read_camera
from realtime.scene.read_scene import Scene, read_scene
from realtime.tiles.layout import SIDE
from reference.quadrature.ray_values import TruthImage
from validation.configurations.methods import TOLERANCE, Configuration, configuration, prepared
from validation.configurations.timing import (
    Timing,
    camera_rays,
    changed_look,
    first_frame,
    moved_light,
    moved_light_alone,
    time_in_turns,
)
from validation.estimates.quadrature import truth_image, truth_of_pixels
from validation.metrics.errors import Metrics, error_metrics
from validation.scenes.loading import load_scene

STAGES = ("silhouettes", "scene", "airlight of the scene", "sorting", "shadow planes")
KERNELS = ("exact", "taylor")
POLYNOMIALS = ("taylor", "taylor-printed")  #: kernels of rows as published


@dataclass(frozen=True)
class Published:
    """The published results for a scene."""

    scene: str  #: name of the built-in scene that stands for it
    where: str  #: table, figure or section of the paper
    size: tuple[int, int]  #: of the frame [pixels]
    fps: float  #: frames a second [1/s]
    shares: tuple[float, ...] | None = None  #: of the stages in Table 1 [%]
    note: str = ""
    cone: int = 0  #: edges of the paper's cone over the spot; 0: no spot


PUBLISHED = (
    Published("sphere-spot", "section 6", (800, 600), 120, cone=32),
    Published("sphere-spot", "section 6", (1024, 768), 107, cone=32),
    Published(
        "two-pens",
        "Fig. 7a",
        (800, 600),
        23,
        (1, 8.7, 21.7, 9.6, 59),
        "Table 2 says 23 frames/s, the prose of section 6 more than 35: the table may have 7a and 7b changed over",
    ),
    Published("three-media", "Fig. 7b", (800, 600), 35, None, "see Fig. 7a; Table 1 has no column for it"),
    Published("clutter", "Fig. 7c", (800, 600), 25, (1.7, 14, 33.6, 16, 34.7)),
    Published("hall", "Fig. 1", (800, 600), 12),
)


@dataclass(frozen=True)
class TableRow:
    """The measurements of a scene at a size with a kernel."""

    published: Published
    kernel: str
    cone: int  #: edges of the pyramid that bounds the spot; 0: the cone itself
    white: float  #: radiance that fills the 8-bit buffer of a row as published; 0 for others [W/(m^2 sr)]
    tolerance: float  #: for interpolation between the corners of tiles; 0: no interpolation
    size: tuple[int, int]  #: of the frame that was timed [pixels]
    triangles: int
    stages_ms: tuple[float, ...]  #: of Table 1, in the order of `STAGES`
    light_moved: Timing  #: a frame after the light moved: all stages
    static: Timing  #: a frame whose planes are there: camera rays, surface, tile lists, airlight
    light_moved_camera_kept: Timing  #: a frame after the light moved, the camera rays of the last one kept
    colours_changed: Timing  #: a frame after only medium or colours changed: planes, tile lists, camera rays are kept
    rays: Timing  #: the camera rays alone
    error: Metrics  #: of the airlight at pixel centres
    frame_error: Metrics  #: of airlight and surfaces together
    error_size: tuple[int, int]  #: of the frame that was compared with the truth [pixels]
    told_apart: bool = True  #: whether stages 3 and 5 differ by more than the spread of their timings

    @property
    def published_variant(self) -> bool:
        """Whether the row is as published."""
        return self.white > 0

    @property
    def shares(self) -> tuple[float | None, ...]:
        """Share of each stage in the sum of all stages, for a frame after the light moved [%].

        One kernel does stages 3 and 5. Stage 3 is timed as an unshadowed frame, stage 5 is what is left: where the
        spread of both timings hides that, neither has a share.
        """
        total = sum(self.stages_ms)
        shares = tuple(100 * stage / total for stage in self.stages_ms)
        return shares if self.told_apart else (*shares[:2], None, shares[3], None)


def biri_row(
    published: Published,
    kernel: str,
    *,
    cone: int = 0,
    tolerance: float = 0.0,
    published_variant: bool = False,
    size: tuple[int, int],
    error_size: tuple[int, int],
    seconds: float = 0.6,
) -> TableRow:
    """Measure one row.

    Parameters
    ----------
    published
        The entry of `PUBLISHED`.
    kernel
        Name of the airlight kernel.
    cone, tolerance
        Parameters of the method, see `realtime.methods.shadow_planes.method` and `realtime.tiles.adaptive_sampling`.
    published_variant
        Whether to do everything as published (`as_published`).
    size
        Width and height of the frame that is timed [pixels].
    error_size
        Width and height of the frame that is compared with the truth [pixels]. With a tolerance the frame that is timed
        is compared, in as many of its pixels: the error of interpolation depends on the size of a pixel.
    seconds
        Approximate time to spend on each timing [s].
    """
    changed = {"cone": cone, "tolerance": tolerance}
    chosen = Configuration("shadow-planes", kernel, tuple((name, value) for name, value in changed.items() if value))
    loaded = load_scene(published.scene, size).scene
    scene = read_scene(loaded)
    white = 0.0
    if tolerance:
        renderer = prepared(scene, chosen)
        error, frame_error = _errors_of_some(loaded, render_frame(renderer), error_size[0] * error_size[1])
    else:
        small = load_scene(published.scene, error_size).scene
        truth = truth_image(small)
        if published_variant:
            white = buffer_white(truth.airlight + truth.surface)
            chosen = as_published(kernel, white=white, cone=cone)
        frame = render_frame(prepared(read_scene(small), chosen))
        error, frame_error = _errors(truth, frame.airlight, frame.surface)
        renderer = prepared(scene, chosen)
    kept = first_frame(renderer)
    works = [
        moved_light(renderer),
        lambda: run_stages(renderer, kept.state),
        moved_light_alone(renderer, kept),
        changed_look(renderer, kept),
        camera_rays(renderer),
        *_stages(renderer, kernel, kept),
    ]
    light_moved, static, light_moved_camera_kept, colours_changed, rays, *stages = time_in_turns(
        works, seconds=8 * seconds
    )
    return TableRow(
        published,
        kernel,
        cone,
        white,
        tolerance,
        size,
        sum(shape.face_count() for shape in loaded.shapes()),
        _shared([stage.median_ms for stage in stages]),
        light_moved,
        static,
        light_moved_camera_kept,
        colours_changed,
        rays,
        error,
        frame_error,
        size if tolerance else error_size,
        told_apart=told_apart(stages[2], stages[5]),
    )


def as_published(kernel: str, *, white: float, cone: int = 0) -> Configuration:
    """Return shadow planes with all that the paper has.

    Parameters
    ----------
    kernel
        The polynomial.
    white
        The radiance that fills the buffer [W/(m^2 sr)].
    cone
        Edges of the cone over a spot; 0 for other lights.
    """
    media = "printed" if kernel == "taylor-printed" else "kernel"
    values = {"order": "paper", "evaluation": "vertex", "buffer": "8bit", "white": white, "media": media, "cone": cone}
    return configuration("shadow-planes", kernel, {name: value for name, value in values.items() if value != "kernel"})


def buffer_white(frame: NDArray[np.float64]) -> float:
    """Return the radiance below which all but one in a thousand pixels of a frame stay in all channels."""
    return float(np.quantile(frame.max(axis=-1), 0.999))


def _errors(truth: TruthImage, airlight: Any, surface: Any) -> tuple[Metrics, Metrics]:
    """Return the error of the airlight, and that of the whole frame."""
    whole = error_metrics(truth.airlight + truth.surface, airlight + surface)
    return error_metrics(truth.airlight, airlight), whole


def _errors_of_some(scene: Any, frame: Frame, count: int) -> tuple[Metrics, Metrics]:
    """Return the same of so many pixels of a frame at most: one, drawn at random, of as many stretches of its rows."""
    height, width = frame.distance.shape
    count = min(count, height * width)
    ends = np.arange(count + 1) * (height * width) // count
    pixels = np.random.default_rng(0).integers(ends[:-1], ends[1:])
    airlight, surface = (
        np.asarray(layer, dtype=np.float64).reshape(-1, 3)[None, pixels] for layer in (frame.airlight, frame.surface)
    )
    return _errors(truth_of_pixels(scene, pixels), airlight, surface)


def biri_rows(
    published: Sequence[Published] = PUBLISHED,
    kernels: Sequence[str] = KERNELS,
    *,
    scale: float = 1.0,
    error_size: tuple[int, int] | None = None,
    seconds: float = 0.6,
    progress: Callable[[float, str], None] | None = None,
) -> list[TableRow]:
    """Measure the rows of both tables.

    Parameters
    ----------
    published, kernels
        What to measure: every entry with every kernel, a spot both with its cone and with the pyramid of the paper,
        the kernel `exact` also with the tolerance `validation.configurations.methods.TOLERANCE`, and the polynomials
        of the paper also with all that it has (`as_published`).
    scale
        Factor on the width and height of all images; 1 for the published sizes.
    error_size
        See `biri_row`; half the width and height of a frame by default.
    seconds
        Approximate time to spend on each timing [s].
    progress
        Callback with the share done and a description of the next step, or None.
    """
    wanted: list[tuple[Published, str, dict[str, Any]]] = []
    for entry in published:
        for kernel in kernels:
            wanted += [(entry, kernel, {"cone": cone}) for cone in dict.fromkeys((0, entry.cone))]
            wanted += [(entry, kernel, {"tolerance": TOLERANCE})] if kernel == "exact" else []
            if kernel in POLYNOMIALS:
                wanted += [(entry, kernel, {"cone": entry.cone, "published_variant": True})]
    rows: list[TableRow] = []
    for entry, kernel, changed in wanted:
        size = _whole_tiles(scale * entry.size[0]), _whole_tiles(scale * entry.size[1])
        compared = error_size or (max(1, size[0] // 2), max(1, size[1] // 2))
        if progress is not None:
            progress(len(rows) / len(wanted), f"{entry.scene}, {size[0]} x {size[1]}, {kernel}")
        rows.append(biri_row(entry, kernel, **changed, size=size, error_size=compared, seconds=seconds))
    return rows


def _whole_tiles(length: float) -> int:
    """Return the side of an image of at least three whole tiles, so that tiles can be interpolated [pixels]."""
    return SIDE * max(3, round(length / SIDE))


def told_apart(unshadowed: Timing, airlight: Timing) -> bool:
    """Return whether the airlight of a frame takes longer than without shadows, by more than the quartiles of both."""
    return airlight.low_ms > unshadowed.high_ms


def _shared(measured: Sequence[float]) -> tuple[float, ...]:
    """Return the time of each stage of Table 1 [ms], from the times of `_stages`."""
    silhouettes, surface, unshadowed, host, in_tiles, airlight = measured
    sorting = max(0.0, host - silhouettes) + in_tiles
    return silhouettes, surface, unshadowed, sorting, max(0.0, airlight - unshadowed)


def _stages(renderer: FrameRenderer, kernel: str, kept: FrameCache) -> list[Callable[[], Any]]:
    """Return the work of silhouettes, scene, unshadowed airlight, all on the host, tile lists, and airlight."""
    scene = renderer.scene
    cast = kept.cast
    by_light = run_shade(renderer, cast)
    dr.eval(cast, by_light)
    plain = prepared(scene, Configuration("unshadowed", kernel))
    return [
        lambda: _silhouettes(renderer, scene),
        lambda: dr.eval(run_cast_and_shade(renderer)),
        lambda: dr.eval(run_method(plain, (), cast, (), ())),
        lambda: renderer.prepare(scene),
        lambda: run_cull(renderer, kept.state, cast.distance),
        lambda: dr.eval(run_method(renderer, kept.state, cast, by_light, kept.lists)),
    ]


def _silhouettes(renderer: FrameRenderer, scene: Scene) -> None:
    assert isinstance(renderer.prepare, PlanePreparation)
    casters, camera = renderer.prepare.standing(scene), read_camera(scene.camera)
    for light in scene.lights:
        position = np.array(light.position, dtype=np.float64).ravel()
        silhouette(casters, position, used=components_in_view(casters, camera, position))
