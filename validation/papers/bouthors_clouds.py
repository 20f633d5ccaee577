# SPDX-License-Identifier: BSD-3-Clause
"""Figs 11 and 12 of Bouthors, Neyret, Max, Bruneton, Crassin 2008 again, and the error by order, against light paths.

* Fig. 12, results of the method: `stratocumulus` and `cumulus` by `cloud-collectors`, beside the truth.
* Fig. 11a, a gap that depth maps take for cloud: `ring`, the parts of it that another part shades.
* Fig. 11b, two collectors of equal importance: `two-lobes`. From each point one search starts on the left and one on
  the right; where they end apart there are two collectors, and the method has one.
* By order, in the sun alone: with the whole phase function (`peak=full`) the sets are the orders of the medium, and the
  truth is that of the scene; with the peak cut they are those of the medium without it, and so is the truth.

The noise of the truth is taken out of the root of the mean square, which leaves an error of its own: with as much noise
as light in a pixel, 0.1 in some thousand pixels.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from realtime.clouds.canonical.scene_phase import share_of_peak
from realtime.clouds.canonical.sets import SETS, set_name
from realtime.clouds.collectors.search import Collector
from realtime.clouds.order_layers import order_layer
from realtime.frame.renderer import frame_renderer, render_frame, run_cast_and_shade, run_method
from realtime.methods.registry import METHODS
from realtime.numerics.array_types import array_types
from realtime.scene.read_scene import Scene, read_scene
from reference.scene.clouds import CloudScene, read_clouds
from validation.configurations.timing import first_frame
from validation.estimates.budget import Budget
from validation.estimates.images import cloud_orders, monte_carlo_reference
from validation.scenes.cloud_parts import cloud, droplets, sun, without_peak
from validation.scenes.cumulus import cumulus_mesh
from validation.scenes.loading import LoadedScene, load_scene, resize
from validation.scenes.parts import medium_boundary
from validation.scenes.registry import SCENES
from validation.scenes.ring import ring_mesh
from validation.scenes.stratocumulus import stratocumulus_mesh
from validation.scenes.two_lobes import two_lobes_mesh

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

SIZE, SAMPLES = (80, 60), 512
_FEWER = 4  #: times as few in Fig. 11, of which means over pixels are compared
#: Fig. 12, with the meshes that the medium without its peak is filled into.
RESULTS = {"stratocumulus": stratocumulus_mesh, "cumulus": cumulus_mesh}
GAP, LOBES = "ring", "two-lobes"
_MESHES = {**RESULTS, GAP: ring_mesh, LOBES: two_lobes_mesh}
_METHOD = "cloud-collectors"
_HIGH = (0.013, 0.029, -1.0)  #: way of the sun's light over the ring
_MOST = 16  #: crossings of a ray towards the sun
_ASIDE, _WIDTH = 250.0, 60.0  #: where searches start beside a point, and how wide [m]
_APART = 1.0  #: distance of their ends from which on there are two [sigma]
_SETTLED = 0.05  #: of a search that has ended [sigma]


@dataclass(frozen=True)
class _Pair:
    """The method and the truth of one scene."""

    image: Array
    truth: Array
    error: Array  #: standard error of the truth
    layers: Mapping[str, Array]  #: of the method, by order
    true_layers: Mapping[str, Array]  #: of the truth, with `_se`


def clouds_study(
    *, size: tuple[int, int] = SIZE, samples: int = SAMPLES, progress: Progress | None = None
) -> dict[str, Any]:
    """Measure Figs 11 and 12, and errors by order.

    Parameters
    ----------
    size, samples
        Of the images, and light paths a pixel.
    progress
        Called with (share done, what).

    Returns
    -------
    dict
        `results` by scene: `light`, that of the image over that of the truth, and `rmse`, relative; `by_order` by scene
        rows of `orders` with `share`, that of the light, `light` and `rmse` for `full` and `cut`; `gap`: `share`, that
        of the pixels of the cloud that it shades itself, `light` in `shaded` and in `lit` pixels over that of the
        truth, and `lost`, what the shaded ones lack of the light of the image; `lobes`: `share`, that of the pixels
        whose two searches end apart in a set, `weaker`, the median of the light of the weaker one over that of the
        other, and the light over that of the truth in `two` and in `one`, pixels with two collectors and with one.
    """
    tell = progress or (lambda share, what: None)
    data: dict[str, Any] = {"results": {}, "by_order": {}}
    for number, name in enumerate(RESULTS):
        begin, end = 0.35 * number, 0.35 * (number + 1)
        data["results"][name] = _apart(pair_of(shown(name, size), samples, _part(tell, begin, end, name)))
        data["by_order"][name] = _by_order(name, size, samples, _part(tell, begin + 0.15, end, name))
    fewer = max(2, samples // _FEWER)
    data["gap"] = _gap(shown(GAP, size), fewer, _part(tell, 0.7, 0.85, GAP))
    data["lobes"] = _lobes(shown(LOBES, size), fewer, _part(tell, 0.85, 1.0, LOBES))
    return data


def shown(name: str, size: tuple[int, int]) -> LoadedScene:
    """Return a scene of these figures.

    Those of Fig. 11 are filled with droplets, whose tables are there already; over the ring the sun stands so high that
    the upper part shades the lower.
    """
    if name in RESULTS:
        return load_scene(name, size)
    parts = {"sun": sun(_HIGH, (3.17, 3.05, 2.83))} if name == GAP else {}
    return _filled(name, size, cloud(droplets()), **parts)


def pair_of(loaded: LoadedScene, samples: int, progress: Progress | None = None, **parameters: Any) -> _Pair:
    """Return a scene by the method and by light paths.

    Parameters
    ----------
    loaded
        Of clouds.
    samples
        Light paths a pixel.
    progress
        Called with (share done, what).
    parameters
        Of the method.
    """
    return _paired(_rendered(read_scene(loaded.scene), parameters), _truth(loaded, samples, progress))


def _part(tell: Progress, first: float, last: float, name: str) -> Progress:
    return lambda share, what: tell(first + share * (last - first), f"{name}, {what}")


def _rendered(scene: Scene, parameters: Mapping[str, Any]) -> dict[str, Array]:
    frame = render_frame(frame_renderer(scene, METHODS[_METHOD], extra_layers=True, **parameters))
    layers = {"airlight": frame.airlight} | dict(frame.extra)
    return {name: np.array(values, dtype=np.float64) for name, values in layers.items()}


def _truth(loaded: LoadedScene, samples: int, progress: Progress | None) -> Mapping[str, Array]:
    budget, orders = Budget(samples=samples), cloud_orders("sets")
    image = monte_carlo_reference(loaded, "cloud-paths", budget=budget, orders=orders, progress=progress).image
    return {name: np.array(values, dtype=np.float64) for name, values in image.layers.items()}


def _paired(layers: Mapping[str, Array], truth: Mapping[str, Array]) -> _Pair:
    return _Pair(layers["airlight"], truth["airlight"], truth["airlight_se"], layers, truth)


def _apart(pair: _Pair) -> dict[str, float]:
    return _difference(pair.image, pair.truth, pair.error)


def _difference(image: Array, truth: Array, error: Array) -> dict[str, float]:
    """Return the light of an image over that of the truth, and the relative RMSE without the noise of the truth."""
    mean = truth.mean()
    square = ((image - truth) ** 2).mean() - (error**2).mean()
    return {"light": float(image.mean() / mean), "rmse": float(np.sqrt(max(square, 0.0)) / mean)}


def _by_order(name: str, size: tuple[int, int], samples: int, progress: Progress) -> list[dict[str, Any]]:
    """Return errors by order in the sun alone, of the medium as it is and without the peak of its phase function."""
    whole = _in_the_sun(name, size, None)
    scene = read_scene(whole.scene)
    filled = scene.medium.clouds
    assert filled is not None
    cut = _in_the_sun(name, size, share_of_peak(filled.phases[0], array_types("single")))
    pairs = {
        "full": _paired(_rendered(scene, {"peak": "full"}), _truth(whole, samples, progress)),
        "cut": _paired(_rendered(scene, {}), _truth(cut, samples, progress)),
    }
    rows = []
    for number, (first, _) in enumerate(SETS):
        layer = order_layer(int(first))
        rows.append(
            {"orders": set_name(number)}
            | {
                kind: {"share": float(pair.true_layers[layer].mean() / pair.truth.mean())}
                | _difference(pair.layers[layer], pair.true_layers[layer], pair.true_layers[f"{layer}_se"])
                for kind, pair in pairs.items()
            }
        )
    once = order_layer(1)
    above = {
        kind: {"share": float(1 - pair.true_layers[once].mean() / pair.truth.mean())}
        | _difference(pair.image - pair.layers[once], pair.truth - pair.true_layers[once], pair.error)
        for kind, pair in pairs.items()
    }
    return [*rows, {"orders": "2-inf"} | above]


def _in_the_sun(name: str, size: tuple[int, int], peak: float | None) -> LoadedScene:
    """Return a scene without its sky, and with a share of the peak its medium without that."""
    return _filled(name, size, None if peak is None else without_peak(peak), sky=None)


def _filled(name: str, size: tuple[int, int], medium: dict[str, Any] | None, **parts: Any) -> LoadedScene:
    """Return a scene with another medium in its cloud, if one is given, and other parts; None leaves one out."""
    record = SCENES[name]
    description = {key: part for key, part in (record.build() | parts).items() if part is not None}
    if medium is not None:
        description["cloud"] = medium_boundary("cloud", _MESHES[name](), medium)
    loaded = LoadedScene(name, mi.load_dict(description), record.purpose, record.published)
    resize(loaded.scene, size)
    return loaded


def _gap(loaded: LoadedScene, samples: int, progress: Progress) -> dict[str, float]:
    """Return what is wrong where one part of a cloud shades another across clear air."""
    pair = pair_of(loaded, samples, progress)
    there, shaded = (each.reshape(pair.image.shape[:2]) for each in _shaded(read_clouds(loaded.scene)))
    lit = there & ~shaded
    return {
        "share": float(shaded.sum() / there.sum()),
        "shaded": _ratio(pair, shaded),
        "lit": _ratio(pair, lit),
        "lost": float((pair.truth - pair.image)[shaded].sum() / pair.truth.sum()),
    }


def _ratio(pair: _Pair, where: NDArray[np.bool_]) -> float:
    return float(pair.image[where].sum() / pair.truth[where].sum())


def _shaded(clouds: CloudScene) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return whether pixel-centre rays meet a cloud, and whether the sun's way there leaves it and enters it again."""
    toward = -np.asarray(clouds.suns[0].direction, dtype=np.float64)
    first = clouds.scene.ray_intersect(_rays(np.broadcast_to(clouds.origin, clouds.direction.shape), clouds.direction))
    there = np.array(first.is_valid(), dtype=bool)
    step = 1e-4 * float(np.abs(np.array([clouds.scene.bbox().min, clouds.scene.bbox().max])).max())
    origin = np.array(first.p, dtype=np.float64).T + step * clouds.direction
    going, enters = there.copy(), np.zeros_like(there)
    for _ in range(_MOST):
        hit = clouds.scene.ray_intersect(_rays(origin, np.broadcast_to(toward, origin.shape)), going)
        going &= np.array(hit.is_valid(), dtype=bool)
        enters |= going & ((np.array(hit.n, dtype=np.float64).T @ toward) < 0)
        origin = np.where(going[:, None], np.array(hit.p, dtype=np.float64).T + step * toward, origin)
    return there, enters


