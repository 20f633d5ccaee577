# SPDX-License-Identifier: BSD-3-Clause
r"""The canonical transport of a medium on a grid of five dimensions: computed once, cached,
and looked up by frames.

The coordinates are thickness, depth, sun and direction (`realtime.clouds.canonical.coordinates`),
and the azimuth as the fifth, with one packet an entry,

    log(Q/Q_0),   c_x/sigma,   c_y/sigma,   log sigma,     Q = T / (P_s (1 - exp(-L))),

where P_s, the phase function of n scatterings, holds lobe, glory and fogbow. L is the way from the
point back to where the line of sight enters the slab: divided by 1 - exp(-L), T is the mean of the
source along that way, which is finite and smooth at mu = 0 and at both faces. Q_0(t, d, mu_L) is Q
in one level direction. Deep in thick slabs Q_0 falls by many powers of e, so that it has its own
grid, of three dimensions and finer. Between computed entries a spline interpolates log Q_0 less the
steep powers r of thickness and depth (`coordinates.steep_powers`).

Between entries a look-up is linear on simplices (`realtime.clouds.canonical.coordinates`): 6
entries, where products of five pairs of weights would read 32. All sets have one code: the number
of the set is an offset.

Outside of the grid:

- a point above the lit face counts as on it, one below the other face as on
  that (Bouthors 2008, 5.1);
- thinner than 0.01 and thicker than 200: a slab of that thickness gives c, sigma and the source, at
  the same fraction of the depth; the T of thinner slabs falls with the thickness;
- a sun lower than mu_L = 0.02: the sun at 0.02 gives c and sigma, and T falls with
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
from airlight.realtime.numerics.functions import between_entries, opacity

Array = NDArray[Any]
Progress = Callable[[float, str], None]
#: (set_number, t, d, mu, cos_phi, sin_phi, mu_l) -> T [1/sr], c_x, c_y, sigma [mean free paths]
Transport = Callable[..., tuple[Any, Any, Any, Any]]

_LOG = logging.getLogger(__name__)

#: Entries along thickness, depth, sun, direction and azimuth.
SIDES = (20, 14, 10, 25, 9)
#: Times as many steps of Q_0 along thickness, depth and sun: by computation, and by
#: splines between computed ones.
COMPUTED, FINER = (1, 2, 1), (4, 4, 3)
#: Streams of slabs thinner than so much: in thin ones most light goes within their
#: thickness of the horizon.
_STREAMS = (0.3, 48), (10.0, 32), (np.inf, 24)
_MODES = 31  #: the largest mode of the azimuth


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

    `phase`: phase function of the medium; `albedo`: in (0, 1]; `progress`: called with the fraction
    that is done and a word on it, while the transport is computed; without it the log reports the
    progress. Raises InputError for an albedo out of range.
    """
    if not 0 < albedo <= 1:
        raise InputError(
            f"albedo: got {albedo:g}, expected more than 0, at most 1: without scattering there is "
            "no transport"
        )
    digest, medium = transport_digest(), medium_numbers(phase, albedo)
    arrays = load_kept(digest, medium)
    if arrays is None:
        transport = computed_transport(phase, albedo, progress or logged("grid of clouds"))
        keep(digest, medium, vars(transport))
        return transport
    return CanonicalTransport(arrays["entries"], arrays["sources"], arrays["angular"])


def logged(name: str) -> Progress:
    """Return a function that logs progress now and then: a frame that waits for minutes
    looks like a hanging one.

    It is a warning, so that it reaches the error stream where nobody has set up a log.
    """
    patience = 5.0  # seconds between lines of the log
    began = logged_at = time.monotonic()

    def tell(fraction: float, what: str) -> None:
        nonlocal logged_at
        now = time.monotonic()
        if now - logged_at > patience and 0 < fraction < 1:
            logged_at = now
            # As if the rest went on at the pace so far.
            rest = (now - began) * (1 - fraction) / fraction
            _LOG.warning(
                "%s, made once: %.0f %%, about %.0f s left, %s", name, 100 * fraction, rest, what
            )

    return tell


