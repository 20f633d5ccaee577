# SPDX-License-Identifier: BSD-3-Clause
"""Photons through a slab, one flight after the other, counted by order of scattering with their
distances from the point of entry.

A photon enters a slab of thickness tau at the origin, flies an exponentially distributed optical
length, is scattered by the phase function, and so on until it leaves. All photons of a batch are
scattered together, so that the number of the flight is the order. Absorption is a weight, albedo^n
at order n, which loses no photon.

Counted for each order: what leaves above and below, with the moments 1, x and x^2 + y^2 of the
place of exit; and at each depth the passages upwards and downwards, and the fluence, which is the
sum of 1/|mu| over passages. Every flight counts at every plane before it with the probability to
reach the plane, exp(-distance), whether it does or not. The mean is the same as if only flights
counted that reach the plane, and the noise is smaller. The fluence's variance diverges with the
logarithm of the smallest |mu|, hence slowly: its standard error can be a little small.

The walk shares nothing with the deterministic computation that it checks
(`realtime/clouds/slab_orders/`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from airlight.reference.monte_carlo.slab_walk.scattering import turned

Array = NDArray[np.float64]
Vectors = tuple[Array, Array, Array]


class Scattering(Protocol):
    """A phase function that gives random scattering angles."""

    def cosines(self, uniform: Array) -> Array:
        """Return cosines of the scattering angle from numbers in [0, 1)."""


@dataclass(frozen=True)
class Slab:
    """A homogeneous slab in the light of the sun.

    `tau`: thickness [mean free paths]; `mu0`: cosine of the zenith angle of the sun; its light
    travels downwards and along +x; `albedo`: in [0, 1]; `scattering`: the phase function; `depths`:
    in [0, tau], where passages are counted.
    """

    tau: float
    mu0: float
    albedo: float
    scattering: Scattering
    depths: Sequence[float] = ()


@dataclass(frozen=True)
class Counts:
    """Sums over the photons of a batch, by order: moments 1, x, x^2 + y^2, each weighted,
    over the number of photons.

    `reflected`, `transmitted`: (3, orders), from order 0 on; `up`, `down`, `fluence`: (depths, 3,
    orders): passages through each depth, and passages over |mu|.
    """

    reflected: Array
    transmitted: Array
    up: Array
    down: Array
    fluence: Array


def walk(slab: Slab, photons: int, random: np.random.Generator) -> Counts:
    """Follow a batch of photons until all have left.

    `slab`: the slab; `photons`: number of photons; `random`: the source of random numbers.
    """
    rows: list[Array] = []
    for weight, (x, y, z), direction in flights(slab, photons, random):
        rising = direction[2] < 0
        row = np.zeros((2 + 3 * len(slab.depths), 3))
        # Light leaves above and below: passages through the faces of the slab.
        row[0], _ = _passages(x, y, z, direction, rising, 0.0)
        row[1], _ = _passages(x, y, z, direction, ~rising, slab.tau)
        for place, depth in enumerate(slab.depths):
            first = 2 + 3 * place
            up, up_fluence = _passages(x, y, z, direction, rising & (z > depth), depth)
            down, down_fluence = _passages(x, y, z, direction, ~rising & (z < depth), depth)
            row[first : first + 3] = up, down, up_fluence + down_fluence
        rows.append(row * weight)
    counts = np.moveaxis(np.array(rows), 0, -1) / photons
    depths = counts[2:].reshape(len(slab.depths), 3, 3, counts.shape[-1])
    return Counts(counts[0], counts[1], depths[:, 0], depths[:, 1], depths[:, 2])


def flights(
    slab: Slab, photons: int, random: np.random.Generator
) -> Iterator[tuple[float, Vectors, Vectors]]:
    """Yield the flights of a batch of photons, order by order, until all have left.

    Yields the weight, the fraction that absorption lets through; x, y and the depth z of the
    photons; and the components of their directions, the third downwards, (photons,) each.
    """
    place = np.zeros(photons), np.zeros(photons), np.zeros(photons)
    sine = np.sqrt((1 - slab.mu0) * (1 + slab.mu0))
    direction = np.full(photons, sine), np.zeros(photons), np.full(photons, slab.mu0)
    weight = 1.0
    # Below a weight of 1e-14 what absorption loses is below rounding.
    while place[0].size and weight > 1e-14:
        yield weight, place, direction
        place, direction = _next_scattering(slab, place, direction, random)
        weight *= slab.albedo


def _next_scattering(
    slab: Slab, place: Vectors, direction: Vectors, random: np.random.Generator
) -> tuple[Vectors, Vectors]:
    """Return the places where photons scatter in the slab once more, and their directions from
    there.
    """
    (x, y, z), (u, v, w) = place, direction
    flight = random.standard_exponential(x.size)
    end = z + w * flight
    stays = (end >= 0) & (end <= slab.tau)
    flight, u, v, w = flight[stays], u[stays], v[stays], w[stays]
    reached = x[stays] + u * flight, y[stays] + v * flight, end[stays]
    cosines = slab.scattering.cosines(random.random(len(flight)))
    return reached, turned((u, v, w), cosines, 2 * np.pi * random.random(len(flight)))


def _passages(
    x: Array,
    y: Array,
    z: Array,
    direction: tuple[Array, Array, Array],
    which: NDArray[np.bool_],
    depth: float,
) -> tuple[Array, Array]:
    """Return the expected moments of the passages of some photons through a depth that lies before
    them, and the same over |mu|.
    """
    u, v, w = (part[which] for part in direction)
    # A photon reaches the plane with the probability exp(-distance), and counts with it, whether it
    # gets there or not.
    length = (depth - z[which]) / w
    at_x, at_y = x[which] + u * length, y[which] + v * length
    reaching = np.exp(-length)
    moments = np.stack([reaching, at_x * reaching, (at_x * at_x + at_y * at_y) * reaching])
    return moments.sum(-1), (moments / np.abs(w)).sum(-1)
