# SPDX-License-Identifier: BSD-3-Clause
"""The tables of one phase function and albedo, made once and kept on disk."""

import hashlib
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from realtime.clouds.canonical import coordinates
from realtime.clouds.canonical.angular import at_angle, repeated_scattering
from realtime.clouds.canonical.directional_moments import DirectionalMoments
from realtime.clouds.canonical.kept import keep, load_kept
from realtime.clouds.canonical.sets import SETS
from realtime.clouds.slab_orders.phases import SlabPhase
from realtime.errors import InputError

Array = NDArray[Any]
Progress = Callable[[float, str], None]

#: Raise this when the meaning or the accuracy of a table changes.
VERSION = 1

#: Coefficients of F by set: their error is below that of the grid. They are read in packets of four.
WAVES: tuple[int, ...] = (8, 8, 4, 4, 4, 4, 4, 4)
#: Coefficients of X, Y and Z by set; their sums are multiples of four.
LENGTHS: tuple[tuple[int, int, int], ...] = (
    (6, 5, 5),
    (6, 5, 5),
    (4, 4, 4),
    (4, 4, 4),
    (3, 3, 2),
    (3, 3, 2),
    (3, 2, 3),
    (2, 1, 1),
)
_AZIMUTHS = 16  #: where series are fitted
_AVERAGED = 12  #: directions of the mean over directions
_STREAMS = 12  #: of means, which divide and multiply again, so that they need be smooth, not exact
_DIMMEST = 1e-30  #: source [1/sr] below which there is no light: F, X, Y and Z are 0
_LARGEST = 20.0  #: of |F|


@dataclass(frozen=True)
class Grid:
    """Entries of the tables along each coordinate; X, Y and Z have every other direction."""

    thicknesses: int = 15
    depths: int = 15
    suns: int = 17
    directions: int = 45
    fine_thicknesses: int = 32
    fine_depths: int = 32
    fine_suns: int = 20

    @property
    def other_directions(self) -> int:
        """Every other direction, the first and the last among them."""
        return (self.directions + 1) // 2


@dataclass(frozen=True)
class CanonicalTables:
    """The canonical transport of a medium.

    Parameters
    ----------
    grid
        Numbers of entries.
    means
        (sets, thicknesses, depths, suns, 4) of the fine grid, float32: b, D_b [mean free paths], log s_b, and 0.
    waves
        By set (thicknesses, depths, suns, directions, coefficients), float16: of F.
    lengths
        By set (thicknesses, depths, suns, other directions, coefficients), float16: of X, Y and Z in turn.
    angular
        (sets, entries), float32: P_s at even angles.
    seconds
        That it took to make them [s].
    """

    grid: Grid
    means: Array
    waves: tuple[Array, ...]
    lengths: tuple[Array, ...]
    angular: Array
    seconds: float

    @property
    def size(self) -> int:
        """Bytes of all tables."""
        return self.means.nbytes + self.angular.nbytes + sum(each.nbytes for each in (*self.waves, *self.lengths))


def canonical_tables(
    phase: SlabPhase, albedo: float, *, grid: Grid | None = None, progress: Progress | None = None
) -> CanonicalTables:
    """Return the tables of a medium, from the disk where they are kept there.

    Parameters
    ----------
    phase
        Phase function of the medium.
    albedo
        In (0, 1].
    grid
        Numbers of entries.
    progress
        Called with (share done, what) while tables are made.

    Raises
    ------
    InputError
        For an albedo out of range.
    """
    if not 0 < albedo <= 1:
        raise InputError(
            f"albedo: got {albedo:g}, wanted more than 0, at most 1: without scattering there are no tables"
        )
    grid = grid or Grid()
    digest = tables_digest(phase, albedo, grid)
    arrays = load_kept(digest)
    if arrays is None:
        tables = make_tables(phase, albedo, grid, progress=progress)
        named = {f"waves_{number}": each for number, each in enumerate(tables.waves)}
        named |= {f"lengths_{number}": each for number, each in enumerate(tables.lengths)}
        fixed = {"means": tables.means, "angular": tables.angular, "seconds": np.float64(tables.seconds)}
        keep(digest, fixed | named)
        return tables
    waves, lengths = (tuple(arrays[f"{name}_{number}"] for number in range(len(SETS))) for name in ("waves", "lengths"))
    return CanonicalTables(grid, arrays["means"], waves, lengths, arrays["angular"], float(arrays["seconds"]))


