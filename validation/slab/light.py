# SPDX-License-Identifier: BSD-3-Clause
"""The numbers of a slab by name, as JSON has them: deterministic with their errors, and by photons.

    {"tau", "sun", "albedo", "phase", **light, "error": light, "photons": None or {"count", "seed", **light,
     "standard_error": light}}
    light = {"orders": [{"orders", "reflectance", "transmittance", "reflected_mean", "reflected_rms",
                         "transmitted_mean", "transmitted_rms", "fluence": [{"depth", "value", "mean", "rms"}]}],
             "total": {"reflectance", "transmittance", "flux": [{"depth", "up", "down"}],
                       "radiance": [{"depth", "mu", "phi", "value"}]}}

Each number of `error` and `standard_error` is the error of the same number of the light, None
where it is not known.

The computation runs twice, the second time with three quarters of the streams and two nodes fewer
in each panel of depth. The change is the error that is printed. It belongs to the coarser run, so
the printed numbers are better.

Definitions: order n is light that was scattered n times. Lengths are in mean free paths.
Reflectance and transmittance are fractions of the flux that enters the slab, the transmittance of
all orders with the light that was never scattered; the fluence is that for unit flux across the
beam, flux and radiance are diffuse, for a flux of pi. A displacement is measured from the point of
entry, horizontally; `mean` is its mean along the horizontal direction in which the sun's light
travels, `rms` the root of the mean of x^2 + y^2, both weighted with the flux (or fluence), None
where there is no light. The spread of one axis about the mean, the sigma of Bouthors 2008, is
sqrt((rms^2 - mean^2)/2).
"""

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from airlight.realtime.clouds.slab_orders.phases import SlabPhase
from airlight.reference.monte_carlo.slab_walk.estimates import SlabEstimate, slab_estimate
from airlight.reference.monte_carlo.slab_walk.walk import Slab
from airlight.validation.arrays import Array, Progress
from airlight.validation.columns import plain
from airlight.validation.slab.moments import DOWN, FLUENCE, UP, SlabOrders, order_sets
from airlight.validation.slab.radiance import slab_radiance
from airlight.validation.slab.request import SlabRequest

# light through a plane: amount, mean and rms displacement
Exit = tuple[float | None, float | None, float | None]

#: Numbers by name as above, in dictionaries and lists; None where one is unknown.
Numbers = dict[str, "Part"]
Part = float | str | None | list["Part"] | Numbers

#: Streams in each hemisphere: the first of these that leaves less than 1e-4 of the phase function
#: to the peak.
STREAMS = (64, 96, 128)
#: Keys of a row that identify it and are no numbers of the light.
_IDENTITY = ("orders", "depth", "mu", "phi")


