# SPDX-License-Identifier: BSD-3-Clause
"""Mitsuba's volumetric path tracer as the check by code that nobody here wrote.

`volpath` with ``max_depth = 2`` is exactly one scattering, on a surface or in the medium (DESIGN section 6.4). It is
run along the pixel-centre rays from the pinhole itself, so neither the reconstruction filter, nor the film's float32
sums, nor the near clip plane come into play; what remains of Mitsuba's biases is the shadow-ray epsilon
(`reference.epsilon`).

Airlight and surface come apart by two runs: with black surfaces only the medium scatters, with albedo 0 only surfaces
do. Where the extinction depends on the channel, each channel has a run of its own in grey media, since a path that
picks its channel at random may have infinite variance (DESIGN section 6.7). Boundaries of media are of type 'null':
paths go through them without counting an edge, and they stay as they are when surfaces turn black.

Each batch has its own seed and at most 256 samples a pixel; means and standard errors are taken over the batches in
float64.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.batches import Batches, check_samples, single_batch
from reference.scene import TruthMedium, TruthScene

Array = NDArray[np.float64]

_PATHS = 1 << 22  # paths traced at once
_VALUES = ("sigma_t.value.value", "albedo.value.value")  # what decides the numbers among a medium's parameters


def volpath_batch(truth: TruthScene, seed: int, samples: int, *, max_depth: int = 2) -> Batches:
    """Trace one batch.

    Parameters
    ----------
    truth
        The scene.
    seed
        Seed of the batch; different seeds are independent.
    samples
        Samples a pixel, at most 256.
    max_depth
        Most edges of a path: 2 is one scattering. With more, `airlight` is the light that was scattered by the medium
        alone, any number of times up to max_depth - 1, and `surface` all other light: what met a surface at least once.

    Notes
    -----
    Batches of one seed but another `max_depth` are not independent: their airlight paths begin alike, so that the
    difference of the two has less spread than either.
    """
    import mitsuba as mi

    check_samples(samples)
    if max_depth < 2:
        raise ValueError(f"max_depth: got {max_depth}, wanted at least 2, one scattering")
    integrator = mi.load_dict({"type": "volpath", "max_depth": max_depth, "rr_depth": 1000})
    with _black_surfaces(truth.occluders):
        airlight = _trace(truth, integrator, 2 * seed, samples)
    surface = np.zeros_like(airlight)
    if truth.occluders.shapes() and max_depth == 2:
        surface = _trace(truth, integrator, 2 * seed + 1, samples, scattering=False)
    elif truth.occluders.shapes():
        # The same paths once more, now with light from surfaces; the difference is what these add.
        surface = _trace(truth, integrator, 2 * seed, samples) - airlight
    return single_batch(seed, samples, np.stack([airlight, surface]))


@contextmanager
def _black_surfaces(scene) -> Iterator[None]:
    """Make every surface black for a while."""
    import mitsuba as mi

    black = mi.load_dict({"type": "diffuse", "reflectance": 0.0})
    own = [(shape, shape.bsdf()) for shape in scene.shapes()]
    try:
        for shape, _ in own:
            shape.set_bsdf(black)
        yield
    finally:
        for shape, bsdf in own:
            shape.set_bsdf(bsdf)


def _trace(truth: TruthScene, integrator, seed: int, samples: int, *, scattering: bool = True) -> Array:
    """Return the mean radiance of every pixel, (pixels, 3)."""
    pixels = truth.width * truth.height
    rows = max(1, _PATHS // samples)
    image = np.zeros((pixels, 3))
    extinctions = np.stack([medium.sigma_t for medium in (truth.medium, *truth.media)], axis=1)
    for number, sigma_t in enumerate(dict.fromkeys(map(tuple, extinctions))):
        channels = np.all(extinctions == sigma_t, axis=1)
        with _grey_media(truth, int(np.argmax(channels)), scattering) as medium:
            for start in range(0, pixels, rows):
                # Streams differ by seed; the chunk and the channel get seeds of their own.
                stream = (seed * 3 + number) * (pixels // rows + 1) + start // rows
                part = slice(start, min(start + rows, pixels))
                image[part, channels] = _trace_pixels(truth, integrator, medium, part, stream, samples)[:, channels]
    return image


def _trace_pixels(truth: TruthScene, integrator, medium, pixels: slice, seed: int, samples: int) -> Array:
    import drjit as dr
    import mitsuba as mi

    direction = mi.Vector3f(truth.direction[pixels].T)
    count = dr.width(direction)
    lane = dr.arange(mi.UInt32, count * samples)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, count * samples)
    start = mi.Point3f(*(float(c) for c in truth.origin))
    ray = mi.Ray3f(start, dr.normalize(dr.gather(mi.Vector3f, direction, lane // samples)))
    radiance, _, _ = integrator.sample(truth.scene, sampler, mi.RayDifferential3f(ray), medium)
    means = [np.array(dr.block_sum(channel, samples), dtype=np.float64) / samples for channel in radiance]
    return np.stack(means, axis=1)


@contextmanager
def _grey_media(truth: TruthScene, channel: int, scattering: bool) -> Iterator[Any]:
    """Give all media the extinction of one channel for a while; yield the medium in which camera rays begin."""
    import mitsuba as mi

    if not truth.media:
        yield _grey_medium(truth.medium, float(truth.medium.sigma_t[channel]), scattering)
        return
    own: list[tuple[Any, dict[str, Any]]] = []
    try:
        for medium in (truth.medium, *truth.media):
            # Shapes may share a medium.
            if medium.plugin is not None and all(medium.plugin != plugin for plugin, _ in own):
                parameters = mi.traverse(medium.plugin)
                own.append((medium.plugin, {key: type(parameters[key])(parameters[key]) for key in _VALUES}))
                sigma_t = float(medium.sigma_t[channel]) / float(parameters["scale"] or 1.0)
                _set_values(medium.plugin, sigma_t, medium.albedo if scattering else np.zeros(3))
        yield truth.scene.sensors()[0].get_medium()
    finally:
        for plugin, values in own:
            parameters = mi.traverse(plugin)
            for key, value in values.items():
                parameters[key] = value
            parameters.update()


def _set_values(plugin: Any, sigma_t: float, albedo: Array) -> None:
    """Set the extinction, before the medium's scale, and the albedo."""
    import mitsuba as mi

    parameters = mi.traverse(plugin)
    for key, value in zip(_VALUES, (np.full(3, sigma_t), albedo), strict=True):
        kind = type(parameters[key])
        # A grey number of Mitsuba is one value, a colour three.
        parameters[key] = kind(*(float(v) for v in value)) if "Color" in kind.__name__ else kind(float(value[0]))
    parameters.update()


def _grey_medium(medium: TruthMedium, sigma_t: float, scattering: bool):
    import mitsuba as mi

    return mi.load_dict(
        {
            "type": "homogeneous",
            "sigma_t": sigma_t,
            "albedo": {"type": "rgb", "value": [float(a) if scattering else 0.0 for a in medium.albedo]},
            "has_spectral_extinction": False,
            "phase": medium.plugin.phase_function(),
        }
    )
