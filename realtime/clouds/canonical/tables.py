# SPDX-License-Identifier: BSD-3-Clause
"""The tables of one phase function and albedo, made once and kept on disk."""

import hashlib
import logging
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from realtime.clouds.canonical import coordinates
from realtime.clouds.canonical.coordinates import SETS, at_angle, coefficients, direction_shapes, repeated_scattering
from realtime.clouds.canonical.directional_moments import DirectionalMoments
from realtime.clouds.canonical.kept import keep, load_kept, medium_numbers
from realtime.clouds.slab_orders.phases import SlabPhase
from realtime.errors import InputError

Array = NDArray[Any]
Progress = Callable[[float, str], None]

_LOG = logging.getLogger(__name__)
_PATIENCE = 5.0  #: seconds between lines of the log

#: Raise this when the meaning or the accuracy of a table changes.
VERSION = 2

#: Products of F, X, Y and Z by set. They are read in packets of four.
RANKS: tuple[tuple[int, int, int, int], ...] = (
    (44, 32, 20, 20),
    (24, 16, 12, 8),
    (16, 12, 8, 8),
    (16, 12, 8, 4),
    (12, 8, 8, 4),
    (12, 8, 4, 4),
    (8, 8, 4, 4),
    (8, 8, 8, 4),
)
_LEARNT = 3  #: shapes are learnt from every third thickness
#: Streams of slabs thinner than so much: in thin ones most light goes within their thickness of the horizon.
_STREAMS = (0.3, 48), (10.0, 32), (np.inf, 24)
_MODES, _NODES, _NEGLIGIBLE = 31, 4, 1e-4
_DIMMEST = 1e-30  #: radiance [1/sr] below which there is no light
_SHARE = 1e-6  #: of the light of all sets, below which a place does not count for shapes
_LEAST_WEIGHT = 0.2  #: of an entry over the mean, so that no place or direction is forgotten
_LARGEST_SHIFT, _LARGEST_SPREAD = 8.0, 3.0  #: of |X|, |Y| and of |Z|, where there is hardly any light


@dataclass(frozen=True)
class Grid:
    """Entries of the tables along each coordinate."""

    thicknesses: int = 36
    depths: int = 33
    suns: int = 14
    directions: int = 33
    azimuths: int = 16


@dataclass(frozen=True)
class CanonicalTables:
    """The canonical transport of a medium.

    Parameters
    ----------
    grid
        Numbers of entries.
    means
        (sets, thicknesses, depths, suns, 2), float32: b and log s_b [mean free paths].
    coefficients
        By set (thicknesses, depths, suns, products), float16: of F, X, Y and Z in turn.
    shapes
        By set (directions, azimuths, products), float32, at the middles of even steps of the azimuth from 0 to pi.
    angular
        (sets, entries), float32: P_s at even angles.
    seconds
        That it took to make them [s].
    """

    grid: Grid
    means: Array
    coefficients: tuple[Array, ...]
    shapes: tuple[Array, ...]
    angular: Array
    seconds: float

    @property
    def size(self) -> int:
        """Bytes of all tables."""
        return self.means.nbytes + self.angular.nbytes + sum(each.nbytes for each in (*self.coefficients, *self.shapes))


def canonical_tables(
    phase: SlabPhase, albedo: float, *, grid: Grid | None = None, progress: Progress | None = None
) -> CanonicalTables:
    """Return the tables of a medium, from the disk where they are kept there.

    `phase`: phase function of the medium; `albedo`: in (0, 1]; `grid`: numbers of entries; `progress`: called with
    (share done, what) while tables are made; without it the log says how far they are. Raises InputError for an albedo
    out of range.
    """
    if not 0 < albedo <= 1:
        raise InputError(
            f"albedo: got {albedo:g}, wanted more than 0, at most 1: without scattering there are no tables"
        )
    grid = grid or Grid()
    digest, medium = tables_digest(grid), medium_numbers(phase, albedo)
    arrays = load_kept(digest, medium)
    if arrays is None:
        tables = make_tables(phase, albedo, grid, progress=progress or logged("tables of clouds"))
        named = {f"coefficients_{number}": each for number, each in enumerate(tables.coefficients)}
        named |= {f"shapes_{number}": each for number, each in enumerate(tables.shapes)}
        fixed = {"means": tables.means, "angular": tables.angular, "seconds": np.float64(tables.seconds)}
        keep(digest, medium, fixed | named)
        return tables
    products, shapes = (
        tuple(arrays[f"{name}_{number}"] for number in range(len(SETS))) for name in ("coefficients", "shapes")
    )
    return CanonicalTables(grid, arrays["means"], products, shapes, arrays["angular"], float(arrays["seconds"]))