def tables_digest(phase: SlabPhase, albedo: float, grid: Grid) -> str:
    """Return the name of tables: what decides their numbers, the phase function by its moments."""
    digest = hashlib.blake2b(digest_size=16)
    digest.update(repr((VERSION, round(albedo, 9), sorted(asdict(grid).items()), WAVES, LENGTHS)).encode())
    digest.update(np.round(phase.moments(300), 6).astype(np.float32).tobytes())
    return digest.hexdigest()


def make_tables(
    phase: SlabPhase, albedo: float, grid: Grid, *, progress: Progress | None = None, workers: int = 2
) -> CanonicalTables:
    """Make tables; parameters as above, with the number of threads."""
    tell, began = progress or (lambda share, what: None), time.perf_counter()
    angular = repeated_scattering(phase)
    fine = coordinates.thicknesses(grid.fine_thicknesses)
    coarse = coordinates.thicknesses(grid.thicknesses)
    fine_suns, suns, mu = (
        coordinates.suns(grid.fine_suns),
        coordinates.suns(grid.suns),
        coordinates.directions(grid.directions),
    )
    averaged = np.sin(((np.arange(_AVERAGED) + 0.5) / _AVERAGED * 2 - 1) * (np.pi / 2))
    means = DirectionalMoments(phase, albedo, averaged, streams=_STREAMS, nodes=4, modes=1, single=False)
    detailed = DirectionalMoments(phase, albedo, mu)

    def fine_part(t: float) -> Array:
        return _means(means, t, fine_suns, coordinates.depths(grid.fine_depths, t))

    def coarse_part(t: float) -> list[tuple[Array, Array]]:
        depths = coordinates.depths(grid.depths, t)
        mean = _means(means, t, suns, depths)
        light = detailed(t, suns, list(depths))
        return [_coefficients(light[s], mean[s], angular[s], s, t, suns, depths, mu) for s in range(len(SETS))]

    with ThreadPoolExecutor(workers) as pool:
        # The thickest take longest and come first.
        done = []
        for number, part in enumerate(pool.map(coarse_part, coarse[::-1])):
            done.append(part)
            tell(0.8 * (number + 1) / coarse.size, f"thickness {coarse[::-1][number]:.3g}")
        fine_done = []
        for number, mean in enumerate(pool.map(fine_part, fine[::-1])):
            fine_done.append(mean)
            tell(0.8 + 0.2 * (number + 1) / fine.size, "means over directions")
    waves, lengths = (
        tuple(np.stack([part[s][which] for part in done[::-1]]).astype(np.float16) for s in range(len(SETS)))
        for which in (0, 1)
    )
    stacked = np.stack(fine_done[::-1], axis=1)
    packed = np.concatenate([stacked, np.zeros_like(stacked[..., :1])], axis=-1)
    return CanonicalTables(
        grid, packed.astype(np.float32), waves, lengths, angular.astype(np.float32), time.perf_counter() - began
    )


def _means(slabs: DirectionalMoments, t: float, suns: Array, depths: Array) -> Array:
    """Return b, D_b, log s_b of a slab, (sets, depths, suns, 3)."""
    light = slabs(t, suns, list(depths))
    mu = slabs.wanted
    weights = np.sqrt((1 - mu) * (1 + mu))
    source = light[:, 0] / -np.expm1(-coordinates.way_behind(depths[:, None], t, mu))
    b, first, second = (
        ((source[:, field] * weights).sum(-1) / weights.sum()).transpose(0, 2, 1) for field in (0, 1, 3)
    )
    b = np.maximum(b, 1e-300)
    mean = first / b
    spread = np.maximum(second / b - mean**2, 1e-12) / 2
    return np.stack([np.log(b), mean, np.log(spread) / 2], axis=-1)


