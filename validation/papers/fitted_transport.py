# SPDX-License-Identifier: BSD-3-Clause
r"""The functions that Bouthors 2008, section 5.2, fits to the light of slabs: those
of T, which Fig. 8 draws.

With theta the scattering angle and the paper's functions in capitals, lengths in mean free paths,

    T = P(theta) A X mu_L log(d + D)/log(B + D) exp(-(d - B)^2/(2 C^2)),     B = B1(t, mu) - B2(t, mu_L),

A, C, D of (t, mu), X of (t, mu_L). The paper prints no fitted value, so all are fitted here, one
set of orders at a time, by least squares as the paper says.

As printed, the logarithms depend on the unit of length, change sign at d + D = 1, and the quotient
is singular at B + D = 1: D is kept above 1.01 and B + D above 1.05, in mean free paths.

A, B1, C, D, X and B2 are tables, linear between entries in the logarithm of the thickness, in the
angle of the direction and in the coordinate of the sun.
"""

from dataclasses import dataclass

import drjit as dr
import numpy as np

from airlight.realtime.clouds.canonical import coordinates
from airlight.realtime.clouds.canonical.coordinates import SETS
from airlight.realtime.clouds.canonical.transport_grid import Transport
from airlight.realtime.numerics.array_types import ArrayTypes
from airlight.validation.arrays import Array

_THICKNESSES, _DEPTHS, _SUNS, _DIRECTIONS, _AZIMUTHS = 10, 10, 5, 13, 3
_LEAST_SUM = 1.05  # of B + D, in mean free paths
_EXPONENTS = (-200, 50)  # of A X, and +-14 of D: without light nothing else bounds them


@dataclass(frozen=True)
class FittedRadiance:
    """The functions of T for one set of orders."""

    p: Array  #: (angles,), at even scattering angles
    of_directions: Array  #: (thicknesses, directions, 4): log A, B1, C, D
    of_suns: Array  #: (thicknesses, suns, 2): log X, B2

    def __call__(self, t: float, d: float, mu: Array, mu_l: float) -> Array:
        """Return T in the plane of the sun [1/sr]; the nearest entry stands
        in outside of the tables.

        `t`, `d`: thickness of the slab and depth of the point [mean free paths]; `mu`: cosines of
        the directions in which light leaves the point with the normal of the lit face; `mu_l`: of
        the sun's zenith angle.
        """
        from scipy.interpolate import RegularGridInterpolator

        # Outside of the tables the nearest entry stands in.
        t = float(np.clip(t, coordinates.THINNEST, coordinates.THICKEST))
        sun = float(np.clip(mu_l, coordinates.LOWEST_SUN, 1))
        thickness = np.full_like(mu, _thickness_place(t))

        # Look the functions up, which are linear in these coordinates.
        thicknesses = _thickness_place(coordinates.thicknesses(len(self.of_suns)))
        directions = np.linspace(-1.0, 1.0, self.of_directions.shape[1])
        of_directions = RegularGridInterpolator((thicknesses, directions), self.of_directions)
        log_a, b1, c, shift = of_directions(np.stack([thickness, _direction_place(mu)], axis=-1)).T
        suns = _sun_place(coordinates.suns(self.of_suns.shape[1]))
        of_suns = RegularGridInterpolator((thicknesses, suns), self.of_suns)
        log_x, b2 = of_suns(np.stack([thickness, np.full_like(mu, _sun_place(sun))], axis=-1)).T
        angles = _scattering_angles(mu, mu_l, 0.0)
        p = np.interp(angles, np.linspace(0, np.pi, len(self.p)), self.p)

        # Evaluate the form, with a depth that lies in the slab.
        d, b = min(d, t), b1 - b2
        ratio = np.log(d + shift) / np.log(np.maximum(b + shift, _LEAST_SUM))
        bell = np.exp(np.clip(log_a + log_x, *_EXPONENTS) - (d - b) ** 2 / (2 * c**2))
        return p * mu_l * ratio * bell