def logged(made: str) -> Progress:
    """Return what writes a line into the log now and then: a frame waits for minutes, which looks like a hanging one.

    It is a warning, so that it reaches the error stream where nobody has set up a log.
    """
    began = last = time.monotonic()

    def tell(share: float, what: str) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last > _PATIENCE and 0 < share < 1:
            last = now
            left = (now - began) * (1 - share) / share
            _LOG.warning("%s, made once: %.0f %%, about %.0f s left, %s", made, 100 * share, left, what)

    return tell


def tables_digest(grid: Grid) -> str:
    """Return what names tables of whatever medium: how their numbers are made."""
    made = VERSION, sorted(asdict(grid).items()), RANKS
    return hashlib.blake2b(repr(made).encode(), digest_size=8).hexdigest()


def make_tables(
    phase: SlabPhase, albedo: float, grid: Grid, *, progress: Progress | None = None, workers: int = 2
) -> CanonicalTables:
    """Make tables; parameters as above, with the number of threads."""
    tell, began = progress or (lambda share, what: None), time.perf_counter()
    angular = repeated_scattering(phase)
    t, suns = coordinates.thicknesses(grid.thicknesses), coordinates.suns(grid.suns)
    mu = coordinates.directions(grid.directions)
    azimuths = (np.arange(grid.azimuths) + 0.5) * np.pi / grid.azimuths
    slabs = [
        DirectionalMoments(phase, albedo, mu, streams=streams, modes=_MODES, nodes=_NODES, negligible=_NEGLIGIBLE)
        for _, streams in _STREAMS
    ]
    weights = np.repeat(_widths(mu, -1.0, 1.0), azimuths.size)

    def fields(place: int) -> list[_Fields]:
        fitting = next(each for each, (below, _) in zip(slabs, _STREAMS, strict=True) if t[place] < below)
        return _fields(fitting, angular, float(t[place]), suns, grid.depths, azimuths=azimuths, weights=weights)

    def part(place: int) -> list[_Part]:
        return [_part(each, weights, shapes) for each, shapes in zip(fields(place), learnt, strict=True)]

    # Shapes are learnt from some thicknesses first; those in between need no memory after they are done.
    first = sorted({*range(0, t.size, _LEARNT), t.size - 1}, reverse=True)
    others = [place for place in range(t.size - 1, -1, -1) if place not in first]
    parts: dict[int, list[_Part]] = {}
    with ThreadPoolExecutor(workers) as pool:
        samples = []
        for place, sample in zip(first, pool.map(fields, first), strict=True):
            samples.append(sample)
            tell(len(samples) / (t.size + 1), f"thickness {t[place]:.3g}")
        learnt = [_learnt(of_set, weights, ranks) for of_set, ranks in zip(zip(*samples, strict=True), RANKS)]
        for place, sample in zip(first, samples, strict=True):
            parts[place] = [_part(each, weights, shapes) for each, shapes in zip(sample, learnt, strict=True)]
        samples.clear()
        for place, done in zip(others, pool.map(part, others), strict=True):
            parts[place] = done
            tell(len(parts) / (t.size + 1), f"thickness {t[place]:.3g}")
    by_set = [[parts[place][number] for place in range(t.size)] for number in range(len(SETS))]
    means = np.stack([_filled(np.stack([each.means for each in of_set])) for of_set in by_set])
    return CanonicalTables(
        grid,
        means.astype(np.float32),
        tuple(np.stack([each.coefficients for each in of_set]).astype(np.float16) for of_set in by_set),
        tuple(np.concatenate(shapes).T.reshape(mu.size, azimuths.size, -1).astype(np.float32) for shapes in learnt),
        angular.astype(np.float32),
        time.perf_counter() - began,
    )


@dataclass(frozen=True)
class _Fields:
    """A set in one slab. `values` has F, X, Y and Z (4, depths, suns, directions and azimuths); `means` b and log s_b.

    Means are NaN where there is no light; `places` are weights of depths and suns for F and Z, and for X and Y.
    """

    values: Array
    means: Array
    places: tuple[Array, Array]


@dataclass(frozen=True)
class _Part:
    """The means of a set in one slab (depths, suns, 2), and the coefficients (depths, suns, products)."""

    means: Array
    coefficients: Array


