# SPDX-License-Identifier: BSD-3-Clause
"""The growth of times with the work of a scene, which has less and more of one kind of work, step
by step.

| kind | work | what changes |
|---|---|---|
| `size` | pixels | the image has half, twice and four times the width and height |
| `triangles` | triangles of opaque meshes | each is cut into four, with bumps (see below) |
| `lights` | lights without extent | each stands beside itself again, with its fraction of the intensity |
| `map` | texels on a side of a shadow map | the parameter `map` |

The other kinds keep the image at the size that is asked for.

A flat triangle cut into four has no new silhouette. All vertices therefore move by
one smooth map of space,

    u(p) = p + sum_i a_i sin(k_i . p + i),     |a_i| |k_i| = 0.15,     i = 1 .. 4,

with wavelengths from a quarter to a thirtieth of the scene's size. The norms of its derivative less
the identity add up to 0.6 < 1: it is one to one, so that closed meshes stay closed, and what was
disjoint is disjoint. Its bumps turn smooth outlines into silhouettes of which more and more edges
are found as triangles shrink below the wavelengths, about the root of their number. Equal places
move equally, so that seams of doubled vertices stay closed. Bounds of media and area lights stay as
they are: they must be convex, or of their shape.

A column t = t_0 w^e of the work w has the exponent e, the slope of log t over log w by least
squares. The constant cost of a frame makes the exponent of a time smaller. Between two steps a time
may grow at most as

| work | a frame | the light moved | objects moved | why |
|---|---|---|---|---|
| pixels | 1 | 1 | 1 | each ray is by itself |
| triangles | 1/2 | 1 | 1 | rays meet silhouettes; preparation looks at every triangle |
| lights | 1 | 1 | 1 | one after the other |
| texels on a side of a map | 1 | 2 | 2 | a ray crosses a row of texels; the map has their square |

A step that is steeper by more than 0.6 is a cliff, where it takes longer than 5 ms: something
overflows there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import linregress

from airlight.errors import InputError
from airlight.realtime.methods.shader.source import is_shader
from airlight.realtime.scene.animate import turned_light
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.mesh_adjacency import mesh_triangles, scene_of
from airlight.realtime.scene.read_scene import Scene, read_scene
from airlight.validation.arrays import Array, Counted
from airlight.validation.clock import time_repeated
from airlight.validation.columns import record_of
from airlight.validation.scenes.loading import load_scene
from airlight.validation.scenes.meshes import divided, rotation
from airlight.validation.scenes.parts import mesh_with_material
from airlight.validation.study.configuration import Parameters
from airlight.validation.study.frame_times import camera_rays
from airlight.validation.study.row import Growth, Row
from airlight.validation.study.run import run, with_times
from airlight.validation.study.study import GROWTH, Cell, Study
from airlight.validation.study.turns import time_cells
from airlight.validation.timing import Scaling, TimeGrowth, TimingRun, joined

TIMES = ("frame", "light_moved", "objects_moved")
#: By kind of work, the exponents of `TIMES`.
USUAL = {
    "size": (1.0, 1.0, 1.0),
    "triangles": (0.5, 1.0, 1.0),
    "lights": (1.0, 1.0, 1.0),
    "map": (1.0, 2.0, 2.0),
}


@dataclass(frozen=True)
class Step:
    """A scene with some work."""

    work: float  #: of its kind
    scene: Callable[[], Scene]
    #: of the method, beside the configuration's own
    parameters: Parameters = field(default_factory=dict)


def ladder(kind: str, name_or_path: str, size: tuple[int, int]) -> list[Step]:
    """Return the steps of a kind of work, of `GROWTH`, for a scene at a size
    [pixels], the least work first.

    Raises InputError for a scene without work of that kind.
    """
    makers = {"size": _sizes, "triangles": _triangles, "lights": _lights, "map": _maps}
    if kind not in makers:
        raise InputError(
            f"scaling: got {kind!r}, expected some of {', '.join(GROWTH)}, with commas between them"
        )
    return makers[kind](name_or_path, size)


def _sizes(name: str, size: tuple[int, int]) -> list[Step]:
    width, height = size
    factors = (0.5, 1, 2, 4)  # of each side
    sizes = [(max(1, round(width * factor)), max(1, round(height * factor))) for factor in factors]
    # Half of one pixel is one pixel, too: a step has more work than the one before.
    return [Step(at[0] * at[1], partial(_read, name, at)) for at in dict.fromkeys(sizes)]


def _read(name: str, size: tuple[int, int]) -> Scene:
    return read_scene(load_scene(name, size).scene)


def _triangles(name: str, size: tuple[int, int]) -> list[Step]:
    # Each level has four times the triangles of the one before; one step shows no growth.
    count = triangles_of(load_scene(name, size).scene)
    most = 5_300_000  # a mesh of so many takes some gigabytes with what is made of it
    levels = [level for level in range(10) if 0 < count * 4**level <= most]
    if len(levels) < 2:
        raise InputError(
            f"scaling triangles: {name} has {count} triangles of opaque meshes; expected some, and "
            "four times as many "
            f"not more than {most}; use another scene"
        )
    return [Step(count * 4**level, partial(_finer, name, size, level)) for level in levels]


def _finer(name: str, size: tuple[int, int], level: int) -> Scene:
    return read_scene(subdivided(load_scene(name, size).scene, level))


def _lights(name: str, size: tuple[int, int]) -> list[Step]:
    scene = _read(name, size)
    count = len(scene.lights)
    if not count:
        raise InputError(
            f"scaling lights: {name} has area lights only; expected a point, spot or directional "
            "one"
        )
    return [Step(count * copies, partial(with_copies, scene, copies)) for copies in (1, 2, 4, 8)]


def with_copies(scene: Scene, copies: int) -> Scene:
    """Return a scene in which each light without extent stands several times, with its
    fraction of the intensity.
    """
    here = np.array(scene.camera.origin, dtype=np.float64).ravel()
    lights = tuple(
        _copy(light, number, copies, here) for light in scene.lights for number in range(copies)
    )
    return replace(scene, lights=lights)


def _copy(light: Light, number: int, copies: int, camera: Array) -> Light:
    light = replace(light, intensity=light.intensity / copies)
    if number == 0:
        return light
    position = np.array(light.position, dtype=np.float64).ravel()
    # Copies of a light from infinity are 2.3 degrees from one another, about an arbitrary axis.
    if light.extent is not None:
        return turned_light(light, position, rotation((0.31, 0.53, 0.79), 2.3 * number))
    # Copies of a light at a place stand on a spiral: 2.4 rad is the golden angle, and the root of
    # the number keeps neighbours about equally far apart. The step is a fraction of the distance
    # from the camera.
    step = 0.07 * np.linalg.norm(position - camera)
    aside = (
        step
        * number**0.5
        * np.array([np.cos(2.4 * number), np.sin(2.4 * number), 0.3 * np.cos(1.7 * number)])
    )
    return replace(light, position=type(light.position)(*(float(c) for c in position + aside)))


def _maps(name: str, size: tuple[int, int]) -> list[Step]:
    sides = (128, 256, 512, 1024, 2048)
    return [Step(side, partial(_read, name, size), {"map": side}) for side in sides]


def triangles_of(scene: mi.Scene) -> int:
    """Return the number of triangles of the meshes of a scene that `subdivided` cuts."""
    return sum(int(shape.face_count()) for shape in scene.shapes() if _is_cut(shape))


def subdivided(scene: mi.Scene, levels: int) -> mi.Scene:
    """Return a scene whose opaque meshes have 4^levels times the triangles, and bumps.

    Raises InputError for a scene without opaque meshes.
    """
    if not triangles_of(scene):
        raise InputError(
            "triangles: the scene has no opaque meshes, which alone can have more triangles; use "
            "another"
        )
    box = scene.bbox()
    low, high = (np.array(corner, dtype=np.float64) for corner in (box.min, box.max))
    shapes = [
        _cut(shape, levels, low, float(np.linalg.norm(high - low))) for shape in scene.shapes()
    ]
    return with_shapes(scene, shapes)


def with_shapes(scene: mi.Scene, shapes: Iterable[mi.Shape]) -> mi.Scene:
    """Return a scene of other shapes, with the camera and the lights without extent of a scene."""
    emitters = (emitter for emitter in scene.emitters() if emitter.class_name() != "AreaLight")
    parts = {f"emitter-{number}": emitter for number, emitter in enumerate(emitters)}
    return scene_of(list(shapes), {"sensor": scene.sensors()[0]} | parts)


def _cut(shape: mi.Shape, levels: int, corner: Array, size: float) -> mi.Shape:
    if not _is_cut(shape):
        return shape
    mesh = mesh_triangles(shape)
    for _ in range(levels):
        mesh = divided(mesh)
    vertices, faces = mesh
    cut = mesh_with_material(shape.id(), (bumpy(vertices, corner, size), faces), shape.bsdf())
    cut.set_id(shape.id())
    return cut


def bumpy(points: Array, corner: Array, size: float) -> Array:
    """Return points (n, 3) after the map of space above, for a scene of a
    `size` from a `corner` on [m].
    """
    moved = points.copy()
    # How many waves there are along the size of the scene, by axis: k_i of the module.
    waves = ((3.1, 2.3, -1.1), (-5.3, 6.7, 3.7), (11.3, -7.9, 9.1), (-17.3, 15.1, 13.9))
    for number, wave in enumerate(np.asarray(waves) * (2 * np.pi / size), 1):
        # A displacement across the wave, a_i with |a_i| |k_i| = 0.15.
        across = np.cross(wave, (0.31, 0.53, 0.79))
        height = 0.15 / np.linalg.norm(wave)
        moved += (
            height
            * across
            / np.linalg.norm(across)
            * np.sin((points - corner) @ wave + number)[:, None]
        )
    return moved


def _is_cut(shape: mi.Shape) -> bool:
    return shape.is_mesh() and not shape.is_emitter() and shape.bsdf().class_name() != "Null"


def study_growth(
    study: Study, kind: str, steps: Sequence[Step], *, progress: Counted | None = None
) -> list[Scaling]:
    """Measure how methods grow with a kind of work, in steps of `ladder`, in the first scene.

    Methods take turns in each step; steps follow one another, as their scenes are too large to be
    loaded together. The anchor of all steps says whether the machine changed between them. A method
    ends at the first step that it refuses. Raises InputError for a shader, of which OpenGL times
    the passes alone, and no frame after anything moved.
    """
    for chosen in study.configurations:
        if is_shader(chosen.method):
            raise InputError(
                f"scaling: {chosen.method} is a shader, whose frames are timed only while nothing "
                "moves; expected methods of Python"
            )
    # `rows`: for each configuration a row of each step, until it refuses one.
    name = study.scenes[0]
    rows: list[list[Row]] = [[] for _ in study.configurations]
    runs: list[TimingRun] = []
    anchor: Callable[[], object] | None = None
    for number, step in enumerate(steps):
        scene = step.scene()
        # Steps are compared with one another: the camera rays of the first are the anchor of all.
        anchor = anchor or camera_rays(scene)
        size = scene.camera.width, scene.camera.height
        # The step is rendered once by each method that has not refused a smaller one: a row says
        # what it needs, or why it refuses.
        cells: list[Cell | None] = []
        for place, (chosen, steps_done) in enumerate(zip(study.configurations, rows, strict=True)):
            cell = None
            if all(row.status == "done" for row in steps_done):
                of_step = replace(
                    chosen,
                    parameters=tuple((dict(chosen.parameters) | dict(step.parameters)).items()),
                )
                cell = Cell(name, size, (), of_step, study.measure, (kind, step.work))
                steps_done.append(run(cell, scene, None)[0])
            cells.append(cell if cell is not None and steps_done[-1].status == "done" else None)
            if progress is not None:
                done = number * len(rows) + place + 1
                progress(done, len(steps) * len(rows), f"{kind} {step.work:g}, {chosen.label}")
        # Camera rays alone are timed at each step as well: the least that a frame of it can take.
        timings = time_cells(cells, partial(_same, scene), anchor=anchor)
        rays = time_repeated(camera_rays(scene), seconds=0.5 * study.measure.seconds, least=3)
        for of_method, cell, timed in zip(rows, cells, timings, strict=True):
            if cell is not None:
                work = Growth(kind, step.work, rays)
                of_method[-1] = replace(with_times(of_method[-1], timed), work=work)
        # All methods of a step are of one run: the first says all there is to say of it.
        runs += [
            each.times.run
            for each in timings
            if each.times is not None and each.times.run is not None
        ][:1]
    # A record for each configuration, of the steps that were timed.
    scalings = []
    for chosen, of_method in zip(study.configurations, rows):
        timed_steps = [
            (row, row.times.measured, row.work)
            for row in of_method
            if row.times is not None and row.work is not None
        ]
        costs = [
            {**times, "work": work.amount, "rays": work.rays, "memory": row.memory}
            for row, times, work in timed_steps
        ]
        works = [work.amount for _, _, work in timed_steps]
        medians = {name: [times[name].median_ms for _, times, _ in timed_steps] for name in TIMES}
        scaling = {
            "scene": Path(name).stem,
            "size": study.sizes[0],
            "label": chosen.label,
            "kind": kind,
            "costs": costs,
            "growth": {each: growth(kind, each, works, ms) for each, ms in medians.items()},
            "refused": of_method[-1].reason,
            "run": joined(runs) if runs else None,
        }
        scalings.append(record_of(scaling, Scaling))
    return scalings


def _same(scene: Scene, cell: Cell) -> Scene:
    return scene


def growth(kind: str, name: str, works: Sequence[float], times: Sequence[float]) -> TimeGrowth:
    """Return the growth of one of `TIMES` with the work; `times`: [ms] at steps of a kind of work,
    the least work first.
    """
    exponent, standard_error = fitted_exponent(works, times)
    # The exponent of each step by itself, with the work at its end: a cliff hides in the mean
    # exponent of all steps.
    steps = list(pairwise(zip(works, times)))
    local = [
        (math.log(after / before) / math.log(second / first), second)
        for (first, before), (second, after) in steps
    ]
    # Steeper by 0.6, 4 times the work takes 2.3 times as long as it may. Below 5 ms launches and
    # clocks decide a time [ms].
    most, short = USUAL[kind][TIMES.index(name)] + 0.6, 5.0
    cliffs = [
        each for each, (_, (_, after)) in zip(local, steps) if each[0] > most and after > short
    ]
    # A steeper step of short times is none.
    steepest, at = max(cliffs or local, default=(None, None))
    values = {
        "exponent": exponent,
        "standard_error": standard_error,
        "steepest": steepest,
        "at": at,
        "cliff": bool(cliffs),
    }
    return record_of(values, TimeGrowth)


def fitted_exponent(works: ArrayLike, values: ArrayLike) -> tuple[float, float]:
    """Return the exponent with which values (n,) grow with works (n,), and its standard error.

    The exponent is that of least squares of the logarithms, NaN for fewer than two values that are
    positive and finite; its standard error, from the scatter about the line, for fewer than three.
    """
    n, e = np.asarray(works, dtype=np.float64), np.asarray(values, dtype=np.float64)
    counts = (e > 0) & np.isfinite(e)
    if counts.sum() < 2:
        return math.nan, math.nan
    line = linregress(np.log(n[counts]), np.log(e[counts]))
    return float(line.slope), float(line.stderr) if counts.sum() > 2 else math.nan