def _rays(origin: Array, direction: Array) -> Any:
    return mi.Ray3f(mi.Point3f(np.ascontiguousarray(origin.T)), mi.Vector3f(np.ascontiguousarray(direction.T)))


def _lobes(loaded: LoadedScene, samples: int, progress: Progress) -> dict[str, float]:
    """Return where two searches end apart, and what is wrong there and elsewhere."""
    pair = pair_of(loaded, samples, progress)
    sides = [_searched_from(read_scene(loaded.scene), aside) for aside in (-_ASIDE, _ASIDE)]
    two, weaker = np.zeros(pair.image.shape[:2], dtype=bool), []
    for number in range(len(SETS)):
        (left, light_left, width), (right, light_right, _) = (side[number] for side in sides)
        apart = (
            (np.linalg.norm(left - right, axis=-1) > _APART * width)
            & (width > 0)
            & (light_left > 0)
            & (light_right > 0)
        )
        pairs = np.sort(np.stack([light_left[apart], light_right[apart]]), axis=0)
        weaker.append(pairs[0] / pairs[1])
        two |= apart
    one = (pair.truth.sum(-1) > 0) & ~two
    every = np.concatenate(weaker)
    return {
        "share": float(two.sum() / (two | one).sum()),
        "weaker": float(np.median(every)) if every.size else 0.0,
        "two": _ratio(pair, two) if two.any() else 1.0,
        "one": _ratio(pair, one),
    }


