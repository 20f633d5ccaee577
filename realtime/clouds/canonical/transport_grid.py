# SPDX-License-Identifier: BSD-3-Clause
r"""The canonical transport of a medium on a grid of five dimensions: computed once, cached,
and looked up by frames.

The coordinates are thickness, depth, sun and direction (`realtime.clouds.canonical.coordinates`),
and the azimuth as the fifth, with one packet an entry,

    log(Q/Q_0),   c_x/sigma,   c_y/sigma,   log sigma,     Q = T / (P_s (1 - exp(-L))),

where P_s, the phase function scattered n times, holds lobe, glory and fogbow, and 1 - exp(-L), with
L the way from the point back to where the line of sight enters the slab, leaves the mean of the
source along that way, which is finite and smooth at mu = 0 and at both faces. Q_0(t, d, mu_L) is Q
of one level direction: deep in thick slabs it falls by many powers of e, so that it has its own
grid, of three dimensions and finer. Between computed entries it is a spline, of what is left of it
without the steep powers r of thickness and depth that an order has by itself
(`coordinates.steep_powers`).

Between entries a look-up is linear on simplices (`realtime.clouds.canonical.coordinates`): 6
entries, where products of five pairs of weights would read 32. All sets have one code: the number
of the set is an offset.

Outside of the grid:

- a point above the lit face counts as on it, one below the other face as on
  that (Bouthors 2008, 5.1);
- thinner than 0.01 and thicker than 200: c, sigma and the source are those of that thickness at the
  same fraction of the depth; of thinner slabs T falls with the thickness;
- a sun lower than mu_L = 0.02: c and sigma are those of 0.02, and T falls with
  mu_L, to 0 at 0 and below.
"""

import hashlib
import logging
import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.realtime.clouds.canonical import coordinates
from airlight.realtime.clouds.canonical.coordinates import (
    ENTRIES,
    SETS,
    around,
    at_angle,
    place_fractions,
    repeated_scattering,
)
from airlight.realtime.clouds.canonical.directional_moments import DirectionalMoments
from airlight.realtime.clouds.canonical.kept import keep, load_kept, medium_numbers
from airlight.realtime.clouds.slab_orders.phases import SlabPhase
from airlight.realtime.numerics.array_types import ArrayTypes, four_numbers
from airlight.realtime.numerics.functions import between_entries

Array = NDArray[Any]
Progress = Callable[[float, str], None]
#: (set_number, t, d, mu, cos_phi, sin_phi, mu_l) -> T [1/sr], c_x, c_y, sigma [mean free paths]
Transport = Callable[..., tuple[Any, Any, Any, Any]]

_LOG = logging.getLogger(__name__)
_PATIENCE = 5.0  #: seconds between lines of the log

#: Raise this when the meaning or the accuracy of a number changes.
VERSION = 3
#: Entries along thickness, depth, sun, direction and azimuth.
SIDES = (20, 14, 10, 25, 9)
#: Times as many steps of Q_0 along thickness, depth and sun: by computation, and by
#: splines between computed ones.
COMPUTED, FINER = (1, 2, 1), (4, 4, 3)
#: Streams of slabs thinner than so much: in thin ones most light goes within their
#: thickness of the horizon.
_STREAMS = (0.3, 48), (10.0, 32), (np.inf, 24)
_MODES, _NODES, _NEGLIGIBLE = 31, 4, 1e-4
_WORKERS = 2  #: threads
_DIMMEST = 1e-30  #: radiance [1/sr] below which there is no light
_DARK = -60.0  #: logarithm of what is left where there is no light
_LARGEST_SHIFT = 8.0  #: of c over sigma, where there is hardly any light


@dataclass(frozen=True)
class CanonicalTransport:
    """The canonical transport of a medium, as it is cached."""

    entries: Array  #: (sets, thicknesses, depths, suns, directions, azimuths, 4), float16
    sources: Array  #: log Q_0 (sets, thicknesses, depths, suns), float32
    angular: Array  #: P_s at even angles (sets, ENTRIES), float32

    @property
    def size(self) -> int:
        """Bytes of all numbers."""
        return self.entries.nbytes + self.sources.nbytes + self.angular.nbytes


def canonical_transport(
    phase: SlabPhase, albedo: float, *, progress: Progress | None = None
) -> CanonicalTransport:
    """Return the transport of a medium, from the disk where it is cached there.

    `phase`: phase function of the medium; `albedo`: in (0, 1]; `progress`: called with (share done,
    what) while it is computed; without it the log says how far that is. Raises InputError for an
    albedo out of range.
    """
    if not 0 < albedo <= 1:
        raise InputError(
            f"albedo: got {albedo:g}, expected more than 0, at most 1: without scattering there is "
            "no transport"
        )
    digest, medium = transport_digest(), medium_numbers(phase, albedo)
    arrays = load_kept(digest, medium)
    if arrays is None:
        made = computed_transport(phase, albedo, progress or logged("grid of clouds"))
        keep(digest, medium, vars(made))
        return made
    return CanonicalTransport(arrays["entries"], arrays["sources"], arrays["angular"])


