# SPDX-License-Identifier: BSD-3-Clause
"""Mitsuba's volumetric path tracer as the check by code that nobody here wrote.

`volpath` with ``max_depth = 2`` is exactly one scattering, on a surface or in the medium (DESIGN
section 6.4). It is run along the pixel-centre rays from the pinhole itself, so neither the
reconstruction filter, nor the film's float32 sums, nor the near clip plane come into play; what
remains of Mitsuba's biases is the shadow-ray epsilon (`reference.scene.shadow_epsilon`).

Airlight and surface come apart by two runs: with black surfaces only the medium scatters, with
albedo 0 only surfaces do. Where the extinction depends on the channel, each channel has its own run
in grey media, since a path that picks its channel at random may have infinite variance (DESIGN
section 6.7). Boundaries of media are of type 'null': paths go through them without counting an
edge, and they stay as they are when surfaces turn black.

Area lights: light seen directly belongs to neither layer. With `hide_emitters` Mitsuba 3.9.1's
`volpath` leaves it out, and what the light's own shape does stays: a black one ends camera rays,
one of type 'null' lets them pass (its integrator `direct` looks through both). Part of such light
comes by rays that the phase function or a surface sends on, with a weight; these are not shortened,
so the shadow-ray epsilon counts in part. The fluence of such a light is at most 2 pi times its
radiance, and so the variance is bounded. Past the boundary of a medium, a shadow ray starts further
on than the epsilon of a short segment and meets a black light itself: within about 0.3 m of bounds,
black lights are too dim.

Clouds come by order of scattering: one more edge of the paths is one more order. Runs with
`max_depth` n + 1 and n, of equal seeds, share their paths up to order n - 1, and their difference
is order n alone, to rounding. Surfaces are black in these runs; all light with their own materials,
less all without, is what met a surface. `hide_emitters` is not used there: the sky behind the
clouds is in every run and cancels.

Each batch has its own seed and at most 256 samples a pixel on the average; what a pixel gets may
differ, see `reference.monte_carlo.batches`. Sums, means and standard errors are taken in float64.
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from itertools import pairwise

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.reference.monte_carlo.batches import Batches, check_samples, single_batch
from airlight.reference.monte_carlo.volpath_gaps import CannotTrace, check_gaps
from airlight.reference.scene.clouds import Cloud, CloudScene
from airlight.reference.scene.convex_bounds import Bounds, read_bounds
from airlight.reference.scene.homogeneous_medium import VACUUM, ReferenceMedium
from airlight.reference.scene.read import ReferenceScene, whole_scene
from airlight.reference.scene.varying import GridMedium, HeightMedium, VaryingMedium

Array = NDArray[np.float64]
Counts = NDArray[np.integer]

# the parameters of a medium that are its extinction and its albedo
_VALUES = ("sigma_t.value.value", "albedo.value.value")


@dataclass(frozen=True)
class _Traced:
    """A scene, and the rays along which it is traced."""

    scene: "mi.Scene"
    media: tuple[ReferenceMedium | VaryingMedium, ...]  #: all of them, also that of the camera
    origin: Array  #: where all rays start [m], (3,)
    direction: Array  #: unit, one ray a pixel, (pixels, 3)


def volpath_batch(
    reference: ReferenceScene,
    seed: int,
    samples: int,
    *,
    max_depth: int = 2,
    counts: Counts | None = None,
) -> Batches:
    """Trace one batch.

    `reference`: the scene; `seed`: seed of the batch; different seeds are independent; `samples`:
    samples a pixel, at most 256; `max_depth`: most edges of a path: 2 is one scattering. With more,
    `airlight` is the light that was scattered by the medium alone, any number of times up to
    max_depth - 1, and `surface` all other light: what met a surface at least once. `counts`:
    samples of each pixel, (layers, pixels), for `max_depth` 2; all have `samples` by default.
    Raises InputError under a directional light for a scene whose size Mitsuba does not
    know. Raises ValueError if `samples` or `max_depth` is out of range, or `counts`
    come with another `max_depth` than 2.

    Batches of one seed but another `max_depth` are not independent: their airlight paths begin
    alike, so that the difference of the two has less spread than either.
    """
    check_samples(samples)
    if max_depth < 2:
        raise ValueError(f"max_depth: got {max_depth}, expected at least 2, one scattering")
    if counts is not None and max_depth != 2:
        raise ValueError(
            "counts: got some with multiple scattering, whose layers are traced along the same "
            "paths"
        )
    in_air, on_surface = (
        np.full((2, reference.width * reference.height), samples) if counts is None else counts
    )
    if reference.directional or reference.sky is not None:
        _check_far(reference)
    check_gaps(
        [(medium.name, medium.bounds, float(medium.largest.max())) for medium in reference.media]
    )
    # Light seen directly belongs to neither layer.
    hidden = {"hide_emitters": True} if reference.is_sampled else {}
    traced = _Traced(
        whole_scene(reference),
        (reference.medium, *reference.media),
        reference.origin,
        reference.direction,
    )
    integrator = mi.load_dict(
        {"type": "volpath", "max_depth": max_depth, "rr_depth": 1000} | hidden
    )
    # With black surfaces all light was scattered by the medium alone.
    with black_surfaces(reference.occluders):
        airlight = _trace(traced, integrator, 2 * seed, in_air)
    surface = np.zeros_like(airlight)
    if reference.occluders.shapes() and max_depth == 2:
        surface = _trace(traced, integrator, 2 * seed + 1, on_surface, scattering=False)
    elif reference.occluders.shapes():
        # The same paths once more, now with light from surfaces; the difference is what these add.
        surface = _trace(traced, integrator, 2 * seed, in_air) - airlight
    return single_batch(seed, samples, np.stack([airlight, surface]))


def _convex(cloud: Cloud) -> Iterator[tuple[str, Bounds, float]]:
    """Yield a cloud with convex bounds, for `check_gaps`: gaps of others are not measured, nor the
    extinction of a grid at its bounds.
    """
    with suppress(InputError):
        edge = 0.0 if cloud.density else float(cloud.largest.max())
        yield cloud.name, read_bounds(cloud.shape), edge


def _check_far(reference: ReferenceScene) -> None:
    """Refuse fog in which Mitsuba would cut light paths from infinity, whose length is twice the
    radius of all shapes.

    Light of a sky comes from all directions. Its paths must leave height fog down to 60 degrees
    from the zenith; lower ones may be cut, and then miss the thin upper part of the fog.
    """
    if not reference.scene.bbox().valid():  # of rectangles alone, merged, in Mitsuba 3.9.1
        raise CannotTrace(
            "volpath: the scene's bounding box is not valid, so lights from infinity start within "
            "it"
        )
    medium, radius = reference.medium, float(reference.scene.bbox().bounding_sphere().radius)
    needed = 0.0
    if isinstance(medium, HeightMedium):
        # The rise of the lowest light path out of the fog; 0.5 is 60 degrees from the zenith, for a
        # sky.
        rises = [float(-sun.direction @ medium.up) for sun in reference.directional] + [0.5] * (
            reference.sky is not None
        )
        needed = 0.5 * (medium.cap - medium.floor) / min(rises)
    elif isinstance(medium, GridMedium):
        needed = 0.5 * float(np.linalg.norm(medium.high - medium.low))
    if radius < needed:
        raise CannotTrace(
            "volpath: the light paths of a sun or a sky end within the fog, since the shapes of "
            f"the scene have a radius of {radius:.4g} m; expected {needed:.4g} m: add ground, or "
            "lower the cap of height fog"
        )


@contextmanager
def black_surfaces(scene: "mi.Scene") -> Iterator[None]:
    """Make every surface black within the block."""
    black = mi.load_dict({"type": "diffuse", "reflectance": 0.0})
    materials = [(shape, shape.bsdf()) for shape in scene.shapes()]
    try:
        for shape, _ in materials:
            shape.set_bsdf(black)
        yield
    finally:
        for shape, bsdf in materials:
            shape.set_bsdf(bsdf)


def _trace(
    traced: _Traced,
    integrator: "mi.Integrator",
    seed: int,
    counts: Counts,
    *,
    scattering: bool = True,
) -> Array:
    """Return the mean radiance of every pixel, (pixels, 3) [W/(m^2 sr)].

    `traced`: the scene; `integrator`: of Mitsuba; `seed`: of the whole image; `counts`: paths of
    each pixel, (pixels,); `scattering`: whether media scatter.
    """
    image = np.zeros((len(counts), 3))
    parts = _parts(counts)
    # Channels with the same extinction in all media are traced together.
    extinctions = np.stack([medium.largest for medium in traced.media], axis=1)
    for number, sigma_t in enumerate(dict.fromkeys(map(tuple, extinctions))):
        channels = np.all(extinctions == sigma_t, axis=1)
        with _grey_media(traced, int(np.argmax(channels)), scattering) as medium:
            for place, part in enumerate(parts):
                stream = stream_of(seed, number, place)
                image[part, channels] = _trace_pixels(
                    traced, integrator, medium, part, stream, counts[part]
                )[:, channels]
    return image


def stream_of(seed: int, extinction: int, part: int) -> int:
    """Return the number of a random stream, below 2^32: others for other seeds of images, extinctions
    and parts.

    Images may be cut into different numbers of parts, so this number must not count. The streams of
    a part are those of the first, shifted by a multiple of 2^32 over the golden ratio: shifts of
    different parts lie far from one another, and seeds of images are below 2^21.
    """
    return (seed * 3 + extinction + part * 0x9E3779B1) % 2**32


def _parts(counts: Counts) -> list[slice]:
    """Cut the pixels into parts that have about 2^22 paths together, or are one pixel."""
    part = (np.cumsum(counts) - 1) // (1 << 22)
    edges = [0, *(np.flatnonzero(np.diff(part)) + 1), len(counts)]
    return [slice(int(start), int(end)) for start, end in pairwise(edges)]


def _trace_pixels(
    traced: _Traced,
    integrator: "mi.Integrator",
    medium: "mi.Medium | None",
    pixels: slice,
    seed: int,
    counts: Counts,
) -> Array:
    """Return the mean radiance of some pixels, (pixels, 3); `medium`: where camera rays start."""
    # A kernel is compiled for the alignment of the memory that it reads, and NumPy's varies.
    direction = dr.normalize(mi.Vector3f(traced.direction[pixels].T))
    dr.eval(direction)
    # The pixel of each path, copied into memory of Dr.Jit.
    numbers = mi.UInt32(np.repeat(np.arange(len(counts), dtype=np.uint32), counts))
    pixel = dr.empty(mi.UInt32, dr.width(numbers))
    dr.scatter(pixel, numbers, dr.arange(mi.UInt32, dr.width(numbers)))
    dr.eval(pixel)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, dr.width(pixel))
    start = mi.Point3f(*traced.origin.tolist())
    ray = mi.Ray3f(start, dr.gather(mi.Vector3f, direction, pixel))
    radiance, _, _ = integrator.sample(traced.scene, sampler, mi.RayDifferential3f(ray), medium)
    dr.eval(radiance)  # all channels at once: one after the other, each would trace the paths again
    # The paths of a pixel follow one another: one sum for each pixel, in float64.
    first = np.cumsum(counts, dtype=np.int64) - counts
    sums = [np.add.reduceat(np.array(channel, dtype=np.float64), first) for channel in radiance]
    return np.stack(sums, axis=1) / counts[:, None]


@contextmanager
def _grey_media(traced: _Traced, channel: int, scattering: bool) -> "Iterator[mi.Medium | None]":
    """Give all media the extinction of one channel within the block; yield the medium in which
    camera rays start.
    """
    originals: list[tuple[mi.Medium, dict[str, mi.Float | mi.Color3f]]] = []
    try:
        for medium in traced.media:
            # Shapes may share a medium.
            if medium.plugin is not None and all(
                medium.plugin != plugin for plugin, _ in originals
            ):
                parameters = mi.traverse(medium.plugin)
                # The extinction of a grid is grey already.
                keys = (key for key in _VALUES if key in parameters)
                originals.append(
                    (medium.plugin, {key: type(parameters[key])(parameters[key]) for key in keys})
                )
                sigma_t = float(medium.largest[channel]) / float(parameters["scale"] or 1.0)
                _set_values(medium.plugin, sigma_t, medium.albedo if scattering else np.zeros(3))
        yield traced.scene.sensors()[0].get_medium()
    finally:
        for plugin, values in originals:
            parameters = mi.traverse(plugin)
            for key, value in values.items():
                parameters[key] = value
            parameters.update()


def _set_values(plugin: "mi.Medium", sigma_t: float, albedo: Array) -> None:
    """Set the extinction, before the medium's scale, and the albedo."""
    parameters = mi.traverse(plugin)
    for key, value in zip(_VALUES, (np.full(3, sigma_t), albedo), strict=True):
        if key not in parameters:
            continue
        kind = type(parameters[key])
        # A grey number of Mitsuba is one value, a colour three.
        parameters[key] = (
            kind(*(float(v) for v in value)) if "Color" in kind.__name__ else kind(float(value[0]))
        )
    parameters.update()