def transport_digest() -> str:
    """Return the key of the transport of any medium: how its numbers are made."""
    version = 4  # rises when the meaning or the accuracy of a number changes
    inputs = (
        version,
        SIDES,
        COMPUTED,
        FINER,
        coordinates.THINNEST,
        coordinates.THICKEST,
        coordinates.LOWEST_SUN,
    )
    return hashlib.blake2b(repr(inputs).encode(), digest_size=8).hexdigest()


def computed_transport(phase: SlabPhase, albedo: float, progress: Progress) -> CanonicalTransport:
    """Compute the transport; parameters as above."""
    angular = repeated_scattering(phase)
    thicknesses = coordinates.thicknesses(SIDES[0])
    # The entry at mu = 0 is computed just above the horizon: a level line crosses no panel.
    horizon = 1e-4
    mu = np.sin(np.pi * (np.linspace(0, 1, SIDES[3]) - 0.5))
    mu = np.where(np.abs(mu) < horizon, horizon, mu)
    slabs = [
        DirectionalMoments(
            phase, albedo, mu, streams=streams, modes=_MODES, nodes=4, negligible=1e-4
        )
        for _, streams in _STREAMS
    ]

    def of_slab(t: float) -> tuple[Array, Array]:
        fitting = next(each for each, (below, _) in zip(slabs, _STREAMS, strict=True) if t < below)
        return _entries(fitting, angular, t)

    # Slabs are independent of one another, and their products of matrices release Python's lock.
    entries, levels = [], []
    with ThreadPoolExecutor(max_workers=2) as pool:
        for t, (packets, level) in zip(
            thicknesses, pool.map(of_slab, map(float, thicknesses)), strict=True
        ):
            entries.append(packets)
            levels.append(level)
            progress(len(entries) / len(thicknesses), f"thickness {t:.3g}")
    # From slabs to sets: Q_0 on its finer grid, and the packets without gaps.
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
    # Entries of Q_0 along each coordinate; packets take every second of its depths.
    counts = [times * (side - 1) + 1 for times, side in zip(COMPUTED, SIDES)]
    depths, suns, mu = coordinates.depths(counts[1], t), coordinates.suns(counts[2]), slabs.wanted
    azimuths = np.linspace(0, np.pi, SIDES[4])
    light = slabs(t, suns, list(depths))
    # The cosine of the scattering angle between the sun's light and the direction, (suns,
    # directions, azimuths).
    cosines = -mu[:, None] * suns[:, None, None]
    cosines = cosines + np.sqrt((1 - mu[:, None] ** 2) * (1 - suns[:, None, None] ** 2)) * np.cos(
        azimuths
    )
    # log(1 - exp(-L)), (depths, 1, directions, 1).
    log_opacity = np.log(-np.expm1(-coordinates.way_behind(depths[:, None], t, mu)))[
        :, None, :, None
    ]
    # Below this radiance [1/sr] there is no light, and a set has no value.
    dimmest, largest_shift = 1e-30, 8.0
    packets, levels = [], []
    for number in range(len(SETS)):
        T, x, y, square = (
            field.transpose(1, 0, 2, 3) for field in at_azimuths(light[number], azimuths)
        )
        lit = dimmest < T
        safe = np.where(lit, T, 1.0)
        # Means over the light: <D> and <|D|^2>, with D from the entry of the light to the point.
        x, y, square = x / safe, y / safe, square / safe
        # Half of the variance is the variance of one axis; rounding may leave nothing of it.
        sigma = np.sqrt(np.maximum(square - x**2 - y**2, 1e-3 * square + 1e-12) / 2)
        # The centre of the collector lies opposite, from the point to the entry; where there is
        # hardly any light c/sigma would be noise without a limit.
        c_x, c_y = (np.clip(-each / sigma, -largest_shift, largest_shift) for each in (x, y))
        source = np.log(safe) - log_opacity - np.log(at_angle(angular[number], cosines))
        values = np.where(
            lit[..., None], np.stack([source, c_x, c_y, np.log(sigma)], axis=-1), np.nan
        )
        # log Q_0 is the source in the direction in the middle of both axes: level, and across the
        # sun's.
        level = values[:, :, SIDES[3] // 2, SIDES[4] // 2, 0].copy()
        values = values[:: COMPUTED[1], :: COMPUTED[2]]
        values[..., 0] -= level[:: COMPUTED[1], :: COMPUTED[2], None, None]
        packets.append(values.astype(np.float32))
        levels.append(level - coordinates.steep_powers(number, t, depths)[:, None])
    return np.stack(packets), np.stack(levels)


def _finer_sources(number: int, level: Array) -> Array:
    """Return log Q_0 of a set at the entries of frames, from log Q_0 less r at computed ones."""
    from scipy.interpolate import make_interp_spline

    finer = _filled(level[..., None])[..., 0]
    # One axis after another: cubic splines over even steps of the coordinate.
    for axis, times in enumerate(FINER):
        count = finer.shape[axis]
        spline = make_interp_spline(
            np.linspace(0, 1, count), np.moveaxis(finer, axis, 0), k=min(3, count - 1)
        )
        finer = np.moveaxis(spline(np.linspace(0, 1, (count - 1) * times + 1)), 0, axis)
    # The splines interpolated without r, which comes back at the finer entries.
    for place, t in enumerate(coordinates.thicknesses(finer.shape[0])):
        powers = coordinates.steep_powers(
            number, float(t), coordinates.depths(finer.shape[1], float(t))
        )
        finer[place] += powers[:, None]
    dark = -60.0  # the logarithm where there is no light
    return np.maximum(finer, dark)


def _filled(values: Array) -> Array:
    """Return values (thicknesses, depths, suns, ..) that go on where there is no light."""
    # From where there is light, values go on deeper, to thinner slabs, to lower suns, up, and to
    # thicker slabs: axis and direction in turn.
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
    # Modes -m have the same B and C as m, which therefore count twice for m > 0. A_m and A_{-m} are
    # stored apart; for m = 0 both are the same mode.
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
        # A point above the lit face counts as on it, one below the other face as on that.
        t = dr.maximum(t, 1e-6)
        d = dr.clip(d, 0, t)
        sun = dr.clip(mu_l, coordinates.LOWEST_SUN, 1)
        # Beyond the grid, the nearest thickness and sun at the same fraction of the depth.
        inside = dr.clip(t, coordinates.THINNEST, coordinates.THICKEST)
        place = place_fractions(inside, d * (inside / t), sun)
        # The coordinates asin(mu)/pi + 1/2 and phi/pi; the sign of sin phi mirrors c_y at the end.
        direction = dr.fma(dr.asin(dr.clip(mu, -1, 1)), dr.inv_pi, 0.5)
        azimuth = dr.safe_acos(cos_phi) * dr.inv_pi
        source, x, y, log_sigma = _between(
            four_numbers(Float), self.entries, number, (*place, direction, azimuth), SIDES
        )
        # log(Q/Q_0) plus log Q_0.
        source += _between(Float, self.sources, number, place, self.fine)
        sigma = dr.exp(log_sigma)
        # The scattering angle between the sun's light and the direction, for P_s.
        cosine = dr.fma(dr.safe_sqrt((1 - mu * mu) * (1 - sun * sun)), cos_phi, -mu * sun)
        # T of lower suns and thinner slabs falls to 0.
        fade = dr.clip(mu_l / coordinates.LOWEST_SUN, 0, 1) * dr.minimum(
            t / coordinates.THINNEST, 1
        )
        angle = dr.safe_acos(cosine) * dr.inv_pi
        (scattered,) = between_entries(self.angular, [(angle, ENTRIES)], first=number)
        # T = Q P_s (1 - exp(-L)).
        T = scattered * _passed(t, d, mu) * dr.exp(source) * fade
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
    # Level lines of sight never leave the slab: their cosine counts as a small one.
    return opacity(dr.select(mu < 0, d, t - d) / dr.maximum(dr.abs(mu), 1e-6))