def logged(made: str) -> Progress:
    """Return a function that logs progress now and then: a frame that waits for minutes
    looks like a hanging one.

    It is a warning, so that it reaches the error stream where nobody has set up a log.
    """
    began = last = time.monotonic()

    def tell(fraction: float, what: str) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last > _PATIENCE and 0 < fraction < 1:
            last = now
            left = (now - began) * (1 - fraction) / fraction
            _LOG.warning(
                "%s, made once: %.0f %%, about %.0f s left, %s", made, 100 * fraction, left, what
            )

    return tell


def transport_digest() -> str:
    """Return the key of the transport of any medium: how its numbers are made."""
    made = (
        VERSION,
        SIDES,
        COMPUTED,
        FINER,
        coordinates.THINNEST,
        coordinates.THICKEST,
        coordinates.LOWEST_SUN,
    )
    return hashlib.blake2b(repr(made).encode(), digest_size=8).hexdigest()


def computed_transport(phase: SlabPhase, albedo: float, progress: Progress) -> CanonicalTransport:
    """Compute the transport; parameters as above."""
    angular = repeated_scattering(phase)
    thicknesses = coordinates.thicknesses(SIDES[0])
    mu = np.sin(np.pi * (np.linspace(0, 1, SIDES[3]) - 0.5))
    mu = np.where(np.abs(mu) < coordinates.HORIZON, coordinates.HORIZON, mu)
    slabs = [
        DirectionalMoments(
            phase, albedo, mu, streams=streams, modes=_MODES, nodes=_NODES, negligible=_NEGLIGIBLE
        )
        for _, streams in _STREAMS
    ]

    def of_slab(t: float) -> tuple[Array, Array]:
        fitting = next(each for each, (below, _) in zip(slabs, _STREAMS, strict=True) if t < below)
        return _entries(fitting, angular, t)

    entries, levels = [], []
    with ThreadPoolExecutor(_WORKERS) as pool:
        for t, (packets, level) in zip(
            thicknesses, pool.map(of_slab, map(float, thicknesses)), strict=True
        ):
            entries.append(packets)
            levels.append(level)
            progress(len(entries) / len(thicknesses), f"thickness {t:.3g}")
    sources = np.stack(
        [_finer_sources(number, np.stack(level)) for number, level in enumerate(zip(*levels))]
    )
    packets = np.stack([_filled(np.stack(of_set)) for of_set in zip(*entries)])
    return CanonicalTransport(
        packets.astype(np.float16), sources.astype(np.float32), angular.astype(np.float32)
    )