def slab_numbers(
    request: SlabRequest, *, photons: int = 0, seed: int = 0, progress: Progress | None = None
) -> dict[str, Any]:
    """Return all numbers of a slab, see the module; None where one is unknown, such as the mean
    place of no light.
    """
    report = progress or (lambda fraction, what: None)
    report(0.0, "orders")
    streams = needed_streams(request.phase.deterministic)
    # The second run is coarser, and its change is the error of the first.
    nodes = 8
    fine = _numbers(request, streams, nodes)
    coarse = _numbers(request, 3 * streams // 4, nodes - 2)
    numbers: Numbers = {
        "tau": request.tau,
        "sun": request.sun,
        "albedo": request.albedo,
        "phase": request.phase.name,
        **fine,
        "error": _differences(fine, coarse),
        "photons": None,
    }
    if photons:
        # Photons are the other side: another code, with the errors of samples.
        slab = Slab(
            request.tau, request.mu0, request.albedo, request.phase.sampled(), request.depths
        )
        estimate = slab_estimate(slab, request.ranges, photons=photons, seed=seed, progress=report)
        numbers["photons"] = {
            "count": photons,
            "seed": seed,
            **_estimated(request, estimate, 0),
            "standard_error": _estimated(request, estimate, 1),
        }
    report(1.0, "done")
    json_numbers: dict[str, Any] = plain(numbers)
    return json_numbers


def expected_seconds(request: SlabRequest, photons: int) -> float:
    """Return about how long photons take on one thread [s]."""
    # A photon scatters about 3 + 2 tau times before it leaves, unless it is absorbed before.
    scatterings = min(3 + 2 * request.tau, 30 / max(1 - request.albedo, 1e-9))
    # A scattering of a photon takes 0.4e-6 s, measured on one thread of an AMD EPYC.
    return photons * scatterings * 0.4e-6


def needed_streams(phase: SlabPhase) -> int:
    """Return how many streams in each hemisphere a phase function needs."""
    # N streams in each hemisphere resolve 2 N moments of the phase function; the next moment is the
    # fraction that is left to the peak.
    moments = np.abs(phase.moments(2 * STREAMS[-1] + 1))
    return next((count for count in STREAMS if moments[2 * count] < 1e-4), STREAMS[-1])


def _numbers(request: SlabRequest, streams: int, nodes: int) -> Numbers:
    """Return the light of a slab, computed with so many streams in each hemisphere and nodes in
    each panel of depth.
    """
    medium = request.tau, request.mu0, request.phase.deterministic, request.albedo
    slab = SlabOrders(*medium, depths=request.depths, streams=streams, nodes=nodes)
    chosen, total = order_sets(slab, request.ranges)
    # The panels of depth end at the depths that were asked for; the nearest edge is the one.
    places = [int(np.argmin(np.abs(slab.panels.edges - depth))) for depth in request.depths]
    orders: list[Part] = [
        _order_row(
            name,
            request.depths,
            _exit(edges[UP, :, 0], request.mu0),
            _exit(edges[DOWN, :, -1], request.mu0),
            (_exit(edges[FLUENCE, :, place], 1.0) for place in places),
        )
        for name, edges in zip(request.orders, chosen, strict=True)
    ]
    radiance: list[Part] = []
    if request.depths and request.directions:
        # `slab_radiance` is for unit flux across the beam; pi times it is for a flux of pi.
        azimuths = [(mu, math.radians(phi)) for mu, phi in request.directions]
        values = np.pi * slab_radiance(
            *medium, directions=azimuths, depths=request.depths, streams=streams, nodes=nodes
        )
        radiance = [
            {"depth": depth, "mu": mu, "phi": phi, "value": float(value)}
            for depth, row in zip(request.depths, values, strict=True)
            for (mu, phi), value in zip(request.directions, row, strict=True)
        ]
    # Light that was never scattered leaves at the lower face, too.
    direct = math.exp(-request.tau / request.mu0)
    # Fluxes of unit flux across the beam over mu0 are fractions of the flux that enters the slab.
    whole: Numbers = {
        "reflectance": float(total[UP, 0, 0]) / request.mu0,
        "transmittance": float(total[DOWN, 0, -1]) / request.mu0 + direct,
        "flux": [
            {
                "depth": depth,
                "up": np.pi * float(total[UP, 0, place]),
                "down": np.pi * float(total[DOWN, 0, place]),
            }
            for depth, place in zip(request.depths, places, strict=True)
        ],
        "radiance": radiance,
    }
    return {"orders": orders, "total": whole}


def _exit(moments: Array, unit: float) -> Exit:
    amount, first, second = (float(moment) for moment in moments)
    # The mean place of no light is not known.
    if amount <= 0.0:
        return 0.0, None, None
    return amount / unit, first / amount, math.sqrt(max(second / amount, 0.0))


def _estimated(request: SlabRequest, estimate: SlabEstimate, which: int) -> Numbers:
    """Return the values of photons for 0, or their standard errors for 1."""
    moments = estimate.exits[which].copy()
    if which:
        # Where no photon came by nothing is known of the error of the amount.
        moments[estimate.exits[0][..., 0] == 0, 0] = np.nan
    exits, totals, flux = (
        part.tolist() for part in (moments, estimate.totals[which], estimate.flux[which])
    )
    orders: list[Part] = [
        _order_row(name, request.depths, reflected, transmitted, fluence)
        for name, (reflected, transmitted, *fluence) in zip(request.orders, exits, strict=True)
    ]
    total: Numbers = {
        "reflectance": totals[0],
        "transmittance": totals[1],
        "flux": [
            {"depth": depth, "up": up, "down": down}
            for depth, (up, down) in zip(request.depths, flux, strict=True)
        ],
        "radiance": [],
    }
    return {"orders": orders, "total": total}


def _order_row(
    name: str,
    depths: tuple[float, ...],
    reflected: Exit,
    transmitted: Exit,
    fluence: Iterable[Exit],
) -> Numbers:
    row: Numbers = {
        "orders": name,
        "reflectance": reflected[0],
        "transmittance": transmitted[0],
    }
    for side, (_, mean, rms) in (("reflected", reflected), ("transmitted", transmitted)):
        row |= {f"{side}_mean": mean, f"{side}_rms": rms}
    within = zip(depths, fluence, strict=True)
    return row | {
        "fluence": [
            {"depth": z, "value": a, "mean": mean, "rms": rms} for z, (a, mean, rms) in within
        ]
    }


def _differences(fine: Part, coarse: Part) -> Part:
    """Return the same structure with the differences of its numbers; the keys of rows stay."""
    # Both sides have the same structure, entry by entry.
    if isinstance(fine, dict) and isinstance(coarse, dict):
        return {
            name: value
            if name in _IDENTITY and not isinstance(value, list)
            else _differences(value, coarse[name])
            for name, value in fine.items()
        }
    if isinstance(fine, list) and isinstance(coarse, list):
        return [_differences(*pair) for pair in zip(fine, coarse, strict=True)]
    if fine is None or coarse is None:
        return None
    assert isinstance(fine, int | float)
    assert isinstance(coarse, int | float)
    return abs(fine - coarse)