def volpath_orders_batch(
    clouds: CloudScene, seed: int, samples: int, *, sets: Sequence[tuple[str, tuple[int, float]]]
) -> Batches:
    """Trace one batch of the layers `airlight` and `surface`, and of a layer for each set of
    orders.

    `clouds`: the scene; `seed`: seed of the batch; different seeds are independent; `samples`:
    samples a pixel, at most 256; `sets`: names of sets of orders with their first and last order,
    the last `math.inf` for one without end.
    """
    check_samples(samples)
    check_gaps([body for cloud in clouds.clouds for body in _convex(cloud)])
    traced = _Traced(clouds.scene, (VACUUM, *clouds.clouds), clouds.origin, clouds.direction)
    counts = np.full(len(clouds.direction), samples)

    def up_to(order: float) -> Array:
        depth = -1 if math.isinf(order) else int(order) + 1
        integrator = mi.load_dict({"type": "volpath", "max_depth": depth, "rr_depth": 1 << 20})
        return _trace(traced, integrator, seed, counts)

    # A set of orders is the difference of two runs: up to its last order, and up to the order
    # before its first.
    ends = {0, math.inf} | {end for _, (first, last) in sets for end in (first - 1, last)}
    with black_surfaces(clouds.occluders):
        sums = {order: up_to(order) for order in sorted(ends)}
    airlight = sums[math.inf] - sums[0]
    # Light that met a surface: all light with the surfaces' own materials less all light with black
    # ones.
    surface = (
        up_to(math.inf) - sums[math.inf] if clouds.occluders.shapes() else np.zeros_like(airlight)
    )
    by_set = [sums[last] - sums[first - 1] for _, (first, last) in sets]
    names = ("airlight", "surface", *("airlight_" + name.replace("-", "_") for name, _ in sets))
    return single_batch(seed, samples, np.stack([airlight, surface, *by_set]), layers=names)