def _fields(
    slabs: DirectionalMoments, angular: Array, t: float, suns: Array, count: int, *, azimuths: Array, weights: Array
) -> list[_Fields]:
    """Return all sets in one slab."""
    depths, mu = coordinates.depths(count, t), slabs.wanted
    light = slabs(t, suns, list(depths))
    moments = [
        [field.transpose(1, 0, 2, 3) for field in at_azimuths(light[number], azimuths)] for number in range(len(SETS))
    ]
    total = sum(np.maximum(of_set[0], 0) for of_set in moments)
    sines = np.sqrt(1 - mu**2)[:, None]
    cosines = -mu[:, None] * suns[:, None, None] + sines * np.sqrt(1 - suns[:, None, None] ** 2) * np.cos(azimuths)
    ways = coordinates.way_behind(depths[:, None], t, mu)
    passed = np.log(-np.expm1(-ways))[:, None, :, None]
    way, variance = (each[:, None, :, None] for each in coordinates.last_way(ways))
    measure = np.outer(_widths(depths / t, 0.0, 1.0), _widths(suns, 0.0, 1.0))
    result = []
    for number, (m0, x, y, square) in enumerate(moments):
        lit = m0 > _DIMMEST
        safe = np.where(lit, m0, 1.0)
        d_x, d_y = x / safe, y / safe
        whole = np.maximum(square / safe - d_x**2 - d_y**2, 1e-12) / 2
        own = np.maximum(whole - sines**2 * variance / 2, 1e-3 * whole)
        f = np.log(safe) - passed - np.log(at_angle(angular[number], cosines))
        f, x, y, z = (
            np.where(lit, each, 0.0).reshape(*measure.shape, -1)
            for each in (f, d_x - sines * np.cos(azimuths) * way, d_y - sines * np.sin(azimuths) * way, np.log(own) / 2)
        )
        seen = lit.reshape(f.shape)
        counted = np.maximum((seen * weights).sum(-1, keepdims=True), 1e-300)
        b, log_spread = ((each * weights).sum(-1, keepdims=True) / counted for each in (f, z))
        spread = np.exp(log_spread)
        shift = (np.where(seen, each / spread, 0.0).clip(-_LARGEST_SHIFT, _LARGEST_SHIFT) for each in (x, y))
        z = np.where(seen, z - log_spread, 0.0).clip(-_LARGEST_SPREAD, _LARGEST_SPREAD)
        values = np.stack([np.where(seen, f - b, 0.0), *shift, z])
        b = b - coordinates.reference(number, t, depths)[:, None, None]
        means = np.where(seen.any(-1, keepdims=True), np.concatenate([b, log_spread], axis=-1), np.nan)
        counts = ((m0 > _SHARE * total) & lit).reshape(f.shape) * weights
        bright = measure * np.maximum(counts.sum(-1), _SHARE)
        finer = np.minimum(spread / np.sqrt(np.where(lit, whole, 1.0)).reshape(f.shape), 3.0)
        result.append(_Fields(values.astype(np.float32), means, (bright, bright * (finer**2 * weights).sum(-1))))
    return result


def _learnt(samples: Sequence[_Fields], weights: Array, ranks: tuple[int, ...]) -> list[Array]:
    """Return the shapes of F, X, Y and Z of one set, (products, directions and azimuths) each."""
    shapes = []
    for which, rank in enumerate(ranks):
        values = np.concatenate([sample.values[which].reshape(-1, weights.size) for sample in samples])
        places = np.concatenate([sample.places[which in (1, 2)].ravel() for sample in samples])
        shapes.append(direction_shapes(values.astype(np.float64), places, weights, rank))
    return shapes


def _part(fields: _Fields, weights: Array, shapes: Sequence[Array]) -> _Part:
    """Return what tables keep of the fields of a set in one slab."""
    of_each = [coefficients(values, weights, own) for values, own in zip(fields.values, shapes, strict=True)]
    return _Part(fields.means, np.concatenate(of_each, axis=-1))


def _widths(places: Array, low: float, high: float) -> Array:
    """Return the widths of the cells around places over their mean, small ones raised: weights of entries."""
    edges = np.concatenate([[low], (places[1:] + places[:-1]) / 2, [high]])
    widths = np.diff(edges) / np.diff(edges).mean()
    return np.maximum(widths, _LEAST_WEIGHT) / np.maximum(widths, _LEAST_WEIGHT).sum()


def _filled(means: Array) -> Array:
    """Return means (thicknesses, depths, suns, 2) that go on where there is no light, so that cubics stay calm."""
    for axis, order in ((1, 1), (0, -1), (2, -1), (1, -1), (0, 1)):
        along = np.moveaxis(means, axis, 0)[::order]
        for step in range(1, len(along)):
            along[step] = np.where(np.isnan(along[step]), along[step - 1], along[step])
    return np.nan_to_num(means)


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
