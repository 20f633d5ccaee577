# SPDX-License-Identifier: BSD-3-Clause
"""The light of each order in a slab, and the moments of its horizontal
displacement, without random numbers.

A beam enters a slab at one point. I_n is the radiance of light that was scattered n times; D its
horizontal displacement from that point, as a complex number x + i y with x along the horizontal
direction of the beam. With s the optical length along a direction, w = sin theta exp(i phi) its
horizontal part, and

    M0 = I,    M1 = <D I>,    M2 = <|D|^2 I>,

what light of order n gains on its way is, since D grows by w ds,

    dM0_n/ds = -M0_n + S[M0_{n-1}]
    dM1_n/ds = -M1_n + S[M1_{n-1}] + w M0_n
    dM2_n/ds = -M2_n + S[M2_{n-1}] + 2 Re(conj(w) M1_n)

with S[I](w) = (albedo/4 pi) int P(w, w') I(w') dw'. In modes of the azimuth,

    M0 = sum_m B_m e^{i m phi},   M1 = sum_m A_m e^{i m phi},   M2 = sum_m C_m e^{i m phi}     (all real: y -> -y),

w couples m to m + 1: A_m gains sin theta B_{m-1}, C_0 gains 2 sin theta A_1. Fluxes and fluences,
which are integrals over all azimuths, need B_0, A_0 and C_0 alone, hence five fields: B_0, B_1 =
B_{-1}, A_0, A_1, C_0. The beam is a stream of its own, the last, with b, <x b> and <x^2 b>.

The sum X of all orders after n obeys the same equations with S[M_n + X] for S[M_{n-1}], and is
solved for directly (`discrete_ordinates`): a thick slab that absorbs nothing would need thousands
of orders.

References
----------
Bouthors, Neyret, Max, Bruneton, Crassin 2008, "Interactive multiple anisotropic scattering in
clouds", sections 5.1 (canonical transport: mean and spread of the exit of light by sets of orders),
which samples what is solved here.
"""

import math
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

#: Places of the fields of one order at the nodes, (5, Z, 2 N + 1), the beam last.
B0, B1, A0, A1, C0 = range(5)
#: Places of the moments of some orders at the edges of the panels, for unit flux across the beam,
#: (3, 3, P + 1): flux up and down through the horizontal plane, and fluence; of each the amount
#: [1], the first moment in x [mean free paths], and the second in x^2 + y^2.
UP, DOWN, FLUENCE = range(3)