def _entries(slabs: DirectionalMoments, angular: Array, t: float) -> tuple[Array, Array]:
    """Return the packets of a slab (sets, depths, suns, directions, azimuths, 4), NaN
    where there is no light.

    The second is log Q_0 less r, (sets, depths, suns), at the depths and suns that are computed.
    """
    counts = [times * (side - 1) + 1 for times, side in zip(COMPUTED, SIDES)]
    depths, suns, mu = coordinates.depths(counts[1], t), coordinates.suns(counts[2]), slabs.wanted
    azimuths = np.linspace(0, np.pi, SIDES[4])
    light = slabs(t, suns, list(depths))
    cosines = -mu[:, None] * suns[:, None, None]
    cosines = cosines + np.sqrt((1 - mu[:, None] ** 2) * (1 - suns[:, None, None] ** 2)) * np.cos(
        azimuths
    )
    passed = np.log(-np.expm1(-coordinates.way_behind(depths[:, None], t, mu)))[:, None, :, None]
    packets, levels = [], []
    for number in range(len(SETS)):
        T, x, y, square = (
            field.transpose(1, 0, 2, 3) for field in at_azimuths(light[number], azimuths)
        )
        lit = T > _DIMMEST
        safe = np.where(lit, T, 1.0)
        x, y, square = x / safe, y / safe, square / safe
        sigma = np.sqrt(np.maximum(square - x**2 - y**2, 1e-3 * square + 1e-12) / 2)
        c_x, c_y = (np.clip(-each / sigma, -_LARGEST_SHIFT, _LARGEST_SHIFT) for each in (x, y))
        source = np.log(safe) - passed - np.log(at_angle(angular[number], cosines))
        values = np.where(
            lit[..., None], np.stack([source, c_x, c_y, np.log(sigma)], axis=-1), np.nan
        )
        level = values[:, :, SIDES[3] // 2, SIDES[4] // 2, 0].copy()
        values = values[:: COMPUTED[1], :: COMPUTED[2]]
        values[..., 0] -= level[:: COMPUTED[1], :: COMPUTED[2], None, None]
        packets.append(values.astype(np.float32))
        levels.append(level - coordinates.steep_powers(number, t, depths)[:, None])
    return np.stack(packets), np.stack(levels)


def _finer_sources(number: int, level: Array) -> Array:
    """Return log Q_0 of a set at the entries of frames, of what is left of it
    without r where it is computed.
    """
    from scipy.interpolate import make_interp_spline

    finer = _filled(level[..., None])[..., 0]
    for axis, times in enumerate(FINER):
        count = finer.shape[axis]
        spline = make_interp_spline(
            np.linspace(0, 1, count), np.moveaxis(finer, axis, 0), k=min(3, count - 1)
        )
        finer = np.moveaxis(spline(np.linspace(0, 1, (count - 1) * times + 1)), 0, axis)
    for place, t in enumerate(coordinates.thicknesses(finer.shape[0])):
        powers = coordinates.steep_powers(
            number, float(t), coordinates.depths(finer.shape[1], float(t))
        )
        finer[place] += powers[:, None]
    return np.maximum(finer, _DARK)


def _filled(values: Array) -> Array:
    """Return values (thicknesses, depths, suns, ..) that go on where there is no light."""
    for axis, order in ((1, 1), (0, -1), (2, -1), (1, -1), (0, 1)):
        along = np.moveaxis(values, axis, 0)[::order]
        for step in range(1, len(along)):
            along[step] = np.where(np.isnan(along[step]), along[step - 1], along[step])
    return np.nan_to_num(values)


def at_azimuths(light: Array, azimuths: Array) -> tuple[Array, Array, Array, Array]:
    """Return M0, M1 in x and in y and M2, (suns, depths, directions, azimuths) each,
    of modes (modes, 4, ..).
    """
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


def on_device(transport: CanonicalTransport, types: ArrayTypes) -> "TransportGrid":
    """Return the look-up of a transport, whose arrays are made here."""
    entries, sources, angular = (
        types.scalar(each.astype(np.float32).ravel())
        for each in (transport.entries, transport.sources, transport.angular)
    )
    grid = TransportGrid(entries, sources, angular, transport.sources.shape[1:])
    dr.make_opaque(grid)
    return grid


@dataclass(frozen=True)
class TransportGrid:
    """The grid of all sets as a `Transport`; its arrays are fields, so that recorded
    functions take them as inputs.

    A call takes `set_number`, 0 for order 2 to 7 for 31-inf; the thickness `t` and the depth `d` of
    the point below the lit face along the normal [mean free paths]; `mu`, the cosine of the angle
    between the outward normal of the lit face and the direction in which the light leaves the
    point; `cos_phi` and `sin_phi` of that direction's azimuth from the horizontal direction in
    which the sun's light travels, and `mu_l`, the cosine of the sun's zenith angle. It returns the
    radiance for unit irradiance across the beam [1/sr], and the centre of the collector from the
    foot of the point on the lit face, c_x along the sun's horizontal direction, c_y along the
    normal times that, and its standard deviation of one axis [mean free paths].
    """

    entries: Any  #: four numbers each, set after set
    sources: Any  #: log Q_0, set after set
    angular: Any  #: P_s at even angles, set after set
    fine: tuple[int, ...]  #: entries of Q_0 along thickness, depth and sun

    def __call__(self, set_number, t, d, mu, cos_phi, sin_phi, mu_l):
        """Return T [1/sr], c_x, c_y, sigma [mean free paths]; see above."""
        Float = type(t)
        number = mi.UInt32(set_number)
        t = dr.maximum(t, 1e-6)
        d = dr.clip(d, 0, t)
        sun = dr.clip(mu_l, coordinates.LOWEST_SUN, 1)
        inside = dr.clip(t, coordinates.THINNEST, coordinates.THICKEST)
        place = place_fractions(inside, d * (inside / t), sun)
        direction = dr.fma(dr.asin(dr.clip(mu, -1, 1)), dr.inv_pi, 0.5)
        azimuth = dr.safe_acos(cos_phi) * dr.inv_pi
        source, x, y, log_sigma = _between(
            four_numbers(Float), self.entries, number, (*place, direction, azimuth), SIDES
        )
        source += _between(Float, self.sources, number, place, self.fine)
        sigma = dr.exp(log_sigma)
        cosine = dr.fma(dr.safe_sqrt((1 - mu * mu) * (1 - sun * sun)), cos_phi, -mu * sun)
        attenuated = dr.clip(mu_l / coordinates.LOWEST_SUN, 0, 1) * dr.minimum(
            t / coordinates.THINNEST, 1
        )
        angle = dr.safe_acos(cosine) * dr.inv_pi
        (scattered,) = between_entries(self.angular, [(angle, ENTRIES)], first=number)
        T = scattered * _passed(t, d, mu) * dr.exp(source) * attenuated
        return T, x * sigma, dr.mulsign(y, sin_phi) * sigma, sigma


def _between(
    kind: Any, table: Any, number: Any, places: Sequence[Any], sides: tuple[int, ...]
) -> Any:
    """Return the value of a set's table at a place, linear on the simplex
    of entries that holds it.
    """
    total = kind(0)
    for index, weight in around(tuple(places), sides, number * math.prod(sides)):
        total = dr.fma(dr.gather(kind, table, index), weight, total)
    return total


def _passed(t: Any, d: Any, mu: Any) -> Any:
    """Return 1 - exp(-L), without cancellation where the way L behind the point is short."""
    behind = dr.select(mu < 0, d, t - d) / dr.maximum(dr.abs(mu), 1e-6)
    return dr.select(
        behind < 0.02, behind * (1 - behind * (0.5 - behind * (1 / 6))), 1 - dr.exp(-behind)
    )
