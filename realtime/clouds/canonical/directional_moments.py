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

S acts on each mode by itself and is the same for all four fields of a mode, and lines through the
slab are the same for all modes: both are products of matrices, in which the fields of all suns
stand side by side. The equations are linear, so the light of a set in the requested directions
follows, once for each set, from the sum of the fields from which its orders are scattered.

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

#: of what the beam's own peak scatters: its fraction to the sixth power is below rounding
_BEAM_ORDERS = 6
_FEWEST = 2  #: modes that are kept whatever they hold: the mean needs mode 1 for its displacement
_NO_PEAK = 1e-9
#: panel [mean free paths]: low orders fall off by exp(-3) in one, which six nodes hold
_WIDEST = 3.0
_TOGETHER = 2**26  #: numbers of all fields of the suns that are computed together
_NARROWEST = 2e-3  #: of panels [mean free paths]

#: The four fields of a mode, side by side: B_m, A_m, A_{-m}, C_m.
_B, _A, _C = 0, 1, 3


class DirectionalMoments:
    """Slabs of one medium, seen from some directions.

    `phase`, `albedo`: of the medium; `mu`: (V,), cosines of the directions, positive upwards, not
    0; `streams`: N, in each hemisphere; `modes`: the largest mode of the azimuth; `nodes`: of each
    panel of depth; `negligible`: a mode is followed no more where its radiance is below this
    fraction of the mean's everywhere; `single`: whether fields are float32.
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
        self._order = np.concatenate(
            [np.flatnonzero(self.wanted > 0), np.flatnonzero(self.wanted < 0)]
        )
        self._back = np.argsort(self._order)
        self._rule, self._nodes, self._negligible = rule, nodes, negligible
        self._type = np.float32 if single else np.float64
        self._views = self.wanted[self._order]
        moments = phase.moments(2 * streams + 1)
        self._albedo, self._peak = albedo, float(moments[-1])
        self._kept = moments[:-1] - self._peak
        self._count = modes + 1

        def kernels(to: Array, chi: Array) -> list[Array]:
            every = (
                albedo / 2 * mode_kernel(m, chi, to, rule.mu) * rule.weights
                for m in range(modes + 1)
            )
            return [kernel.astype(self._type) for kernel in every]

        on = (albedo * self._peak * np.eye(2 * streams)).astype(self._type)
        self._between = [kernel + on for kernel in kernels(rule.mu, self._kept)]
        self._sharp, self._smooth = (
            kernels(self._views, self._kept),
            kernels(self._views, moments[:-1]),
        )
        self._eigenmodes: dict[int, Eigenmodes] = {}

    def __call__(self, tau: float, suns: ArrayLike, depths: Sequence[float]) -> Array:
        """Return the modes of a slab's light.

        `tau`: thickness [mean free paths]; `suns`: (L,), cosines of the zenith angles of suns, each
        of which shines alone; `depths`: (D,), in [0, tau] [mean free paths]. Returns `ndarray`:
        (sets, modes + 1, 4, L, D, V): B_m [1/sr], A_m, A_{-m}, C_m for unit flux across the beam.
        """
        cosines = np.atleast_1d(np.asarray(suns, dtype=np.float64))
        run = _Run(self, tau, depths, lowest=float(cosines.min()))
        together = max(
            1, int(_TOGETHER / (run.panels.depths.size * self._rule.mu.size * 4 * self._count))
        )
        parts = [cosines[start : start + together] for start in range(0, cosines.size, together)]
        return np.concatenate([self._under(run, part) for part in parts], axis=3)[..., self._back]

    def _under(self, run: "_Run", suns: Array) -> Array:
        """Return the modes under some suns; directions in the order of this class."""
        run.shine(suns)
        modes = np.zeros((len(SETS), self._count, 4, suns.size, run.wanted, self._back.size))
        # Order 1 in the wanted directions, of which the peak passes some on
        first, _ = run.following(
            run.views, [run.from_beam(self._views, m, 1) for m in range(self._count)]
        )
        fields, _ = run.following(
            run.streams, [run.from_beam(self._rule.mu, m, 1) for m in range(self._count)]
        )
        order = 1
        for number, (_, last) in enumerate(SETS[:-1]):
            given: list[Array] = []
            beams = np.arange(order + 1, int(last) + 1)
            while order < last:
                order += 1
                given = [
                    field + before
                    for field, before in zip(fields, [*given, *[0] * (len(fields) - len(given))])
                ] + given[len(fields) :]
                sources = [
                    np.matmul(self._between[m], field) + run.from_beam(self._rule.mu, m, order)
                    for m, field in enumerate(fields)
                ]
                fields, _ = run.following(run.streams, sources)
                fields = fields[: self._still_needed(fields)]
            kernels = self._sharp if last == SETS[0][1] else self._smooth
            sources = [np.matmul(kernels[m], field) for m, field in enumerate(given)]
            for m, source in enumerate(sources):
                for beam in beams:
                    source += run.from_beam(self._views, m, int(beam))
                if last == SETS[0][1]:
                    source += self._albedo * self._peak * first[m]
            _, edges = run.following(run.views, sources, inside=False)
            for m, edge in enumerate(edges):
                modes[number, m] = edge
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
        suns = fields[0].shape[-1] // 4
        largest = np.maximum(np.abs(fields[0][..., :suns]).max(2), 1e-30)
        count = len(fields)
        while count > _FEWEST:
            fraction = np.abs(fields[count - 1][..., :suns]).max(2) / largest
            if fraction.max() >= self._negligible:
                break
            count -= 1
        return count

    def _modes(self, m: int) -> Eigenmodes:
        if m not in self._eigenmodes:
            self._eigenmodes[m] = Eigenmodes(
                self._rule, m, albedo=self._albedo, moments=self._kept, peak=self._peak
            )
        return self._eigenmodes[m]


class _Lines(Transport):
    """Straight lines through the panels of a slab along some cosines, first those that go up."""

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
        self.slab, self.tau, self.wanted = slab, tau, len(depths)
        smallest = min(float(np.abs(slab._views).min()), float(slab._rule.mu[0]), lowest)
        narrowest = max(smallest, _NARROWEST)
        self.panels = depth_panels(tau, narrowest, depths=depths, count=slab._nodes, widest=_WIDEST)
        self._places = [int(np.argmin(np.abs(self.panels.edges - depth))) for depth in depths]
        self.streams, self.views = (
            _Lines(self.panels, mu, slab._type) for mu in (slab._rule.mu, slab._views)
        )

    def shine(self, suns: Array) -> None:
        """Light the slab by some suns."""
        self.suns = suns
        slant = self.panels.nodes[..., None] / suns
        self._slant, self._flux = slant, np.exp(-slant)
        shift = slant * np.sqrt((1 - suns) * (1 + suns))
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
        if order > _BEAM_ORDERS or (order > 1 and abs(slab._peak) < _NO_PEAK):
            return np.zeros(1, slab._type)
        times = order - 1
        strength = (
            self._flux * (slab._albedo * slab._peak * self._slant) ** times / math.factorial(times)
        )
        scattered = slab._albedo / (4 * np.pi) * mode_kernel(m, slab._kept, mu, -self.suns)
        beam = np.tile(strength, 4) * self._shifts
        return beam.astype(slab._type)[:, :, None] * np.tile(scattered, 4).astype(slab._type)

    def following(
        self, lines: _Lines, sources: Sequence[Array], *, inside: bool = True
    ) -> tuple[list[Array], list[Array]]:
        """Return the light of scattered sources by mode, with the displacement
        that it gains on the way.

        Returns `fields`, `edges`: by mode: at the nodes where they are wanted, and (4, L, D,
        J) at the wanted depths.
        """
        suns, count = len(self.suns), len(sources)
        b, b_edges = self._carried(
            lines, [source[..., self._fields(_B)] for source in sources], inside=True
        )
        raised = []
        for m, source in enumerate(sources):
            gain = source[..., self._fields(_A)]
            if abs(m - 1) < count:
                gain[..., :suns] += lines.sines * b[abs(m - 1)]
            if m + 1 < count:
                gain[..., suns:] += lines.sines * b[m + 1]
            raised.append(gain)
        a, a_edges = self._carried(lines, raised, inside=True)
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
            together = np.concatenate(parts, axis=-1)
            edges.append(together.reshape(*together.shape[:2], 4, suns).transpose(2, 3, 0, 1))
        return fields, edges

    def _carried(
        self, lines: _Lines, sources: Sequence[Array], *, inside: bool
    ) -> tuple[list[Array], list[Array]]:
        """Return the radiance of the sources of all modes, at nodes and at the wanted depths."""
        ends = np.cumsum([source.shape[-1] for source in sources])[:-1]
        at_nodes, at_depths = lines.sweep(
            np.concatenate(sources, axis=-1), self._places, inside=inside
        )
        return np.split(at_nodes, ends, axis=-1), np.split(at_depths, ends, axis=-1)

    def rest(self, fields: Sequence[Array]) -> list[Array]:
        """Return the sum of these fields and of all that follow."""
        slab, suns = self.slab, len(self.suns)
        sines = self.streams.sines[:, 0].astype(np.float64)
        last = [
            np.moveaxis(field, -1, 0).astype(np.float64).reshape(4 * suns, -1, sines.size)
            for field in fields
        ]
        count = len(last)
        b, a, c = ([field[self._fields(name)] for field in last] for name in (_B, _A, _C))
        b = [field + self._all_orders(m, field, 0.0) for m, field in enumerate(b)]
        for m in range(count):
            gain = np.zeros_like(a[m])
            # Fields of the last order have had their gain; what follows gains from what follows.
            if abs(m - 1) < count:
                gain[:suns] += sines * (b[abs(m - 1)] - last[abs(m - 1)][self._fields(_B)])
            if m + 1 < count:
                gain[suns:] += sines * (b[m + 1] - last[m + 1][self._fields(_B)])
            a[m] = a[m] + self._all_orders(m, a[m], gain)
        later = [
            np.moveaxis(total - field[self._fields(_A)], 0, -1)
            for total, field in zip(a, last, strict=True)
        ]
        for m in range(count):
            gain = sines * np.moveaxis(_neighbours(later, m, suns), -1, 0)
            c[m] = c[m] + self._all_orders(m, c[m], gain)
        panels, nodes = self.panels.nodes.shape
        shape = (4 * suns, panels, nodes, sines.size)
        totals = [
            np.moveaxis(np.concatenate(parts).reshape(shape), 0, -1)
            for parts in zip(b, a, c, strict=True)
        ]
        return [np.ascontiguousarray(total.astype(slab._type)) for total in totals]

    def _all_orders(self, m: int, last: Array, gain: Array | float) -> Array:
        """Return X = T (S (last + X) + gain) of one mode, (F, Z, 2 N), with T the way
        of light through the slab.
        """
        modes = self.slab._modes(m)
        kernel = self.slab._between[m].astype(np.float64)
        return modes.all_orders(Transport(self.panels, modes.cosines), last @ kernel.T + gain)


def _neighbours(a: Sequence[Array], m: int, suns: int) -> Array:
    """Return A_{m+1} + A_{-(m-1)}, of fields A_m and A_{-m} of all suns along the last axis."""
    above: Array = a[m + 1][..., :suns] if m + 1 < len(a) else np.zeros(1)
    if m == 0:
        return above + above  # A_{-(m-1)} is A_1
    return above + (a[m - 1][..., suns:] if m > 1 else a[0][..., :suns])
