# SPDX-License-Identifier: BSD-3-Clause
"""`single-scatter`: batches of an estimator of exactly one scattering, in
the medium or on a surface.

`reference.monte_carlo.single_scatter.estimator` has the integral along a ray and its estimate. The
integrator checks `reference.quadrature`. The two share facts that `reference.scene` reads (rays
through the pixel centres, shapes and radiance of area lights, numbers of media) and Mitsuba's ray
casting, but no derivation beyond the integral itself.

A scene that was read for the equation of a model is traced by
`reference.monte_carlo.single_scatter.model_rays`.

The n samples of a ray lie in n cells of the unit interval, each at a random place of its cell; the
grid of cells is itself at a random place, a new one for each light and medium. The estimate is
unbiased, its error falls as n^-1.5 where the integrand is smooth and as 1/n at the edge of a
shadow, and batches of different seeds are independent.

Rounding: a ray's foot and height are computed in double precision; everything after that is
relative to the light, in the variant's precision. Sums over at most 256 samples are single, over
batches double.
"""

from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.reference.monte_carlo.batches import Batches, check_samples, single_batch
from airlight.reference.monte_carlo.single_scatter.boundary_walk import Surroundings
from airlight.reference.monte_carlo.single_scatter.estimator import (
    Task,
    ray_light,
    source_light,
)
from airlight.reference.monte_carlo.single_scatter.model_rays import fog_glow, model_light
from airlight.reference.monte_carlo.single_scatter.model_terms import terms_of
from airlight.reference.monte_carlo.single_scatter.sources import sources_of
from airlight.reference.monte_carlo.single_scatter.stretches import double_ray
from airlight.reference.scene.read import ReferenceScene, has_mirrors
from airlight.reference.scene.varying import VaryingMedium


def single_scatter_batch(reference: ReferenceScene, seed: int, samples: int) -> Batches:
    """Trace one batch along the pixel-centre rays, from the pinhole.

    `reference`: the scene; `seed`: seed of the batch; different seeds are independent; `samples`:
    distances sampled for each ray, light and medium, each from a point of its own of an area light,
    at most 256. Returns Batches: airlight and surface of every pixel [W/(m^2 sr)]. The surface is
    sampled under area lights and a sky alone: without these all batches agree on it.
    """
    check_samples(samples)
    task, terms = _task(reference, samples), terms_of(reference)
    trace = ray_light if terms is None else partial(model_light, terms)
    sampler = mi.load_dict({"type": "independent"})
    pixels = reference.width * reference.height
    most = 1 << 20  # camera rays in one kernel
    chunks = -(-pixels // most)
    mean = np.empty((2, pixels, 3))
    for number in range(chunks):
        chunk = slice(number * most, min((number + 1) * most, pixels))
        count = chunk.stop - chunk.start
        # Seeds count up from batch to batch and from chunk to chunk: no two streams share one.
        sampler.seed((seed * chunks + number) % 2**32, count)
        ray = double_ray(
            mi.Point3d(*reference.origin.tolist()),
            mi.Vector3d(reference.direction[chunk].T),
        )
        layers = dr.zeros(mi.Spectrum, count), dr.zeros(mi.Spectrum, count)
        # One source after the other: those of one structure share a compiled kernel, while a kernel
        # of many would hold a loop for each.
        for source in task.sources:
            sent = source_light(trace, task, source, sampler, ray, dr.full(mi.Bool, True, count))
            layers = layers[0] + sent[0], layers[1] + sent[1]
            sampler.schedule_state()
            dr.eval(layers)
        if terms is not None and terms.glows:
            glow = fog_glow(terms, task, sampler, ray, dr.full(mi.Bool, True, count))
            layers = layers[0] + glow, layers[1]
        for layer, radiance in enumerate(layers):
            mean[layer, chunk] = np.stack([np.array(c, dtype=np.float64) for c in radiance], axis=1)
    return single_batch(seed, samples, mean)


def _task(reference: ReferenceScene, samples: int) -> Task:
    """Return the traced form of a scene that was read."""
    bounded, media = bool(reference.media), (reference.medium, *reference.media)
    # Shapes of material `null` that bound no homogeneous medium, lights among them, take no part.
    scene = reference.scene if bounded else reference.occluders
    camera = reference.scene.sensors()[0].get_medium()
    return Task(
        Surroundings.of(scene, bounded),
        sources_of(reference),
        samples,
        mirrors=reference.is_sampled and has_mirrors(reference),
        grey=all(len(set(medium.largest.tolist())) == 1 for medium in media),
        start=dr.zeros(mi.MediumPtr) if camera is None else mi.MediumPtr(camera),
        varying=reference.medium if isinstance(reference.medium, VaryingMedium) else None,
    )