@dataclass(frozen=True)
class _Samples:
    """Points (thicknesses, depths, suns, directions, azimuths), and T of
    one set of orders there.
    """

    t: Array
    d: Array
    mu_l: Array
    mu: Array
    phi: Array
    T: Array

    @property
    def scale(self) -> Array:
        """By which an error is divided: T itself, and a fraction of the
        brightest where T is dim.
        """
        # Errors of what is dimmer than 0.02 of the brightest of a thickness count less.
        return self.T + 0.02 * self.T.max(axis=(1, 2, 3, 4), keepdims=True) + 1e-30


def fit_radiance(look_up: Transport, types: ArrayTypes) -> tuple[FittedRadiance, ...]:
    """Return the functions of each set of orders, fitted to the canonical transport of a medium.

    `look_up`: the canonical transport; `types`: of its numbers.
    """
    last = len(SETS) - 1
    return tuple(
        _fit_set(each, isotropic=number == last)
        for number, each in enumerate(_samples(look_up, types))
    )


def _samples(look_up: Transport, types: ArrayTypes) -> list[_Samples]:
    """Return T of each set on a coarse grid of points."""
    thicknesses = coordinates.thicknesses(_THICKNESSES)
    # The middles of equal parts of the half circle: T is even in the azimuth.
    azimuths = (np.arange(_AZIMUTHS) + 0.5) * np.pi / _AZIMUTHS
    shape = (_THICKNESSES, _DEPTHS, _SUNS, _DIRECTIONS, _AZIMUTHS)

    def along(axis: int, values: Array) -> Array:
        # Values along one of the five axes, constant along the others.
        return np.broadcast_to(
            values.reshape([-1 if each == axis else 1 for each in range(5)]), shape
        )

    t, mu_l = along(0, thicknesses), along(2, coordinates.suns(_SUNS))
    mu, phi = along(3, _directions(_DIRECTIONS)), along(4, azimuths)
    depths = np.stack([coordinates.depths(_DEPTHS, thickness) for thickness in thicknesses])
    d = np.broadcast_to(depths[:, :, None, None, None], shape)

    # The direction of a view is its cosine and the cosine and sine of its azimuth; the look-up
    # takes all points at once.
    given = [types.scalar(values.ravel()) for values in (t, d, mu, np.cos(phi), np.sin(phi), mu_l)]
    samples = []
    for number in range(len(SETS)):
        T, *_ = look_up(number, *given)
        dr.eval(T)
        samples.append(_Samples(t, d, mu_l, mu, phi, np.array(T, dtype=np.float64).reshape(shape)))
    return samples