class SlabOrders:
    """The orders of one slab under one beam.

    `tau`: thickness [mean free paths]; `mu0`: cosine of the zenith angle of the beam; `phase`: the
    phase function; `albedo`: in [0, 1]; `depths`: depths in [0, tau] where moments are wanted
    besides 0 and tau; `streams`: N, in each hemisphere; `nodes`: of each panel of depth.
    """

    def __init__(
        self,
        tau: float,
        mu0: float,
        phase: SlabPhase,
        albedo: float,
        *,
        depths: Sequence[float] = (),
        streams: int = 64,
        nodes: int = 8,
    ):
        self.mu0 = mu0
        self.streams: Streams = double_gauss(streams)
        # Light along the flattest stream changes most with depth: the panels are as thin as it
        # needs.
        narrowest = min(float(self.streams.mu[0]), mu0) / 2
        self.panels: DepthPanels = depth_panels(tau, narrowest, depths=depths, count=nodes)
        # The beam is a stream of its own, the last, and travels downwards.
        mu = np.append(self.streams.mu, -mu0)
        self._transport = Transport(self.panels, mu)
        self._sines = np.sqrt((1 - mu) * (1 + mu))
        moments = phase.moments(2 * streams + 1)
        peak = float(moments[-1])  # what is left out when P becomes polynomials of degree 2 N - 1
        self.albedo, self.peak, self.moments = albedo, peak, moments[:-1] - peak
        self.scatter = [self._scattering(m).T.copy() for m in (0, 1)]

    def _scattering(self, m: int) -> Array:
        """Return S of one mode as a matrix of streams, the beam last."""
        mu, weights, albedo, moments = (
            self.streams.mu,
            self.streams.weights,
            self.albedo,
            self.moments,
        )
        matrix = np.zeros((mu.size + 1, mu.size + 1))
        matrix[:-1, :-1] = albedo / 2 * mode_kernel(m, moments, mu, mu) * weights
        # From the beam to the streams; nothing but the peak is scattered into the beam.
        matrix[:-1, -1] = (
            albedo / (4 * np.pi) * mode_kernel(m, moments, mu, np.array([-self.mu0]))[:, 0]
        )
        # Light scattered into the peak goes straight on, in every stream.
        return matrix + albedo * self.peak * np.eye(mu.size + 1)

    def beam(self) -> Array:
        """Return the fields of order 0: the beam, which has moved z tan theta_0 at depth z."""
        depths = self.panels.depths
        shift = depths * (self._sines[-1] / self.mu0)
        fields = np.zeros((5, depths.size, self.streams.mu.size + 1))
        fields[:, :, -1] = np.exp(-depths / self.mu0)
        fields[[A0, A1], :, -1] *= shift
        fields[C0, :, -1] *= shift**2
        return fields

    def following(self, fields: Array) -> tuple[Array, Array]:
        """Return the fields of the next order, and its moments at the edges."""
        sources = np.empty_like(fields)
        for m, rows in enumerate(([B0, A0, C0], [B1, A1])):
            # In one product, which is faster than one for each.
            sources[rows] = (fields[rows].reshape(-1, fields.shape[2]) @ self.scatter[m]).reshape(
                sources[rows].shape
            )
        return self._carried(sources)

    def _carried(self, sources: Array) -> tuple[Array, Array]:
        """Return the light of scattered sources, with the displacement it gains on
        the way, and its moments.
        """
        light, lengths = np.empty_like(sources), self._sines
        # Amounts first, then first moments, which gain sin theta times the amount of the other
        # mode, then the second moment, which gains 2 sin theta A_1.
        light[[B0, B1]], (b0_edges, _) = self._transport(sources[[B0, B1]])
        light[[A0, A1]], (a0_edges, _) = self._transport(
            sources[[A0, A1]] + lengths * light[[B1, B0]]
        )
        light[[C0]], (c0_edges,) = self._transport(sources[[C0]] + 2 * lengths * light[[A1]])
        return light, self._edges(np.stack([b0_edges, a0_edges, c0_edges]))

    def _edges(self, values: Array) -> Array:
        """Return fluxes and fluence of (3, P + 1, 2 N + 1) moments."""
        mu, weights = self.streams.mu, self.streams.weights
        # Integrals over all azimuths: 2 pi times the mean mode, with the weights of the streams.
        diffuse, beam = 2 * np.pi * values[..., :-1] * weights, values[..., -1]
        upward = mu > 0
        up = (diffuse[..., upward] * mu[upward]).sum(-1)
        down = (diffuse[..., ~upward] * -mu[~upward]).sum(-1) + self.mu0 * beam
        return np.stack([up, down, diffuse.sum(-1) + beam])

    def rest(self, fields: Array) -> Array:
        """Return the moments of the sum of all orders after the order of `fields`."""
        mean, wave = _AllOrders(self, 0), _AllOrders(self, 1)  # by azimuthal mode
        # As in `_carried`, each moment from the one before, but for all orders after the last one
        # together.
        b0, b1 = mean(fields[B0]), wave(fields[B1])
        a0, a1 = mean(fields[A0], self._sines * b1), wave(fields[A1], self._sines * b0)
        c0 = mean(fields[C0], 2 * self._sines * a1)
        # X are the orders after `fields`, before they are carried: one more order of `fields` + X
        # is the sum of all that follow.
        return self.following(fields + np.stack([b0, b1, a0, a1, c0]))[1]


class _AllOrders:
    """One mode of a slab under a beam, for all orders at once."""

    def __init__(self, slab: SlabOrders, m: int):
        self._scatter = slab.scatter[m]
        self._modes = Eigenmodes(
            slab.streams, m, albedo=slab.albedo, moments=slab.moments, peak=slab.peak
        )
        self._transport = Transport(slab.panels, self._modes.cosines)
        # The beam meets only the peak: its sum of orders fades as if the medium were
        # thinner by what goes on.
        self._passing = 1 - slab.albedo * slab.peak
        self._beam = Transport(slab.panels, np.array([-slab.mu0 / self._passing]))

    def __call__(self, last: Array, gained: Array | float = 0.0) -> Array:
        """Return X = T (S (last + X) + gained), with T the way of light through
        the slab; all (Z, 2 N + 1).
        """
        # The sources of the last order, and what the moments gain on the way.
        source = last @ self._scatter + gained
        beam = self._beam(source[None, :, -1:] / self._passing)[0][0]
        # The beam of all orders scatters into the streams as the streams do among themselves.
        diffuse = source[:, :-1] + beam * self._scatter[-1, :-1]
        return np.concatenate(
            [self._modes.all_orders(self._transport, diffuse[None])[0], beam], axis=-1
        )


def order_sets(slab: SlabOrders, sets: Sequence[tuple[int, float]]) -> tuple[Array, Array]:
    """Return the moments of sets of orders, (sets, 3, 3, P + 1), and of all orders from 1 on.

    `slab`: the slab; `sets`: first and last order of each set, the last one
    `math.inf` for a set without end.
    """
    # As many orders are computed one by one as the sets need ends; all later orders are one sum,
    # the last entry.
    finite = [int(last) for _, last in sets if math.isfinite(last)]
    finite += [first - 1 for first, last in sets if not math.isfinite(last)]
    fields, orders = slab.beam(), []
    for _ in range(max(finite, default=0)):
        fields, edges = slab.following(fields)
        orders.append(edges)
    orders.append(slab.rest(fields))
    # Entry n - 1 of the list is order n; a set without end takes the sum, too.
    ends = [int(last) if math.isfinite(last) else len(orders) for _, last in sets]
    chosen = [sum(orders[first - 1 : end]) for (first, _), end in zip(sets, ends, strict=True)]
    return np.array(chosen), np.asarray(sum(orders))
