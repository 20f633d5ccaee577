# SPDX-License-Identifier: BSD-3-Clause
"""A batch of paths through clouds as the layers of an image, by sets of orders of scattering.

Paths go through the pixel centres. Where the extinction of clouds depends on the channel, each
channel has paths of its own. Pixels that see nothing but the sky get none: they hold no scattered
light.
"""

import math
from collections.abc import Sequence

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.reference.monte_carlo.batches import Batches, check_samples, single_batch
from airlight.reference.monte_carlo.cloud_paths.tables import walk_scene
from airlight.reference.monte_carlo.cloud_paths.walk import Targets, walk
from airlight.reference.scene.clouds import CloudScene

Array = NDArray[np.float64]
Sets = Sequence[tuple[int, float]]

SIDE = 0.5  #: probability of a side flight


def set_layers(sets: Sequence[str]) -> tuple[str, ...]:
    """Return the layers of a batch: all orders, light that met a surface, sets of orders such
    as '3-4', and `straight`.

    `surface_straight` is the part of `surface` that went from the lights to the visible surface and
    from there to the eye, attenuated by clouds but not scattered.
    """
    return ("airlight", "surface", *(set_layer(name) for name in sets), "surface_straight")


def set_layer(name: str) -> str:
    """Return the layer of a set of orders, `airlight_3_4` for '3-4'."""
    return "airlight_" + name.replace("-", "_")


def cloud_paths_batch(
    clouds: CloudScene,
    seed: int,
    samples: int,
    *,
    sets: Sequence[tuple[str, tuple[int, float]]],
    mask: NDArray[np.bool_],
) -> Batches:
    """Trace one batch.

    `clouds`: the scene; `seed`: seed of the batch; different seeds are independent; `samples`:
    samples a pixel, at most 256; `sets`: names of disjoint sets of orders with their first and last
    order, the last `math.inf` for an unbounded set; `mask`: pixels whose rays meet a cloud or a
    surface, (pixels,): the others get no samples.
    """
    check_samples(samples)
    targets = _targets([orders for _, orders in sets])
    pixels = np.flatnonzero(mask)
    most = 1 << 18  # lanes followed at once: their sums take 16 MB a layer
    streams = _streams(len(pixels), samples)
    sums = np.zeros((targets.count, len(mask), 3))
    # Flights depend on the extinction: channels with the same extinction in all clouds share a
    # walk, each other channel has its own.
    extinctions = np.stack([cloud.sigma_t for cloud in clouds.clouds], axis=1)
    for number, sigma_t in enumerate(dict.fromkeys(map(tuple, extinctions))):
        channels = np.flatnonzero(np.all(extinctions == sigma_t, axis=1))
        scene = walk_scene(clouds, int(channels[0]))
        for place, first in enumerate(range(0, len(pixels), most // streams)):
            part = pixels[first : first + most // streams]
            sampler = mi.load_dict({"type": "independent"})
            # Streams differ by seed: each part of the pixels and each channel has its own seeds.
            sampler.seed(
                (seed * 3 + number) * (1 + len(pixels) * streams // most) + place,
                len(part) * streams,
            )
            directions = dr.normalize(
                mi.Vector3f(np.repeat(clouds.direction[part], streams, axis=0).T)
            )
            rays = mi.Ray3f(mi.Point3f(*clouds.origin.tolist()), directions)
            dr.make_opaque(rays)  # one kernel for all cameras
            side = SIDE if scene.has_suns else 0.0  # flights are drawn about suns
            walked = walk(scene, targets, sampler, rays, samples=samples // streams, side=side)
            for channel in channels:
                lanes = np.array(walked[channel], dtype=np.float64).reshape(
                    targets.count, len(part), streams
                )
                sums[:, part, channel] = lanes.sum(axis=2)
    # The layer `rest` has the orders of no set. Light that came straight from the surface is part
    # of `surface`, too.
    orders, rest, surface, straight = sums[:-3], sums[-3], sums[-2], sums[-1]
    layers = [orders.sum(axis=0) + rest, surface + straight, *orders, straight]
    return single_batch(
        seed, samples, np.stack(layers) / samples, layers=set_layers([name for name, _ in sets])
    )


def _targets(sets: Sequence[tuple[int, float]]) -> Targets:
    """Return the layer of each order; orders of no set share one."""
    # Orders above the last one of all sets share the last entry.
    last = max((int(first if math.isinf(end) else end) for first, end in sets), default=0) + 1
    by_order = np.full(last + 1, len(sets), dtype=np.uint32)
    for number, (first, end) in enumerate(sets):
        by_order[first : None if math.isinf(end) else int(end) + 1] = number
    return Targets(mi.UInt32(by_order), len(sets))


def _streams(pixels: int, samples: int) -> int:
    """Return how many lanes share the samples of a pixel: a divisor of them, so that small
    images fill the machine.
    """
    streams = 1
    # Below 2^14 lanes each pixel gets several of them.
    while pixels * streams < 1 << 14 and samples % (2 * streams) == 0:
        streams *= 2
    return streams