def _directions(count: int) -> Array:
    """Return mu = +-(1 - cos(pi v))/2 at even v from -1 to 1, fine at the horizon; the
    one in the middle is off 0.
    """
    # The inverse of `_direction_place`: tables are linear in v.
    places = np.linspace(-1.0, 1.0, count)
    values = np.sign(places) * (1 - np.cos(np.pi * places)) / 2
    values[count // 2] = 5e-4  # cosine of the entry at mu = 0
    return values


def _direction_place(mu: Array) -> Array:
    """Return v of `_directions`."""
    return np.sign(mu) * np.arccos(1 - 2 * np.abs(mu)) / np.pi


def _thickness_place(t: float | Array) -> Array:
    return np.asarray(np.log(t + coordinates.THICKNESS_SHIFT))


def _sun_place(mu_l: float | Array) -> Array:
    return np.asarray(np.sqrt(np.arcsin(mu_l) * 2 / np.pi))


def _scattering_angles(mu: Array, mu_l: float | Array, phi: float | Array) -> Array:
    # The sun's light travels down and the view leaves upwards: mu and mu_l enter the product with
    # opposite signs.
    sines = np.sqrt((1 - mu**2) * (1 - mu_l**2))
    return np.arccos(np.clip(sines * np.cos(phi) - mu * mu_l, -1, 1))


def _fit_set(samples: _Samples, *, isotropic: bool) -> FittedRadiance:
    """Fit one set of orders: P and the other functions in turns; P of an `isotropic` one is 1."""
    entries = 61  # of P
    at = np.linspace(0, np.pi, entries)
    angles = _scattering_angles(samples.mu, samples.mu_l, samples.phi)
    # Each sample belongs to the nearest entry of P.
    bins = np.rint(angles / np.pi * (entries - 1)).astype(np.int64).ravel()
    weight = 1 / samples.scale**2
    p = np.ones(entries)
    starts = [_first_guess(samples, number) for number in range(_THICKNESSES)]
    for _ in range(2):  # rounds of P and the other functions
        # All functions but P, from where they ended.
        values = np.interp(angles, at, p)
        fits = [
            _fit_thickness(samples, number, values[number], start)
            for number, start in enumerate(starts)
        ]
        starts = [fit.x for fit in fits]
        if isotropic:
            break

        # P is multiplied by the ratio of T to the model at each angle, weighted as T is fitted.
        model = np.stack([fit.model for fit in fits])
        # Least squares for a factor f of each angle: sum w (T - f M)^2 is least at f = sum w T M /
        # sum w M^2.
        above = np.bincount(bins, (weight * samples.T * model).ravel(), entries)
        below = np.bincount(bins, (weight * model**2).ravel(), entries)
        hit = below > 0
        # Angles without samples take the factor between their neighbours; 1e-3 keeps P above 0, so
        # that later rounds can raise it again.
        p *= np.interp(at, at[hit], np.maximum(above[hit] / below[hit], 1e-3))
    return FittedRadiance(
        p, np.stack([fit.of_directions for fit in fits]), np.stack([fit.of_suns for fit in fits])
    )


def _first_guess(samples: _Samples, number: int) -> Array:
    """Return log A, B1, C, log (D - 1.01) by direction, then log X, B2 by sun,
    with which a fit begins.
    """
    T, t = samples.T[number], float(samples.t[number].flat[0])
    # Every function begins as a constant: A as the median of T, the middle of the bell at a third
    # of the thickness.
    typical = max(float(np.median(T[T > 0])) if (T > 0).any() else 1e-30, 1e-30)
    # A bell far wider than the slab shows no slope in its width, and the evaluations of
    # a fit would leave it so.
    return np.append(
        np.tile([np.log(typical), t / 3, t / 2, 0.5], _DIRECTIONS), np.zeros(2 * _SUNS)
    )


@dataclass(frozen=True)
class _Fit:
    """The functions of one thickness."""

    x: Array  #: with which the next round begins, as `_first_guess`
    of_directions: Array
    of_suns: Array
    model: Array  #: T by these functions


def _fit_thickness(samples: _Samples, number: int, p: Array, start: Array) -> _Fit:
    """Fit one thickness, all directions and suns together."""
    from scipy.optimize import least_squares

    t, T, scale = float(samples.t[number].flat[0]), samples.T[number], samples.scale[number]
    d, mu_l = samples.d[number, :, 0, 0, 0], samples.mu_l[number, 0, :, 0, 0]

    def tables(x: Array) -> tuple[Array, Array]:
        of_directions, of_suns = (
            x[: 4 * _DIRECTIONS].reshape(-1, 4).copy(),
            x[4 * _DIRECTIONS :].reshape(-1, 2),
        )
        # A width enters squared, so its sign is free; D is kept above its limit by an exponential.
        # Widths of at least 1e-3 thicknesses; D above 1.01 mean free paths.
        of_directions[:, 2] = np.maximum(np.abs(of_directions[:, 2]), 1e-3 * t)
        of_directions[:, 3] = 1.01 + np.exp(np.clip(of_directions[:, 3], -14, 14))
        return of_directions, of_suns

    def model(x: Array) -> Array:
        of_directions, of_suns = tables(x)
        log_a, b1, width, shift = of_directions.T
        log_x, b2 = of_suns.T
        b = b1 - b2[:, None]
        # log(d + D)/log(B + D), kept off its pole at B + D = 1.
        ratio = np.log(d[:, None, None] + shift) / np.log(np.maximum(b + shift, _LEAST_SUM))
        # log(A X) and the bell in one exponent; only log(A X) is bounded.
        exponent = np.clip(log_a + log_x[:, None], *_EXPONENTS) - (d[:, None, None] - b) ** 2 / (
            2 * width**2
        )
        return (np.exp(exponent) * ratio * mu_l[:, None])[..., None] * p

    fitted = least_squares(
        lambda x: ((model(x) - T) / scale).ravel(),
        start,
        method="trf",
        # It then ends within some thousandths, and the form misses T by 10 to 30 %.
        max_nfev=12,
        x_scale="jac",
    )
    return _Fit(fitted.x, *tables(fitted.x), model(fitted.x))
