# SPDX-License-Identifier: BSD-3-Clause
"""What leaves a slab and what is inside, by sets of orders, with an estimate of the error of every number.

The computation runs twice, the second time with three quarters of the streams and two nodes fewer in each panel of
depth. The change is the error that is printed: it is that of the coarser run, so the printed numbers are better.

Definitions: order n is light that was scattered n times. Lengths are in mean free paths. A displacement is measured
from the point of entry, horizontally; `mean` is its mean along the horizontal direction in which the sun's light
travels, `rms` the root of the mean of x^2 + y^2, both weighted with the flux (or fluence). The spread of one axis about
the mean, the sigma of Bouthors 2008, is sqrt((rms^2 - mean^2)/2).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from realtime.clouds.slab_orders.phases import SlabPhase
from validation.slab.moments import Edges, SlabOrders, order_sets
from validation.slab.radiance import slab_radiance

Array = NDArray[np.float64]

#: Streams in each hemisphere: the first of these that leaves less than `_RESOLVED` of the phase function to the peak.
STREAMS = (64, 96, 128)
_RESOLVED = 1e-4
_NODES = 8


@dataclass(frozen=True)
class Exit:
    """Light of some orders that crosses a plane.

    Parameters
    ----------
    value
        Share of the flux that enters the slab, or fluence for unit flux across the beam [1].
    mean, rms
        Of the displacement from the point of entry [mean free paths]; None where there is no light.
    """

    value: float
    mean: float | None
    rms: float | None


@dataclass(frozen=True)
class OrderSet:
    """Light of one set of orders: what is reflected, what is transmitted, and the fluence at each depth."""

    reflected: Exit
    transmitted: Exit
    fluence: tuple[Exit, ...]


@dataclass(frozen=True)
class SlabLight:
    """All light of a slab.

    Parameters
    ----------
    sets
        One for each set of orders.
    reflectance, transmittance
        Of all orders; the transmittance includes the light that was never scattered.
    up, down
        Diffuse flux at each depth for a flux of pi across the beam.
    radiance
        (depths, directions), diffuse, for a flux of pi across the beam [1/sr].
    """

    sets: tuple[OrderSet, ...]
    reflectance: float
    transmittance: float
    up: tuple[float, ...]
    down: tuple[float, ...]
    radiance: Array


def slab_light(
    tau: float,
    mu0: float,
    phase: SlabPhase,
    albedo: float,
    *,
    sets: Sequence[tuple[int, float]],
    depths: Sequence[float] = (),
    directions: Sequence[tuple[float, float]] = (),
) -> tuple[SlabLight, SlabLight]:
    """Return the light of a slab, and the same with less effort: the difference is an estimate of the error.

    `tau`: thickness [mean free paths], positive; `mu0`: cosine of the zenith angle of the sun, in (0, 1]; `phase`,
    `albedo`: of the medium; the albedo in [0, 1]; `sets`: first and last order of each set, the last `math.inf` for a
    set without end; `depths`: in [0, tau], where fluence, flux and radiance are wanted; `directions`: mu, positive
    upwards, not 0, and phi [rad], 0 along the horizontal direction of the sun's light.
    """
    streams = needed_streams(phase)

    def light(count: int, nodes: int) -> SlabLight:
        return _slab_light(
            tau, mu0, phase, albedo, sets=sets, depths=depths, directions=directions, streams=count, nodes=nodes
        )

    return light(streams, _NODES), light(3 * streams // 4, _NODES - 2)


def needed_streams(phase: SlabPhase) -> int:
    """Return how many streams in each hemisphere a phase function needs."""
    moments = np.abs(phase.moments(2 * STREAMS[-1] + 1))
    return next((count for count in STREAMS if moments[2 * count] < _RESOLVED), STREAMS[-1])


def _slab_light(
    tau: float,
    mu0: float,
    phase: SlabPhase,
    albedo: float,
    *,
    sets: Sequence[tuple[int, float]],
    depths: Sequence[float],
    directions: Sequence[tuple[float, float]],
    streams: int,
    nodes: int,
) -> SlabLight:
    slab = SlabOrders(tau, mu0, phase, albedo, depths=depths, streams=streams, nodes=nodes)
    chosen, total = order_sets(slab, sets)
    places = [int(np.argmin(np.abs(slab.panels.edges - depth))) for depth in depths]
    radiance = np.zeros((len(depths), len(directions)))
    if radiance.size:
        radiance = np.pi * slab_radiance(
            tau, mu0, phase, albedo, depths=depths, directions=directions, streams=streams, nodes=nodes
        )
    return SlabLight(
        sets=tuple(_order_set(edges, mu0, places) for edges in chosen),
        reflectance=float(total.up[0, 0]) / mu0,
        transmittance=float(total.down[0, -1]) / mu0 + math.exp(-tau / mu0),
        up=tuple(np.pi * total.up[0, places]),
        down=tuple(np.pi * total.down[0, places]),
        radiance=radiance,
    )


def _order_set(edges: Edges, mu0: float, places: Sequence[int]) -> OrderSet:
    return OrderSet(
        reflected=_exit(edges.up[:, 0], mu0),
        transmitted=_exit(edges.down[:, -1], mu0),
        fluence=tuple(_exit(edges.fluence[:, place], 1.0) for place in places),
    )


def _exit(moments: Array, unit: float) -> Exit:
    amount, first, second = (float(moment) for moment in moments)
    if amount <= 0.0:
        return Exit(0.0, None, None)
    return Exit(amount / unit, first / amount, math.sqrt(max(second / amount, 0.0)))
