# SPDX-License-Identifier: BSD-3-Clause
"""Radiance of a slab in any direction by sets of orders, with the moments of its
displacement from the entry.

Each order obeys, with M0 the radiance, D = x + i y the horizontal
displacement, M1 = <D I>, M2 = <|D|^2 I> and w = sin theta exp(i phi),

    dM0/ds = -M0 + S[M0'],   dM1/ds = -M1 + S[M1'] + w M0,   dM2/ds = -M2 + S[M2'] + 2 Re(conj(w) M1),

primes for the order before. Fluxes need two modes of the azimuth; radiance needs them all. In modes

    M0 = sum_m B_m e^{i m phi},   M1 = sum_m A_m e^{i m phi},   M2 = sum_m C_m e^{i m phi},

all real, since nothing changes under y -> -y; M0 and M2 are real, hence B_{-m} = B_m and C_{-m} =
C_m, and A is not symmetric. w raises a mode by one, conj(w) lowers it, and conj(M1) has the modes
A_{-m}, so that for m >= 0

    A_m gains sin theta B_{|m-1|},   A_{-m} gains sin theta B_{m+1},   C_m gains sin theta (A_{m+1} + A_{-(m-1)}).

S acts on each mode by itself and is the same for all four fields of a mode. Lines through the slab
are the same for all modes. Both are products of matrices, in which the fields of all suns stand
side by side. The equations are linear: the fields from which the orders of a set are scattered are
added up, and one scattering of the sum gives the light of the set in the requested directions.

The sum of all orders above the last finite one obeys the same equations with S[M'] + S[M] and is
solved for directly, mode by mode (`realtime.clouds.slab_orders.discrete_ordinates`).

The part of the phase function that the streams cannot resolve is treated as a forward peak of the
fraction f (delta-M). Light of order 1 is sharp, and the peak carries it unchanged into order 2;
later orders are smooth, and the light in a requested direction uses the moments of the phase
function itself, without a peak.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airlight.realtime.clouds.canonical.coordinates import SETS
from airlight.realtime.clouds.slab_orders.depth_panels import DepthPanels, Transport, depth_panels
from airlight.realtime.clouds.slab_orders.discrete_ordinates import (
    Eigenmodes,
    double_gauss,
    mode_kernel,
)
from airlight.realtime.clouds.slab_orders.phases import SlabPhase

Array = NDArray[Any]  # float32 or float64

#: The four fields of a mode, side by side: B_m, A_m, A_{-m}, C_m.
_B, _A, _C = 0, 1, 3


class DirectionalMoments:
    """Slabs of one medium, seen from some directions.

    `phase`, `albedo`: of the medium; `mu`: (V,), cosines of the directions, positive upwards, not
    0; `streams`: N, in each hemisphere; `modes`: the largest mode of the azimuth; `nodes`: of each
    panel of depth; `negligible`: a mode is dropped when its radiance is everywhere below this
    fraction of the radiance of mode 0; `single`: whether fields are float32.
    """

    def __init__(
        self,
        phase: SlabPhase,
        albedo: float,
        mu: ArrayLike,
        *,
        streams: int = 32,
        modes: int = 24,
        nodes: int = 5,
        negligible: float = 3e-4,
        single: bool = True,
    ):
        rule = double_gauss(streams)
        self.wanted: Array = np.asarray(mu, dtype=np.float64)
        # Upward directions are computed first; `_back` restores the order of the caller.
        self._order = np.concatenate(
            [np.flatnonzero(self.wanted > 0), np.flatnonzero(self.wanted < 0)]
        )
        self._back = np.argsort(self._order)
        self._rule, self._nodes, self._negligible = rule, nodes, negligible
        self._type = np.float32 if single else np.float64
        self._views = self.wanted[self._order]
        # f = chi_{2N} is the peak, and chi_l - f are the moments that the streams resolve.
        moments = phase.moments(2 * streams + 1)
        self._albedo, self._peak = albedo, float(moments[-1])
        self._resolved = moments[:-1] - self._peak
        self._count = modes + 1

        # The scattering from the streams into some directions, by mode: albedo/2 K_m, and the
        # weights.
        def kernels(to: Array, chi: Array) -> list[Array]:
            every = (
                albedo / 2 * mode_kernel(m, chi, to, rule.mu) * rule.weights
                for m in range(modes + 1)
            )
            return [kernel.astype(self._type) for kernel in every]

        # Light that meets the peak goes on in its stream.
        onward = (albedo * self._peak * np.eye(2 * streams)).astype(self._type)
        self._between = [kernel + onward for kernel in kernels(rule.mu, self._resolved)]
        # Into the requested directions: without the peak, which passes order 1 on as it is, and
        # with all moments, for smooth light.
        self._sharp, self._smooth = (
            kernels(self._views, self._resolved),
            kernels(self._views, moments[:-1]),
        )
        self._eigenmodes: dict[int, Eigenmodes] = {}

    def __call__(self, tau: float, suns: ArrayLike, depths: Sequence[float]) -> Array:
        """Return the modes of a slab's light.

        `tau`: thickness [mean free paths]; `suns`: (L,), cosines of the zenith angles of suns, each
        alone; `depths`: (D,), in [0, tau] [mean free paths]. Returns `ndarray`: (sets, modes + 1,
        4, L, D, V): B_m [1/sr], A_m, A_{-m}, C_m for unit flux across the beam.
        """
        cosines = np.atleast_1d(np.asarray(suns, dtype=np.float64))
        run = _Run(self, tau, depths, lowest=float(cosines.min()))
        # As many suns at once as fields of 2^26 numbers hold: four fields of each mode at all nodes
        # and streams.
        numbers = 2**26
        together = max(
            1, int(numbers / (run.panels.depths.size * self._rule.mu.size * 4 * self._count))
        )
        parts = [cosines[start : start + together] for start in range(0, cosines.size, together)]
        return np.concatenate([self._under(run, part) for part in parts], axis=3)[..., self._back]

    def _under(self, run: "_Run", suns: Array) -> Array:
        """Return the modes under some suns; directions in the order of this class."""
        run.shine(suns)
        modes = np.zeros((len(SETS), self._count, 4, suns.size, run.depth_count, self._back.size))
        # Order 1 in the requested directions, a part of which the peak passes on to order 2.
        first, _ = run.following(
            run.views, [run.from_beam(self._views, m, 1) for m in range(self._count)]
        )
        # Order 1 in the streams, from which order 2 is scattered.
        fields, _ = run.following(
            run.streams, [run.from_beam(self._rule.mu, m, 1) for m in range(self._count)]
        )
        order = 1
        # All sets but the last, order after order.
        for number, (_, last) in enumerate(SETS[:-1]):
            # By mode, the sum of the fields from which the orders of the set are scattered.
            scattered_from: list[Array] = []
            # The beam has a part in every order: the peak may have scattered it before, without a
            # turn.
            beams = np.arange(order + 1, int(last) + 1)
            while order < last:
                order += 1
                # Modes are dropped from order to order: the sum of a dropped one stays as it is.
                scattered_from = [
                    field + before
                    for field, before in zip(
                        fields, [*scattered_from, *[0] * (len(fields) - len(scattered_from))]
                    )
                ] + scattered_from[len(fields) :]
                sources = [
                    np.matmul(self._between[m], field) + run.from_beam(self._rule.mu, m, order)
                    for m, field in enumerate(fields)
                ]
                fields, _ = run.following(run.streams, sources)
                # High modes die out after a few scatterings.
                fields = fields[: self._still_needed(fields)]
            # One scattering of the sum into the requested directions. Only the light of order 1 is
            # sharp, so only order 2 has the peak apart.
            kernels = self._sharp if last == SETS[0][1] else self._smooth
            sources = [np.matmul(kernels[m], field) for m, field in enumerate(scattered_from)]
            for m, source in enumerate(sources):
                for beam in beams:
                    source += run.from_beam(self._views, m, int(beam))
                if last == SETS[0][1]:
                    source += self._albedo * self._peak * first[m]
            _, edges = run.following(run.views, sources, inside=False)
            for m, edge in enumerate(edges):
                modes[number, m] = edge
        # The set without end: all that follows the last order of the finite sets.
        rest = run.rest(fields)
        sources = [np.matmul(self._smooth[m], field) for m, field in enumerate(rest)]
        _, edges = run.following(run.views, sources, inside=False)
        for m, edge in enumerate(edges):
            modes[-1, m] = edge
        return modes

    def _still_needed(self, fields: Sequence[Array]) -> int:
        """Return how many modes hold something, of (P, K, 2 N, 4 L) each:
        at any node, for any sun.
        """
        # Two modes are needed whatever they hold: the mean takes mode 1 for its displacement.
        fewest = 2
        suns = fields[0].shape[-1] // 4
        # The fields B alone, and of each node and sun the largest radiance over the directions.
        largest = np.maximum(np.abs(fields[0][..., :suns]).max(2), 1e-30)
        count = len(fields)
        while count > fewest:
            fraction = np.abs(fields[count - 1][..., :suns]).max(2) / largest
            if fraction.max() >= self._negligible:
                break
            count -= 1
        return count

    def _modes(self, m: int) -> Eigenmodes:
        if m not in self._eigenmodes:
            self._eigenmodes[m] = Eigenmodes(
                self._rule, m, albedo=self._albedo, moments=self._resolved, peak=self._peak
            )
        return self._eigenmodes[m]


class _Lines(Transport):
    """Straight lines through the panels of a slab along some cosines, upward lines first."""

    def __init__(self, panels: DepthPanels, mu: Array, number: type):
        super().__init__(panels, mu, number)
        self.sines = np.sqrt((1 - mu) * (1 + mu))[:, None].astype(number)


class _Run:
    """One thickness under some suns. Fields are (P, K, J, 4 L): panels, nodes,
    directions, and the four by sun.
    """

    def __init__(
        self, slab: DirectionalMoments, tau: float, depths: Sequence[float], *, lowest: float
    ):
        self.slab, self.tau, self.depth_count = slab, tau, len(depths)
        smallest = min(float(np.abs(slab._views).min()), float(slab._rule.mu[0]), lowest)
        # Radiance changes at the boundaries over the smallest cosine, of directions, streams and
        # suns, or over this many mean free paths.
        narrowest = max(smallest, 2e-3)
        # Low orders fall off by exp(-3) in a panel of three mean free paths.
        self.panels = depth_panels(tau, narrowest, depths=depths, count=slab._nodes, widest=3.0)
        self._places = [int(np.argmin(np.abs(self.panels.edges - depth))) for depth in depths]
        self.streams, self.views = (
            _Lines(self.panels, mu, slab._type) for mu in (slab._rule.mu, slab._views)
        )

    def shine(self, suns: Array) -> None:
        """Light the slab by some suns."""
        self.suns = suns
        # The way of the beam to each node, its flux there, and its displacement sideways.
        slant = self.panels.nodes[..., None] / suns
        self._slant, self._flux = slant, np.exp(-slant)
        shift = slant * np.sqrt((1 - suns) * (1 + suns))
        # D of the light that the beam scatters is its displacement: the fields are 1, D, D and D^2
        # times its flux.
        self._shifts = np.concatenate([np.ones_like(shift), shift, shift, shift**2], axis=-1)

    def _fields(self, name: int) -> slice:
        """Return where the fields B, A (both) or C of all suns stand."""
        suns = len(self.suns)
        return slice(name * suns, (name + (2 if name == _A else 1)) * suns)

    def from_beam(self, mu: Array, m: int, order: int) -> Array:
        """Return the light of the beam in an order: the peak has scattered the
        beam order - 1 times before.
        """
        slab = self.slab
        # This much of the beam's light counts as none: a sharp phase function keeps half of it in
        # the peak, and thirty scatterings in the peak are then possible.
        times, no_light = order - 1, 1e-9
        if abs(slab._peak) ** times < no_light:
            return np.zeros(1, slab._type)
        # Poisson's distribution: n scatterings in the peak over the way s have (albedo f s)^n/n!
        # exp(-s).
        strength = (
            self._flux * (slab._albedo * slab._peak * self._slant) ** times / math.factorial(times)
        )
        # Then the light leaves the beam by the rest of the phase function, albedo/(4 pi) K_m(mu,
        # -mu_L).
        scattered = slab._albedo / (4 * np.pi) * mode_kernel(m, slab._resolved, mu, -self.suns)
        beam = np.tile(strength, 4) * self._shifts
        return beam.astype(slab._type)[:, :, None] * np.tile(scattered, 4).astype(slab._type)

    def following(
        self, lines: _Lines, sources: Sequence[Array], *, inside: bool = True
    ) -> tuple[list[Array], list[Array]]:
        """Return the light of scattered sources by mode, with the displacement
        that it gains on the way.

        Returns `fields`, `edges`: by mode, at the nodes where `inside` asks for them, and (4, L, D,
        J) at the requested depths. The gains are added to `sources` in place.
        """
        suns, count = len(self.suns), len(sources)
        # B first: A gains from the B of the same order, and C from its A.
        b, b_edges = self._carried(
            lines, [source[..., self._fields(_B)] for source in sources], inside=True
        )
        # A_m gains sin theta B_{|m-1|}, A_{-m} gains sin theta B_{m+1}; modes beyond the last are
        # 0.
        raised = []
        for m, source in enumerate(sources):
            gain = source[..., self._fields(_A)]
            if abs(m - 1) < count:
                gain[..., :suns] += lines.sines * b[abs(m - 1)]
            if m + 1 < count:
                gain[..., suns:] += lines.sines * b[m + 1]
            raised.append(gain)
        a, a_edges = self._carried(lines, raised, inside=True)
        # C_m gains sin theta (A_{m+1} + A_{-(m-1)}).
        lowered = []
        for m, source in enumerate(sources):
            gain = source[..., self._fields(_C)]
            gain += lines.sines * _neighbours(a, m, suns)
            lowered.append(gain)
        c, c_edges = self._carried(lines, lowered, inside=inside)
        fields = (
            [np.concatenate(parts, axis=-1) for parts in zip(b, a, c, strict=True)]
            if inside
            else []
        )
        edges = []
        for parts in zip(b_edges, a_edges, c_edges, strict=True):
            four = np.concatenate(parts, axis=-1)
            edges.append(four.reshape(*four.shape[:2], 4, suns).transpose(2, 3, 0, 1))
        return fields, edges

    def _carried(
        self, lines: _Lines, sources: Sequence[Array], *, inside: bool
    ) -> tuple[list[Array], list[Array]]:
        """Return the radiance of the sources of all modes, at nodes and at the requested depths."""
        ends = np.cumsum([source.shape[-1] for source in sources])[:-1]
        at_nodes, at_depths = lines.sweep(
            np.concatenate(sources, axis=-1), self._places, inside=inside
        )
        return np.split(at_nodes, ends, axis=-1), np.split(at_depths, ends, axis=-1)

    def rest(self, fields: Sequence[Array]) -> list[Array]:
        """Return the sum of these fields and of all that follow."""
        slab, suns = self.slab, len(self.suns)
        sines = self.streams.sines[:, 0].astype(np.float64)
        # The fields of the last order as `Eigenmodes` takes them, in float64: (4 L, nodes,
        # directions).
        last_order = [
            np.moveaxis(field, -1, 0).astype(np.float64).reshape(4 * suns, -1, sines.size)
            for field in fields
        ]
        count = len(last_order)
        b, a, c = ([field[self._fields(name)] for field in last_order] for name in (_B, _A, _C))
        # Totals over the last order and all that follow it; B has no gain.
        b = [field + self._all_orders(m, field, 0.0) for m, field in enumerate(b)]
        for m in range(count):
            gain = np.zeros_like(a[m])
            # Fields of the last order have had their gain. Later orders gain from later orders.
            if abs(m - 1) < count:
                gain[:suns] += sines * (b[abs(m - 1)] - last_order[abs(m - 1)][self._fields(_B)])
            if m + 1 < count:
                gain[suns:] += sines * (b[m + 1] - last_order[m + 1][self._fields(_B)])
            a[m] = a[m] + self._all_orders(m, a[m], gain)
        # C gains from A less the last order, for the same reason.
        later = [
            np.moveaxis(total - field[self._fields(_A)], 0, -1)
            for total, field in zip(a, last_order, strict=True)
        ]
        for m in range(count):
            gain = sines * np.moveaxis(_neighbours(later, m, suns), -1, 0)
            c[m] = c[m] + self._all_orders(m, c[m], gain)
        # Back to the shape of fields, (P, K, J, 4 L).
        panels, nodes = self.panels.nodes.shape
        shape = (4 * suns, panels, nodes, sines.size)
        totals = [
            np.moveaxis(np.concatenate(parts).reshape(shape), 0, -1)
            for parts in zip(b, a, c, strict=True)
        ]
        return [np.ascontiguousarray(total.astype(slab._type)) for total in totals]

    def _all_orders(self, m: int, fields: Array, gain: Array | float) -> Array:
        """Return X = T (S (last + X) + gain) of one mode, (F, Z, 2 N), with T the way
        of light through the slab.
        """
        # T of S last + gain, with all that S scatters again: the equation that `Eigenmodes` solves
        # at once.
        modes = self.slab._modes(m)
        kernel = self.slab._between[m].astype(np.float64)
        return modes.all_orders(Transport(self.panels, modes.cosines), fields @ kernel.T + gain)


def _neighbours(a: Sequence[Array], m: int, suns: int) -> Array:
    """Return A_{m+1} + A_{-(m-1)}, of fields A_m and A_{-m} of all suns along the last axis."""
    above: Array = a[m + 1][..., :suns] if m + 1 < len(a) else np.zeros(1)
    if m == 0:
        return above + above  # A_{-(m-1)} is A_1
    return above + (a[m - 1][..., suns:] if m > 1 else a[0][..., :suns])
