# SPDX-License-Identifier: BSD-3-Clause
"""The radiance of all orders in a slab, in any direction and at any depth.

The source at a direction of the user is summed over the modes of the azimuth,

    J(z, mu, phi) = sum_m (2 - delta_m0) cos(m phi) (albedo/2) sum_j w_j K_m(mu, mu_j) I_m(z, mu_j)
                  + (albedo/4 pi) P(cos Theta_0) exp(-z/mu_0),

and carried to the depths. The peak that the streams cannot resolve is left in the beam (delta-M):
with f its fraction, depths are (1 - albedo f) z and the albedo albedo (1 - f)/(1 - albedo f). The
last term has the true phase function over 1 - albedo f (Nakajima and Tanaka 1988, their TMS). With
more streams both corrections vanish; the error that `light.py` prints is the change from three
quarters of the streams.

I_m of the exponential source of the beam is known in closed form on the lines
of `discrete_ordinates`.
"""

from collections.abc import Sequence

import numpy as np

from airlight.realtime.clouds.slab_orders.depth_panels import DepthPanels, Transport, depth_panels
from airlight.realtime.clouds.slab_orders.discrete_ordinates import (
    Eigenmodes,
    Streams,
    double_gauss,
    mode_kernel,
)
from airlight.realtime.clouds.slab_orders.phases import SlabPhase
from airlight.validation.arrays import Array


def slab_radiance(
    tau: float,
    mu0: float,
    phase: SlabPhase,
    albedo: float,
    *,
    depths: Sequence[float],
    directions: Sequence[tuple[float, float]],
    streams: int = 64,
    nodes: int = 8,
) -> Array:
    """Return the diffuse radiance of a slab [1/sr], (depths, directions), for
    unit flux across the beam.

    `tau`: thickness [mean free paths]; `mu0`: cosine of the zenith angle of the beam, in (0, 1];
    `phase`, `albedo`: of the medium; `depths`: in [0, tau] [mean free paths]; `directions`: mu,
    positive upwards and not 0, and phi [rad], 0 along the beam's horizontal direction; N, in each
    hemisphere; `nodes`: of each panel of depth.
    """
    rule = double_gauss(streams)
    moments = phase.moments(2 * streams + 1)
    # f of the module: the moment that the streams cannot resolve. Depths shrink by 1 - albedo f.
    peak = float(moments[-1])
    passing = 1 - albedo * peak
    mu, phi = np.array(directions, dtype=np.float64).T
    narrowest = min(float(rule.mu[0]), mu0, float(np.min(np.abs(mu)))) / 2
    thickness, wanted = passing * tau, [passing * depth for depth in depths]
    panels = depth_panels(thickness, narrowest, depths=wanted, count=nodes)
    # The moments without the peak, normalised again.
    scattered = (moments[:-1] - peak) / (1 - peak)
    source = _diffuse_source(
        panels,
        rule,
        mu0,
        moments=scattered,
        albedo=min(albedo * (1 - peak) / passing, 1.0),
        mu=mu,
        phi=phi,
    )
    # The last term: the beam scattered once, with the true phase function.
    cosines = -mu * mu0 + np.sqrt((1 - mu) * (1 + mu) * (1 - mu0) * (1 + mu0)) * np.cos(phi)
    beam = albedo / (4 * np.pi * passing) * phase.values(np.clip(cosines, -1.0, 1.0))
    source += np.exp(-panels.depths / mu0)[:, None] * beam
    # The source is carried along each direction; the depths are edges of the panels.
    _, (edges,) = Transport(panels, mu)(source[None])
    places = [int(np.argmin(np.abs(panels.edges - depth))) for depth in wanted]
    return edges[places]


def _diffuse_source(
    panels: DepthPanels,
    rule: Streams,
    mu0: float,
    *,
    moments: Array,
    albedo: float,
    mu: Array,
    phi: Array,
) -> Array:
    """Return the light that order 1 and above scatter into the directions, (Z, directions)."""
    tau = float(panels.edges[-1])
    total = np.zeros((panels.depths.size, mu.size))
    quiet = 0
    for m in range(moments.size):
        # K_m from the streams to the directions, and from the beam to the streams.
        to_user = albedo / 2 * mode_kernel(m, moments, mu, rule.mu) * rule.weights
        from_beam = albedo / (4 * np.pi) * mode_kernel(m, moments, rule.mu, np.array([-mu0]))[:, 0]
        modes = Eigenmodes(rule, m, albedo=albedo, moments=moments, peak=0.0)
        field = modes.radiance(
            _beam_lines(modes, modes.decoupled(from_beam), mu0, panels.depths, tau)
        )
        # Modes above 0 count twice: the sum is over m and -m.
        part = (2 if m else 1) * field @ to_user.T
        total += part * np.cos(m * phi)
        # A mode below 1e-10 of the source, twice in a row, ends the sum.
        quiet = quiet + 1 if np.max(np.abs(part)) <= 1e-10 * np.max(np.abs(total)) else 0
        if quiet == 2:
            break
    return total


def _beam_lines(modes: Eigenmodes, source: Array, mu0: float, depths: Array, tau: float) -> Array:
    """Return e+ and e- at depths for the source exp(-z/mu0), (Z, 2 N)."""
    k = modes.rates
    # Lines that go up and lines that go down, each with its rate k.
    plus, minus = np.split(source, 2)

    def upward(z: Array | float) -> Array:
        return plus * k / (k + 1 / mu0) * (np.exp(-z / mu0) - np.exp(-k * (tau - z) - tau / mu0))

    def downward(z: Array | float) -> Array:
        slow, gap = np.minimum(k, 1 / mu0), np.abs(k - 1 / mu0)
        # (exp(-slow z) - exp(-fast z))/gap, which is z exp(-slow z) where both are equal
        lag = np.where(gap * z > 1e-9, -np.expm1(-gap * z) / np.maximum(gap, 1e-300), z)
        return minus * k * np.exp(-slow * z) * lag

    along = np.concatenate([upward(depths[:, None]), downward(depths[:, None])], axis=-1)
    return modes.closed(along, depths, tau, upward(0.0), downward(tau))
