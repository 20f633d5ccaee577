# SPDX-License-Identifier: BSD-3-Clause
"""Directions of a slab: double-Gauss streams, and scattering between them by mode of the azimuth.

With the Legendre moments chi_l of the phase function (mean 1 over the sphere, chi_0 = 1)
the addition theorem gives

    P(cos Theta) = sum_m exp(i m (phi - phi')) K_m(mu, mu'),
    K_m(mu, mu') = sum_{l >= |m|} (2 l + 1) chi_l L_l^m(mu) L_l^m(mu'),    L_l^m = sqrt((l - m)!/(l + m)!) P_l^m.

N cosines in each hemisphere integrate polynomials of degree 2 N - 1 and therefore resolve l < 2 N.
The rest is close to forward and becomes an exact peak (delta-M, Wiscombe 1977): with f = chi_{2N}

    P = 2 f delta(1 - cos Theta) + (1 - f) P',    (1 - f) chi'_l = chi_l - f.

Light that meets the peak goes on in its direction, and yet was scattered: f stays a scattering
here, so that orders are orders of the true phase function. Delta-M's usual form takes f out of the
medium and would lose the count.

**All orders of scattering of one mode of the azimuth at once: the discrete-ordinate
equations, solved directly.**

With u and d the upward and downward radiances at the N cosines mu_i of a hemisphere, and sources q,

     mu du/dz = u - a u - b d - q_u,      -mu dd/dz = d - a d - b u - q_d,

a and b the scattering into the same and into the other hemisphere. Sum and difference, p =
u + d and r = u - d, obey

    mu p' = E r - q_m,   mu r' = D p - q_p,   E = 1 - a + b,  D = 1 - a - b,  q_m = q_u - q_d,  q_p = q_u + q_d.

Scaled by the square roots of cosines and weights, E and D become symmetric and positive
definite matrices A and B:

    p~' = A r~ - q_m~,   r~' = B p~ - q_p~,     p~ = sqrt(w mu) p,   q~ = sqrt(w/mu) q.

With A = L L^T, B = M M^T and the singular values M^T L = U k V^T, the choice p~ = L V P, r~ =
L^{-T} V R decouples them,

    P' = R - g_p,   R' = k^2 P - g_r,     g_p = V^T L^{-1} q_m~,   g_r = V^T L^T q_p~,

and e+- = R +- k P obey e+' = k e+ - (g_r + k g_p), e-' = -k e- - (g_r - k g_p): lines of cosine
1/k, upwards and downwards, along which `depth_panels.Transport` integrates any source. Singular
values keep small k to k_max times the rounding; eigenvalues k^2 (Stamnes and Swanson 1981) would
keep k^2 to k_max^2 times the rounding, and thick slabs that absorb nothing would lose 1e-5 of their
light.

At albedo 1 one k is 0. The albedo is therefore 1 - 1e-12 at most, which costs a slab of thickness
tau about 1e-12 tau.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray

from airlight.realtime.clouds.slab_orders.depth_panels import Transport

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Streams:
    """Cosines and weights of a double-Gauss rule."""

    mu: Array  #: (2 N,), first upwards (mu > 0), then downwards
    weights: Array  #: (2 N,), with the sum 1 in each hemisphere

    @property
    def sines(self) -> Array:
        """Sines of the zenith angles of the streams."""
        return np.sqrt((1 - self.mu) * (1 + self.mu))


def double_gauss(count: int) -> Streams:
    """Return `count` streams in each hemisphere."""
    nodes, weights = leggauss(count)
    half = (nodes + 1) / 2
    return Streams(mu=np.concatenate([half, -half]), weights=np.concatenate([weights, weights]) / 2)


def legendre_table(m: int, degrees: int, mu: Array) -> Array:
    """Return L_l^m(mu) for l = 0 .. degrees - 1, (degrees, J); zero for l < m.

    The recurrence in l is stable: sqrt((l+1)^2 - m^2) L_{l+1} = (2 l + 1) mu L_l -
    sqrt(l^2 - m^2) L_{l-1}.
    """
    table = np.zeros((degrees, mu.size))
    if m >= degrees:
        return table
    sines = np.sqrt((1 - mu) * (1 + mu))
    # sqrt(1/(2m)!) (2m-1)!! sin^m as a product, which neither overflows nor underflows early
    first = np.ones_like(mu)
    for k in range(1, m + 1):
        first = first * (sines * math.sqrt((2 * k - 1) / (2 * k)))
    table[m] = first
    for degree in range(m, degrees - 1):
        previous = table[degree - 1] * math.sqrt(degree**2 - m**2) if degree > m else 0.0
        table[degree + 1] = ((2 * degree + 1) * mu * table[degree] - previous) / math.sqrt(
            (degree + 1) ** 2 - m**2
        )
    return table


def mode_kernel(m: int, moments: Array, to: Array, source: Array) -> Array:
    """Return K_m between the cosines `to` and `source`, (to, source), of a phase function with
    some moments.
    """
    degrees = moments.size
    strengths = (2 * np.arange(degrees) + 1) * moments
    return (legendre_table(m, degrees, to).T * strengths) @ legendre_table(m, degrees, source)


class Eigenmodes:
    """The discrete-ordinate equations of one mode of the azimuth, decoupled.

    `streams`: the directions; `m`: the mode; `albedo`: in [0, 1]; `moments`: (2 N,), of the phase
    function less its peak; `peak`: fraction of the scattered light that goes on in its direction.
    """

    def __init__(self, streams: Streams, m: int, *, albedo: float, moments: Array, peak: float):
        from scipy.linalg import cholesky, solve_triangular

        half = streams.mu.size // 2
        mu, weights = streams.mu[:half], streams.weights[:half]
        # At albedo 1 one k would be 0, and the cosine 1/k of its line infinite.
        albedo = min(albedo, 1 - 1e-12)
        # Scattering from all streams into the upward ones, scaled by the roots of both weights, so
        # that it is symmetric: a, into the same hemisphere, and b, into the other, plus the peak.
        root = np.sqrt(weights)
        kernel = (
            albedo / 2 * root[:, None] * mode_kernel(m, moments, mu, streams.mu) * np.tile(root, 2)
        )
        same, other = kernel[:, :half], kernel[:, half:]
        same = same + albedo * peak * np.eye(half)
        # L and M, with A = L L^T and B = M M^T.
        scale = 1 / np.sqrt(mu)
        lower = scale[:, None] * cholesky(np.eye(half) - same + other, lower=True)
        partner = scale[:, None] * cholesky(np.eye(half) - same - other, lower=True)
        # M^T L = U k V^T.
        _, rates, right = np.linalg.svd(partner.T @ lower)
        self.rates: Array = rates
        # q~ = sqrt(w/mu) q, and back p = p~/sqrt(w mu); p~ = L V P and r~ = L^{-T} V R.
        self._in = np.sqrt(weights / mu)
        self._out = 1 / np.sqrt(weights * mu)
        self._sums = lower @ right.T
        self._differences = solve_triangular(lower, right.T, lower=True, trans="T")

    @property
    def cosines(self) -> Array:
        """(2 N,) cosines 1/k of the lines of e+ and e-, for `Transport`."""
        return np.concatenate([1 / self.rates, -1 / self.rates])

    def decoupled(self, source: Array) -> Array:
        """Return the sources of e+ and e- along their lines, (.., 2 N), of a
        source of radiance, (.., 2 N).
        """
        up, down = np.split(source, 2, axis=-1)
        # Along its line of cosine 1/k, e+ has the source g_p + g_r/k, and e- along the other g_p -
        # g_r/k.
        g_p = ((up - down) * self._in) @ self._differences
        g_r = ((up + down) * self._in) @ self._sums
        return np.concatenate([g_r / self.rates + g_p, g_p - g_r / self.rates], axis=-1)

    def radiance(self, along: Array) -> Array:
        """Return the radiances of e+ and e-, both (.., 2 N)."""
        plus, minus = np.split(along, 2, axis=-1)
        # P = (e+ - e-)/(2 k) and R = (e+ + e-)/2; then u = (p + r)/2 and d = (p - r)/2.
        p = ((plus - minus) / (2 * self.rates)) @ self._sums.T * self._out
        r = ((plus + minus) / 2) @ self._differences.T * self._out
        return np.concatenate([(p + r) / 2, (p - r) / 2], axis=-1)

    def all_orders(self, transport: Transport, source: Array) -> Array:
        """Return the radiance at the nodes that a source makes with all that is scattered
        again, (F, Z, 2 N) both.

        `transport`: through the panels along the lines of `cosines`.
        """
        along, edges = transport(self.decoupled(source))
        half, panels = self.rates.size, transport.panels
        # e+ leaves at the top, e- at the bottom, as their sources alone make them.
        ends = edges[:, 0, :half], edges[:, -1, half:]
        return self.radiance(self.closed(along, panels.depths, float(panels.edges[-1]), *ends))

    def closed(self, along: Array, depths: Array, tau: float, top: Array, bottom: Array) -> Array:
        """Return e+ and e- at depths (Z,) with what their sources send into them through
        the faces, (.., Z, 2 N).

        `top` and `bottom`, (.., N), are e+ at the top and e- at the bottom
        that the sources alone make.
        """
        from_bottom, from_top = (
            ends.T[..., None, :] for ends in self._entering(tau, top.T, bottom.T)
        )
        plus, minus = np.split(along, 2, axis=-1)
        # Without sources e+ falls like exp(-k (tau - z)) from the bottom, e- like exp(-k z) from
        # the top.
        plus = plus + from_bottom * np.exp(-self.rates * (tau - depths[:, None]))
        return np.concatenate(
            [plus, minus + from_top * np.exp(-self.rates * depths[:, None])], axis=-1
        )

    def _entering(self, tau: float, top: Array, bottom: Array) -> tuple[Array, Array]:
        """Return e+ at the bottom and e- at the top, (N, ..), for which no
        light enters from outside.
        """
        # The conditions u = 0 at the bottom and d = 0 at the top, with p = x (e+ - e-) and r = y
        # (e+ + e-): their difference and their sum hold the difference and the sum of both unknowns
        # alone.
        fade, opacity = np.exp(-self.rates * tau), -np.expm1(-self.rates * tau)
        x, y = self._sums / (2 * self.rates), self._differences / 2
        difference = np.linalg.solve(x * (1 + fade) + y * opacity, (x - y) @ (bottom - top))
        sum_ = np.linalg.solve(x * opacity + y * (1 + fade), (x - y) @ (bottom + top))
        return (sum_ + difference) / 2, (sum_ - difference) / 2
