# SPDX-License-Identifier: BSD-3-Clause
"""The 22 functions of Bouthors 2008, section 5.2, fitted to the canonical transport, in optical lengths.

With theta the scattering angle, phi_L = acos(mu_L) and the paper's functions in capitals,

    T     = P(theta) A X mu_L log(d + D)/log(B + D) exp(-(d - B)^2/(2 C^2)),     B = B1(t, mu) - B2(t, mu_L),
    c_y   = F sin phi sin(G phi_L) log(1 + E d) + H sin phi sin phi_L,
    c_x   = (I + J (cos phi sin(K phi_L) + L phi_L)) log(1 + E d) + M + N cos phi,
    sigma = O + Q t log(1 + R d) + S log(1 + T t),

A, C, D of (t, mu), X of (t, mu_L), E to M of mu, N of (mu, mu_L), O to T numbers. The paper's c_x is c_y here and its
c_z is c_x. It prints no fitted value, so all are fitted here, one set at a time, by least squares as the paper says.

As printed, the logarithms depend on the unit of length, change sign at d + D = 1, and the quotient is singular at
B + D = 1: D is kept above 1.01 and B + D above 1.05, in mean free paths.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.realtime.clouds.canonical import coordinates
from airlight.realtime.clouds.canonical.coordinates import SETS
from airlight.realtime.clouds.canonical.kept import keep, load_kept, medium_numbers
from airlight.realtime.clouds.canonical.transport_grid import Transport, logged, transport_digest
from airlight.realtime.clouds.slab_orders.phases import SlabPhase
from airlight.realtime.numerics.array_types import ArrayTypes
from airlight.realtime.numerics.functions import between_entries

Array = NDArray[Any]
Progress = Callable[[float, str], None]

#: Raise this when a fit to the same transport gives other numbers.
VERSION = 2

_THICKNESSES, _DEPTHS, _SUNS, _DIRECTIONS, _AZIMUTHS = 10, 10, 5, 13, 3
_ANGLES = 61  #: of P
_HORIZON = 5e-4  #: cosine of the direction at mu = 0
_LEAST_D, _LEAST_SUM = 1.01, 1.05
_FLOOR = 0.02  #: of the brightest of a thickness, below which errors count less
_LARGEST = 1e6  #: of a parameter, which without light nothing else bounds
_ROUNDS = 1  #: of P, fitted to what is left of T
_DIM = 1e-3  #: of all sets' light, below which a collector does not count


@dataclass(frozen=True)
class FittedSet:
    """The functions of one set."""

    p: Array  #: (angles,), at even scattering angles
    of_directions: Array  #: (thicknesses, directions, 4): log A, B1, C, D
    of_suns: Array  #: (thicknesses, suns, 2): log X, B2
    collector: Array  #: (directions, 9): E to M
    n: Array  #: (directions, suns): N
    spread: Array  #: (5,): O, Q, R, S, T


@dataclass(frozen=True)
class _Samples:
    """Points (thicknesses, depths, suns, directions, azimuths), and what the transport is there."""

    t: Array
    d: Array
    mu_l: Array
    mu: Array
    phi: Array
    T: Array
    c_x: Array
    c_y: Array
    sigma: Array
    fraction: Array  #: of the light of all sets


def fitted_functions(
    phase: SlabPhase,
    albedo: float,
    look_up: Transport,
    types: ArrayTypes,
    *,
    progress: Progress | None = None,
) -> tuple[FittedSet, ...]:
    """Return the functions fitted to the canonical transport of a medium, from the disk where they are kept there.

    `phase`, `albedo`: of the medium; `look_up`: its canonical transport; `types`: of its numbers; `progress`: called
    with (share done, what) while functions are fitted; without it the log says how far they are.
    """
    made = VERSION, transport_digest(), types.scalar.__name__
    digest = hashlib.blake2b(repr(made).encode(), digest_size=8).hexdigest()
    medium = medium_numbers(phase, albedo)
    names = [field.name for field in fields(FittedSet)]
    arrays = load_kept(digest, medium)
    if arrays is None:
        fitted = fit_transport(look_up, types, progress=progress or logged("functions fitted for clouds"))
        keep(digest, medium, {name: np.stack([getattr(each, name) for each in fitted]) for name in names})
        return fitted
    return tuple(FittedSet(*(arrays[name][number] for name in names)) for number in range(len(SETS)))


def fit_transport(look_up: Transport, types: ArrayTypes, *, progress: Progress | None = None) -> tuple[FittedSet, ...]:
    """Fit the functions to the canonical transport.

    `look_up`: the canonical transport; `types`: of its numbers; `progress`: called with (share done, what).
    """
    tell = progress or (lambda fraction, what: None)
    samples = _samples(look_up, types)
    fitted = []
    for number, of_set in enumerate(samples):
        tell(number / len(SETS), f"set {number + 1} of {len(SETS)}")
        of_directions, of_suns, p = _fit_transport(of_set, constant=number == len(SETS) - 1)
        collector, n = _fit_collector(of_set)
        fitted.append(FittedSet(p, of_directions, of_suns, collector, n, _fit_spread(of_set)))
    return tuple(fitted)


def _axes() -> tuple[Array, Array, Array]:
    return coordinates.thicknesses(_THICKNESSES), coordinates.suns(_SUNS), _directions(_DIRECTIONS)


def _directions(count: int) -> Array:
    """Return mu = +-(1 - cos(pi v))/2 at even v from -1 to 1, fine at the horizon; the one in the middle is off 0."""
    places = np.linspace(-1.0, 1.0, count)
    values = np.sign(places) * (1 - np.cos(np.pi * places)) / 2
    values[count // 2] = _HORIZON
    return values


def _direction_fraction(mu: Any) -> Any:
    """Return the coordinate of a direction, from 0 to 1."""
    v = dr.safe_acos(dr.fma(-2, dr.abs(mu), 1)) * dr.inv_pi
    return dr.fma(dr.mulsign(v, mu), 0.5, 0.5)


def _samples(look_up: Transport, types: ArrayTypes) -> list[_Samples]:
    thicknesses, suns, directions = _axes()
    azimuths = (np.arange(_AZIMUTHS) + 0.5) * np.pi / _AZIMUTHS
    depths = np.stack([coordinates.depths(_DEPTHS, t) for t in thicknesses])
    shape = (_THICKNESSES, _DEPTHS, _SUNS, _DIRECTIONS, _AZIMUTHS)
    t, mu_l, mu, phi = (
        np.broadcast_to(values.reshape([-1 if axis == place else 1 for axis in range(5)]), shape)
        for values, place in ((thicknesses, 0), (suns, 2), (directions, 3), (azimuths, 4))
    )
    d = np.broadcast_to(depths[:, :, None, None, None], shape)
    given = [types.scalar(values.ravel()) for values in (t, d, mu, np.cos(phi), np.sin(phi), mu_l)]
    values: list[Any] = []
    for number in range(len(SETS)):
        results = look_up(number, *given)
        dr.eval(results)
        values.append([np.array(each, dtype=np.float64).reshape(shape) for each in results])
    light = np.maximum(np.sum([each[0] for each in values], axis=0), 1e-300)
    values = [(*each, each[0] / light) for each in values]
    return [_Samples(t, d, mu_l, mu, phi, *each) for each in values]


def _angles(samples: _Samples) -> Array:
    sines = np.sqrt((1 - samples.mu**2) * (1 - samples.mu_l**2))
    return np.arccos(np.clip(sines * np.cos(samples.phi) - samples.mu * samples.mu_l, -1, 1))


def _fit_transport(samples: _Samples, *, constant: bool) -> tuple[Array, Array, Array]:
    """Return log A, B1, C, D; log X, B2; and P."""
    at = np.linspace(0, np.pi, _ANGLES)
    angles = _angles(samples)
    p = np.ones(_ANGLES)
    of_directions = np.zeros((_THICKNESSES, _DIRECTIONS, 4))
    of_suns = np.zeros((_THICKNESSES, _SUNS, 2))
    for turn in range(_ROUNDS + (not constant)):
        values = np.interp(angles, at, p)
        model = np.empty_like(samples.T)
        for number in range(_THICKNESSES):
            start = (of_directions[number], of_suns[number]) if turn else None
            of_directions[number], of_suns[number], model[number] = _fit_thickness(samples, number, values, start)
        if constant:
            break
        # P takes what is left at each angle, weighted as T is fitted.
        weight = 1 / (samples.T + _floor(samples)) ** 2
        bins = np.rint(angles / np.pi * (_ANGLES - 1)).astype(np.int64).ravel()
        above = np.bincount(bins, (weight * samples.T * model).ravel(), _ANGLES)
        below = np.bincount(bins, (weight * model**2).ravel(), _ANGLES)
        seen = below > 0
        p *= np.interp(at, at[seen], np.maximum(above[seen] / below[seen], 1e-3))
    return of_directions, of_suns, p


def _floor(samples: _Samples) -> Array:
    return _FLOOR * samples.T.max(axis=(1, 2, 3, 4), keepdims=True) + 1e-30


def _fit_thickness(
    samples: _Samples, number: int, p: Array, start: tuple[Array, Array] | None
) -> tuple[Array, Array, Array]:
    """Fit one thickness, all directions and suns together; return the functions and the modelled T."""
    from scipy.optimize import least_squares

    t, T = float(samples.t[number].flat[0]), samples.T[number]
    d, mu_l = samples.d[number, :, 0, 0, 0], samples.mu_l[number, 0, :, 0, 0]
    scale = T + _floor(samples)[number]
    first = _DIRECTIONS * 4
    if start is None:
        typical = max(float(np.median(T[T > 0])) if (T > 0).any() else 1e-30, 1e-30)
        # A bell far wider than the slab shows no slope in its width, and 12 steps would leave it so.
        begin = np.tile([np.log(typical), t / 3, t / 2, 0.5], (_DIRECTIONS, 1))
        start = begin, np.zeros((_SUNS, 2))
    else:
        directions, suns = start
        # C and D are kept positive by their logarithms.
        directions = directions.copy()
        directions[:, 3] = np.log(np.maximum(directions[:, 3] - _LEAST_D, 1e-6))
        start = directions, suns

    def model(x: Array) -> Array:
        of_mu, of_sun = x[:first].reshape(-1, 4), x[first:].reshape(-1, 2)
        log_a, b1, c, log_d = of_mu.T
        log_x, b2 = of_sun.T
        shift = _LEAST_D + np.exp(np.clip(log_d, -14, 14))
        b = b1 - b2[:, None]
        ratio = np.log(d[:, None, None] + shift) / np.log(np.maximum(b + shift, _LEAST_SUM))
        width = np.maximum(np.abs(c), 1e-3 * t)
        bell = np.exp(np.clip(log_a + log_x[:, None], -200, 50) - (d[:, None, None] - b) ** 2 / (2 * width**2))
        return (bell * ratio * mu_l[:, None])[..., None] * p[number]

    # Least squares with a Jacobian by differences: the functions of one direction touch no other direction.
    fitted = least_squares(
        lambda x: ((model(x) - T) / scale).ravel(),
        np.concatenate([each.ravel() for each in start]),
        method="trf",
        max_nfev=12,
        x_scale="jac",
    )
    of_mu, of_sun = fitted.x[:first].reshape(-1, 4).copy(), fitted.x[first:].reshape(-1, 2)
    of_mu[:, 2] = np.maximum(np.abs(of_mu[:, 2]), 1e-3 * t)
    of_mu[:, 3] = _LEAST_D + np.exp(np.clip(of_mu[:, 3], -14, 14))
    return of_mu, of_sun, model(fitted.x)


def _fit_collector(samples: _Samples) -> tuple[Array, Array]:
    """Return E to M by direction, and N by direction and sun."""
    collector, n = np.zeros((_DIRECTIONS, 9)), np.zeros((_DIRECTIONS, _SUNS))
    for number in range(_DIRECTIONS):
        collector[number], n[number] = _fit_direction(samples, number)
    return collector, n


def _fit_direction(samples: _Samples, number: int) -> tuple[Array, Array]:
    """Return E to M of one direction, and N by sun."""
    from scipy.optimize import least_squares

    part = (slice(None), slice(None), slice(None), number)
    seen = samples.fraction[part] > _DIM
    if seen.sum() < 40:
        seen = samples.T[part] > 0
    d, mu_l, phi, sigma = (each[part][seen] for each in (samples.d, samples.mu_l, samples.phi, samples.sigma))
    sun = np.broadcast_to(np.arange(_SUNS)[:, None], samples.d[part].shape)[seen]
    c_x, c_y = samples.c_x[part][seen], samples.c_y[part][seen]
    phi_l = np.arccos(mu_l)

    def errors(x: Array) -> Array:
        along, across = _collector(x[:9], x[9 + sun], d, phi, phi_l)
        return np.concatenate([(along - c_x) / sigma, (across - c_y) / sigma])

    start = np.concatenate([[1.0, -0.5, 1.0, -0.2, -0.1, -0.5, 1.0, 0.5, 0.0], np.zeros(_SUNS)])
    fitted = least_squares(errors, start, method="trf", max_nfev=60, loss="soft_l1")
    return fitted.x[:9], fitted.x[9:]


def _collector(x: Array, n: Array, d: Array, phi: Array, phi_l: Array) -> tuple[Array, Array]:
    """Return c_x and c_y of the form."""
    e, f, g, h, i, j, k, ell, m = x
    depth = np.log1p(np.abs(e) * d)
    along = (i + j * (np.cos(phi) * np.sin(k * phi_l) + ell * phi_l)) * depth + m + n * np.cos(phi)
    across = f * np.sin(phi) * np.sin(g * phi_l) * depth + h * np.sin(phi) * np.sin(phi_l)
    return along, across


def _fit_spread(samples: _Samples) -> Array:
    """Return O, Q, R, S, T."""
    from scipy.optimize import least_squares

    seen = samples.fraction > _DIM
    t, d, sigma = (each[seen][::3] for each in (samples.t, samples.d, samples.sigma))

    def model(x: Array) -> Array:
        o, q, r, s, big_t = x
        return o + q * t * np.log1p(np.abs(r) * d) + s * np.log1p(np.abs(big_t) * t)

    fitted = least_squares(lambda x: model(x) / sigma - 1, [0.1, 0.01, 1.0, 0.5, 1.0], max_nfev=200, loss="soft_l1")
    x = fitted.x
    return np.array([x[0], x[1], abs(x[2]), x[3], abs(x[4])])


def fit_on_device(fitted: tuple[FittedSet, ...], types: ArrayTypes) -> "DeviceFit":
    """Return the look-up of fitted functions, with the arguments and results of a `Transport`.

    Depths are kept within the slab, thicknesses and suns within those that were fitted; sigma is kept positive.
    """
    Float = types.scalar

    def table(name: str) -> Any:
        of_all = np.stack([getattr(each, name) for each in fitted])
        return Float(np.clip(of_all, -_LARGEST, _LARGEST).ravel())

    made = DeviceFit(*(table(field.name) for field in fields(DeviceFit)))
    dr.make_opaque(made)
    return made


@dataclass(frozen=True)
class DeviceFit:
    """Fitted functions as a `Transport`, each a table of all sets, one after the other.

    They are fields, so that recorded functions take them as inputs.
    """

    p: Any
    of_directions: Any
    of_suns: Any
    collector: Any
    n: Any
    spread: Any

    def __call__(self, set_number: Any, t, d, mu, cos_phi, sin_phi, mu_l):
        """Return T [1/sr], c_x, c_y, sigma [mean free paths]."""
        number = mi.UInt32(set_number)
        t = dr.clip(t, coordinates.THINNEST, coordinates.THICKEST)
        d = dr.clip(d, 0, t)
        sun = dr.clip(mu_l, coordinates.LOWEST_SUN, 1)
        phi_l = dr.acos(sun)
        at_t, _, at_sun = coordinates.place_fractions(t, d, sun)
        at_mu = _direction_fraction(dr.clip(mu, -1, 1))
        cosine = dr.fma(dr.safe_sqrt((1 - mu * mu) * (1 - sun * sun)), cos_phi, -mu * sun)
        (p,) = between_entries(self.p, [(dr.safe_acos(cosine) / np.pi, _ANGLES)], 1, number)
        direction, height = (at_mu, _DIRECTIONS), (at_sun, _SUNS)
        log_a, b1, c, shift = between_entries(self.of_directions, [(at_t, _THICKNESSES), direction], 4, number)
        log_x, b2 = between_entries(self.of_suns, [(at_t, _THICKNESSES), height], 2, number)
        e, f, g, h, i, j, k, ell, m = between_entries(self.collector, [direction], 9, number)
        (n,) = between_entries(self.n, [direction, height], 1, number)
        b = b1 - b2
        ratio = dr.log(d + shift) / dr.log(dr.maximum(b + shift, _LEAST_SUM))
        T = p * mu_l * ratio * dr.exp(dr.clip(log_a + log_x, -200, 50) - 0.5 * dr.square((d - b) / c))
        depth = dr.log(1 + dr.abs(e) * d)
        c_x = (i + j * (cos_phi * dr.sin(k * phi_l) + ell * phi_l)) * depth + m + n * cos_phi
        c_y = sin_phi * (f * dr.sin(g * phi_l) * depth + h * dr.sin(phi_l))
        o, q, r, s, big_t = (dr.gather(type(t), self.spread, 5 * number + place) for place in range(5))
        sigma = o + q * t * dr.log(1 + r * d) + s * dr.log(1 + big_t * t)
        return dr.select(mu_l > 0, T, 0), c_x, c_y, dr.maximum(sigma, 1e-3)
