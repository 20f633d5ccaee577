# SPDX-License-Identifier: BSD-3-Clause
"""The step cloud of I3RC: a layer whose extinction jumps, walked by delta tracking.

Case 1 of the Intercomparison of 3D Radiation Codes (Cahalan et al. 2005, "The I3RC: bringing together the most advanced
radiative transfer tools for cloudy atmospheres"): 500 m in x and repeated, without end in y, 250 m thick; optical
thickness 2 in the first half, 18 in the second; Henyey and Greenstein with g = 0.85, nothing absorbed.

Delta tracking (Woodcock et al. 1965) flies through the largest extinction everywhere; at the end of a flight a photon
is scattered with probability extinction/largest, and else goes on.
"""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from reference.monte_carlo.slab_walk.scattering import HenyeyGreenstein, turned

Array = NDArray[np.float64]

WIDTH, THICKNESS = 500.0, 250.0  #: [m]
THIN, THICK = 2.0, 18.0  #: optical thickness of both halves
COLUMNS = 32
_G = 0.85
_BATCH = 25_000


def step_cloud_reflectance(sun: float, *, photons: int, seed: int = 0, workers: int = 2) -> tuple[Array, Array]:
    """Return the reflectance of each column by place of exit, and its standard error, both (32,) [1].

    A photon leaves through a column or not, and photons are independent: the error is sqrt(R' (1 - R')/photons) with R'
    the share of all photons that leave there.

    Parameters
    ----------
    sun
        Zenith angle of the sun [degrees], whose light travels to +x.
    photons
        How many.
    seed
        The same seed gives the same numbers, whatever the number of workers.
    workers
        Threads.
    """
    if photons < 1:
        raise ValueError(f"photons: got {photons}, wanted at least 1")
    sizes = [min(_BATCH, photons - start) for start in range(0, photons, _BATCH)]
    seeds = np.random.SeedSequence(seed).spawn(len(sizes))
    with ThreadPoolExecutor(workers) as pool:
        generators = map(np.random.default_rng, seeds)
        walked = pool.map(lambda size, random: _walk(math.radians(sun), size, random), sizes, generators)
        share = sum(walked) / photons
    return COLUMNS * share, COLUMNS * np.sqrt(share * (1 - share) / photons)


def _walk(sun: float, photons: int, random: np.random.Generator) -> Array:
    """Return how many photons leave above through each column."""
    largest = THICK / THICKNESS
    x, z = WIDTH * random.random(photons), np.zeros(photons)  # z is the depth
    u, v, w = np.full(photons, math.sin(sun)), np.zeros(photons), np.full(photons, math.cos(sun))
    phase = HenyeyGreenstein(_G)
    counts = np.zeros(COLUMNS)
    while x.size:
        flight = random.standard_exponential(x.size) / largest
        end = z + w * flight
        above = end < 0
        if above.any():
            left = x[above] - u[above] * z[above] / w[above]
            column = np.floor(left * (COLUMNS / WIDTH)).astype(np.int64) % COLUMNS
            counts += np.bincount(column, minlength=COLUMNS)
        stays = ~(above | (end > THICKNESS))
        x, z = np.mod(x[stays] + u[stays] * flight[stays], WIDTH), end[stays]
        u, v, w = u[stays], v[stays], w[stays]
        real = (x >= WIDTH / 2) | (random.random(x.size) < THIN / THICK)
        cosines = phase.cosines(random.random(int(real.sum())))
        azimuths = 2 * np.pi * random.random(cosines.size)
        u[real], v[real], w[real] = turned((u[real], v[real], w[real]), cosines, azimuths)
    return counts