def _searched_from(scene: Scene, aside: float) -> list[tuple[Array, Array, Array]]:
    """Return by set places, light and widths of the collectors that searches end with which start beside points."""
    renderer = frame_renderer(scene, METHODS[_METHOD], extra_layers=True, start="previous", iterations=40)
    cache = first_frame(renderer)
    start = _each(cache.carried, lambda collector: _beside(collector, aside))
    cast, by_light = run_cast_and_shade(renderer)
    *_, extra, _, carried = run_method(renderer, cache.state, cast, by_light, cache.lists, None, start)
    assert extra is not None
    dr.eval(extra, carried)
    shape = scene.camera.height, scene.camera.width
    collectors = carried[0][0][0]
    found = []
    for (first, _), collector in zip(SETS, collectors, strict=True):
        centre = np.array(collector.centre, dtype=np.float64).T.reshape(*shape, 3)
        light = np.array(extra[order_layer(int(first))], dtype=np.float64).sum(0).reshape(shape)
        found.append((centre, light, np.array(collector.width, dtype=np.float64).reshape(shape)))
    return found


def _each(carried: Any, change: Callable[[Collector], Collector]) -> Any:
    """Return what is carried from frame to frame with every collector changed."""
    if isinstance(carried, tuple):
        return tuple(_each(part, change) for part in carried)
    return change(carried)


def _beside(collector: Collector, aside: float) -> Collector:
    zero = dr.zeros(type(collector.width), dr.width(collector.width))
    made = Collector(type(collector.centre)(zero + aside, zero, zero), dr.select(collector.width > 0, zero + _WIDTH, 0))
    dr.eval(made)
    return made
