# SPDX-License-Identifier: BSD-3-Clause
"""Figs 11 and 12 and section 9 of Bouthors, Neyret, Max, Bruneton, Crassin 2008
again, against light paths.

* Fig. 12, results of the method: `stratocumulus` and `cumulus` by
  `cloud-collectors`, beside the reference.
* Fig. 11a, a gap that depth maps take for cloud: `ring`, the parts of it that another part shades.
* Fig. 11b, two collectors of equal importance: `two-lobes`. From each point one search starts on
  the left and one on the right; where they end apart there are two collectors, and the method has
  one.
* Section 9, frames a second at 800 x 600: frames go on with the collectors of the last one, and the
  light moves, so that its maps are made again. Clouds are of the paper's kinds and sizes, noise is
  in a grid of 128^3 voxels, where the paper's shader evaluates noise at each step and stores
  distances in 512^3.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.realtime.clouds.canonical.coordinates import SETS, order_layer
from airlight.realtime.clouds.collector_search import Collector
from airlight.realtime.frame.image import render_frame
from airlight.realtime.frame.renderer import frame_renderer, run_cast_and_shade, run_method
from airlight.realtime.methods.registry import METHODS
from airlight.realtime.scene.mesh_adjacency import mesh_triangles
from airlight.realtime.scene.read_scene import Scene, read_scene
from airlight.reference.scene.clouds import CloudScene, read_clouds
from airlight.validation.arrays import Array, Bools, Progress
from airlight.validation.clock import time_repeated
from airlight.validation.estimates.images import Budget, monte_carlo_reference
from airlight.validation.papers.claims import INTERVAL, Figure, Figures, Result, quartiles
from airlight.validation.scenes.loading import LoadedScene, load_scene, resize
from airlight.validation.scenes.parts import fog, medium_boundary, sun, tabulated_phase
from airlight.validation.scenes.registry import SCENES
from airlight.validation.statistics.samples import LEVEL, student_quantile
from airlight.validation.study.frame_times import first_frame
from airlight.validation.timing import Timing

SIZE, SAMPLES = (80, 60), 512

RESULTS = ("stratocumulus", "cumulus")  #: of Fig. 12
FRAMES = (*RESULTS, "cumulus-detail")  #: of section 9
GAP, LOBES = "ring", "two-lobes"  #: of Fig. 11
_METHOD = "cloud-collectors"

#: The collectors that a frame hands on to the next, by group of lights, light, and set of orders.
_Carried = Collector | tuple["_Carried", ...]


def clouds_figures() -> Figures:
    """Return light over that of the reference in Figs 11 and 12, and what shaded
    surfaces of Fig. 11a lack [%].
    """
    every = np.ones(SIZE[::-1], dtype=bool)
    figures: dict[str, Result] = {
        name: _ratio(*pair_of(shown(name, SIZE), SAMPLES), every) for name in RESULTS
    }
    fewer = SAMPLES // 4  # in Fig. 11, where means over pixels are compared
    # Fig. 11a: only the pixels in which another part of the cloud shades the surface are compared.
    loaded = shown(GAP, SIZE)
    pair, shaded = pair_of(loaded, fewer), _shaded(read_clouds(loaded.scene)).reshape(SIZE[::-1])
    figures["gap, shaded"], figures["gap, lost"] = _ratio(*pair, shaded), _lost(*pair, shaded)
    loaded = shown(LOBES, SIZE)
    # Fig. 11b: the pixels in which both searches found light at different places.
    two = _two_collectors(loaded)
    figures["lobes, two"] = (
        _ratio(*pair_of(loaded, fewer), two) if two.any() else "no pixel has two collectors"
    )
    return figures


def _ratio(image: Array, reference: Array, error: Array, where: Bools) -> Figure:
    """Return the light of an image over that of the reference in some
    pixels, with its 95 % interval.
    """
    light, expected = image[where].sum(), reference[where].sum()
    # Errors of colours of one pixel come from the same paths; they are added, not their squares.
    half = student_quantile(0.5 + LEVEL / 2, math.inf) * np.sqrt((error[where].sum(-1) ** 2).sum())
    value, low, high = (float(light / at) for at in (expected, expected + half, expected - half))
    return Figure(value, low, high, INTERVAL)


def _lost(image: Array, reference: Array, error: Array, where: Bools) -> Figure:
    """Return what an image lacks in some pixels, over all light of the reference [%], with its
    95 % interval.
    """
    whole = float(reference.sum())
    lost = float((reference - image)[where].sum()) / whole
    # The derivative by the light of the reference in a pixel: (1 - lost)/whole in these pixels,
    # -lost/whole in the others. Errors of colours are added as in `_ratio`.
    slopes = (where - lost) / whole
    half = student_quantile(0.5 + LEVEL / 2, math.inf) * float(
        np.sqrt(((error.sum(-1) * slopes) ** 2).sum())
    )
    return Figure(100 * lost, 100 * (lost - half), 100 * (lost + half), INTERVAL)


def cloud_frames() -> Figures:
    """Return the frames a second of section 9: after the light moved, with the
    collectors of the last frame.
    """
    timings = {
        name: _light_moved(read_scene(load_scene(name, (800, 600)).scene)) for name in FRAMES
    }
    return {name: quartiles(timing.rate) for name, timing in timings.items()}


def _light_moved(scene: Scene) -> Timing:
    # Three steps at most, from the collectors of the last frame.
    renderer = frame_renderer(scene, METHODS[_METHOD], start="previous", iterations=3)
    # The first frame searches from the start; timed are the frames after it.
    cache = first_frame(renderer)

    def work() -> None:
        cast, lit = run_cast_and_shade(renderer)
        dr.eval(run_method(renderer, cache.state, cast, lit, cache.carried))

    maps = time_repeated(lambda: renderer.prepare(scene), seconds=1.0)
    frame = time_repeated(work, seconds=1.0)
    # When the light moves, its maps are made again and a frame is rendered: both times add up.
    median, low, high = (
        of_maps + of_frame
        for of_maps, of_frame in zip(maps.quartiles, frame.quartiles, strict=True)
    )
    return Timing(median, low, high, min(maps.repetitions, frame.repetitions))


def shown(name: str, size: tuple[int, int]) -> LoadedScene:
    """Return a scene of these figures.

    Those of Fig. 11 are filled with droplets, whose tables are there already; over the ring the sun
    stands so high that the upper part shades the lower.
    """
    if name in RESULTS:
        return load_scene(name, size)
    record = SCENES[name]
    high = (0.013, 0.029, -1.0)  # way of the sun's light over the ring
    description = record.build() | ({"sun": sun(high, (3.17, 3.05, 2.83))} if name == GAP else {})
    # The boundary of the built-in cloud with the paper's droplets inside.
    droplets = fog(0.0363, (0.99997,) * 3, tabulated_phase("mie", 20001))
    description["cloud"] = medium_boundary("cloud", mesh_triangles(description["cloud"]), droplets)
    loaded = LoadedScene(name, mi.load_dict(description), record.purpose, record.published)
    resize(loaded.scene, size)
    return loaded


def pair_of(
    loaded: LoadedScene, samples: int, progress: Progress | None = None
) -> tuple[Array, Array, Array]:
    """Return the image of a scene by the method, the image by light paths, and the standard error
    of the second, (height, width, 3) each [W/(m^2 sr)].

    `samples`: light paths a pixel.
    """
    frame = render_frame(frame_renderer(read_scene(loaded.scene), METHODS[_METHOD]))
    # The batches of light paths give the standard error.
    traced = monte_carlo_reference(
        loaded, "cloud-paths", budget=Budget(samples=samples), orders=(), progress=progress
    ).image
    method, paths, error = (
        np.array(layer, dtype=np.float64)
        for layer in (frame.airlight, traced.layers["airlight"], traced.layers["airlight_se"])
    )
    return method, paths, error


def _shaded(clouds: CloudScene) -> Bools:
    """Return which pixel-centre rays meet a cloud at a point whose way to the sun leaves
    the cloud and enters again.
    """
    toward = -np.asarray(clouds.suns[0].direction, dtype=np.float64)
    # From the first point of the cloud, a little inside, towards the sun: a ray that leaves the
    # cloud and enters again is shaded by another part.
    first = clouds.scene.ray_intersect(
        _rays(np.broadcast_to(clouds.origin, clouds.direction.shape), clouds.direction)
    )
    going = np.array(first.is_valid(), dtype=bool)
    step = 1e-4 * float(np.abs(np.array([clouds.scene.bbox().min, clouds.scene.bbox().max])).max())
    origin = np.array(first.p, dtype=np.float64).T + step * clouds.direction
    enters = np.zeros_like(going)
    for _ in range(16):  # crossings of a ray towards the sun
        hit = clouds.scene.ray_intersect(
            _rays(origin, np.broadcast_to(toward, origin.shape)), going
        )
        going &= np.array(hit.is_valid(), dtype=bool)
        # A face whose normal points against the way to the sun is an entry.
        enters |= going & ((np.array(hit.n, dtype=np.float64).T @ toward) < 0)
        origin = np.where(
            going[:, None], np.array(hit.p, dtype=np.float64).T + step * toward, origin
        )
    return enters


def _rays(origin: Array, direction: Array) -> mi.Ray3f:
    return mi.Ray3f(
        mi.Point3f(np.ascontiguousarray(origin.T)), mi.Vector3f(np.ascontiguousarray(direction.T))
    )


def _two_collectors(loaded: LoadedScene) -> Bools:
    """Return the pixels in which two searches end apart in some set of orders, both
    with light, (height, width).
    """
    # Searches start 250 m on either side of a point.
    sides = [_searched_from(read_scene(loaded.scene), aside) for aside in (-250.0, 250.0)]
    apart = []
    # By set of orders: both searches must have ended with light, and farther apart than one width
    # of the collector.
    for (first, first_light, width), (second, second_light, _) in zip(*sides, strict=True):
        far = np.linalg.norm(first - second, axis=-1) > width
        apart.append(far & (width > 0) & (first_light > 0) & (second_light > 0))
    return np.any(apart, axis=0)


def _searched_from(scene: Scene, aside: float) -> list[tuple[Array, Array, Array]]:
    """Return the collectors of searches that start so far beside points [m]: by set of orders their
    places, (height, width, 3), light and widths, (height, width) each.
    """
    renderer = frame_renderer(
        scene, METHODS[_METHOD], extra_layers=True, start="previous", iterations=40
    )
    cache = first_frame(renderer)
    # The collectors of a first frame are moved aside; up to 40 steps from there find the nearest
    # collector.
    start = _each(cache.carried, lambda collector: _beside(collector, aside))
    cast, lit = run_cast_and_shade(renderer)
    rendered = run_method(renderer, cache.state, cast, lit, start)
    extra, carried = rendered.extra, rendered.carried
    assert extra is not None
    dr.eval(extra, carried)
    shape = scene.camera.height, scene.camera.width
    collectors = []
    for (first, _), collector in zip(SETS, carried[0][0][0], strict=True):
        centre = np.array(collector.centre, dtype=np.float64).T.reshape(*shape, 3)
        light = np.array(extra[order_layer(int(first))], dtype=np.float64).sum(0).reshape(shape)
        width = np.array(collector.width, dtype=np.float64).reshape(shape)
        collectors.append((centre, light, width))
    return collectors


def _each(carried: _Carried, change: Callable[[Collector], Collector]) -> _Carried:
    """Return the state that frames hand on, with every collector changed."""
    if isinstance(carried, tuple):
        return tuple(_each(part, change) for part in carried)
    return change(carried)


def _beside(collector: Collector, aside: float) -> Collector:
    # Only where the first frame had a collector: elsewhere the width stays 0.
    zero = dr.zeros(type(collector.width), dr.width(collector.width))
    made = Collector(
        type(collector.centre)(zero + aside, zero, zero),
        dr.select(collector.width > 0, zero + 60.0, 0),  # how wide a search starts [m]
    )
    dr.eval(made)
    return made