def _coefficients(
    light: Array, means: Array, angular: Array, number: int, t: float, suns: Array, depths: Array, mu: Array
) -> tuple[Array, Array]:
    """Return the coefficients of one set, of F and of the lengths, (depths, suns, directions, coefficients) each.

    `light` is (modes, 4, suns, depths, directions), `means` (depths, suns, 3).
    """
    azimuths = (np.arange(_AZIMUTHS) + 0.5) * np.pi / _AZIMUTHS
    m0, x, y, square = (field.transpose(1, 0, 2, 3) for field in at_azimuths(light, azimuths))
    cosines = -mu[:, None] * suns[:, None, None] + np.sqrt(
        (1 - mu[:, None] ** 2) * (1 - suns[:, None, None] ** 2)
    ) * np.cos(azimuths)
    source = m0 / -np.expm1(-coordinates.way_behind(depths[:, None], t, mu))[:, None, :, None]
    source = source / at_angle(angular, cosines)
    dark = source < _DIMMEST
    safe = np.where(dark, 1.0, m0)
    b, mean, log_spread = (means[..., field, None, None] for field in range(3))
    spread = np.exp(log_spread)
    way, variance = (
        each[:, None, :, None] for each in coordinates.last_way(coordinates.way_behind(depths[:, None], t, mu))
    )
    sines = np.sqrt(1 - mu[:, None] ** 2)
    d_x, d_y = x / safe, y / safe
    square = square / safe - d_x**2 - d_y**2
    square = np.maximum(square - sines**2 * variance, 1e-3 * np.maximum(square, 1e-12))
    f = np.clip(np.log(np.where(dark, 1.0, source)) - b, -_LARGEST, _LARGEST)
    x, y = (
        (each - mean_part - sines * wave * way) / spread
        for each, mean_part, wave in ((d_x, mean, np.cos(azimuths)), (d_y, 0.0, np.sin(azimuths)))
    )
    f, x, y, z = (np.where(dark, 0.0, each) for each in (f, x, y, np.log(square / 2) / 2 - log_spread))
    of_x, of_y, of_z = LENGTHS[number]
    waves = _cosines(f, WAVES[number], azimuths)
    lengths = [_cosines(x, of_x, azimuths), _sines(y, of_y, azimuths), _cosines(z, of_z, azimuths)]
    return waves, np.concatenate(lengths, axis=-1)[:, :, ::2]


def _cosines(values: Array, count: int, azimuths: Array) -> Array:
    """Return coefficients of cos(m phi), m from 0 on, of values at even azimuths."""
    orders = np.arange(count)[:, None]
    return values @ (np.cos(orders * azimuths) * np.where(orders > 0, 2, 1) / _AZIMUTHS).T


def _sines(values: Array, count: int, azimuths: Array) -> Array:
    """Return coefficients of sin(m phi), m from 1 on."""
    return values @ (np.sin(np.arange(1, count + 1)[:, None] * azimuths) * 2 / _AZIMUTHS).T


def at_azimuths(light: Array, azimuths: Array) -> tuple[Array, Array, Array, Array]:
    """Return M0, M1 in x and in y and M2, (suns, depths, directions, azimuths) each, of modes (modes, 4, ..)."""
    m = np.arange(light.shape[0])
    cosines, sines = np.cos(m[:, None] * azimuths), np.sin(m[:, None] * azimuths)
    twice, once = np.where(m > 0, 2.0, 1.0)[:, None], np.where(m > 0, 1.0, 0.5)[:, None]

    def summed(modes: Array, waves: Array) -> Array:
        return np.tensordot(modes, waves, axes=(0, 0))

    return (
        summed(light[:, 0], cosines * twice),
        summed(light[:, 1] + light[:, 2], cosines * once),
        summed(light[:, 1] - light[:, 2], sines),
        summed(light[:, 3], cosines * twice),
    )
