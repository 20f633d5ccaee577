# SPDX-License-Identifier: BSD-3-Clause
"""The numbers of a slab by name, as the command prints them: deterministic with their errors, and by photons."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from reference.monte_carlo.slab_walk.estimates import ExitEstimate, SlabEstimate, slab_estimate
from reference.monte_carlo.slab_walk.walk import Slab
from validation.slab.exits import Exit, SlabLight, slab_light
from validation.slab.request import SlabRequest

Progress = Callable[[float, str], None]

#: What a row is of, not a number of the light.
_GIVEN = ("orders", "depth", "mu", "phi")
#: A scattering of a photon [s], measured on one thread of an AMD EPYC.
_SCATTERING = 0.4e-6


def slab_numbers(
    request: SlabRequest, *, photons: int = 0, seed: int = 0, progress: Progress | None = None
) -> dict[str, Any]:
    """Return all numbers of a slab.

    `tau`, `sun`, `albedo`, `phase`, `orders`, `total`; `error`, with the estimated error of every number of `orders`
    and `total` in its place; with photons that check them `photons`: their `count` and `seed`, `orders` and `total` by
    them, and in `standard_error` the standard error of each.
    """
    tell = progress or (lambda share, what: None)
    tell(0.0, "orders")
    azimuths = [(mu, math.radians(phi)) for mu, phi in request.directions]
    fine, coarse = slab_light(
        request.tau,
        request.mu0,
        request.phase.deterministic,
        request.albedo,
        sets=request.ranges,
        depths=request.depths,
        directions=azimuths,
    )
    numbers, others = _numbers(request, fine), _numbers(request, coarse)
    record: dict[str, Any] = {
        **{name: getattr(request, name) for name in ("tau", "sun", "albedo")},
        "phase": request.phase.name,
        **numbers,
        "error": _differences(numbers, others),
    }
    if photons:
        slab = Slab(request.tau, request.mu0, request.albedo, request.phase.sampled(), request.depths)
        estimate = slab_estimate(slab, request.ranges, photons=photons, seed=seed, progress=tell)
        record["photons"] = {
            "count": photons,
            "seed": seed,
            **_estimated(request, estimate, "value"),
            "standard_error": _estimated(request, estimate, "error"),
        }
    tell(1.0, "done")
    return record


def expected_seconds(request: SlabRequest, photons: int) -> float:
    """Return about how long photons take on one thread [s]."""
    scatterings = min(3 + 2 * request.tau, 30 / max(1 - request.albedo, 1e-9))
    return photons * scatterings * _SCATTERING


def _numbers(request: SlabRequest, light: SlabLight) -> dict[str, Any]:
    orders = [
        _order_row(name, request.depths, each.reflected, each.transmitted, each.fluence)
        for name, each in zip(request.orders, light.sets, strict=True)
    ]
    radiance = [
        {"depth": depth, "mu": mu, "phi": phi, "value": float(value)}
        for depth, row in zip(request.depths, light.radiance, strict=True)
        for (mu, phi), value in zip(request.directions, row, strict=True)
    ]
    total = {
        "reflectance": light.reflectance,
        "transmittance": light.transmittance,
        "flux": [
            {"depth": depth, "up": float(up), "down": float(down)}
            for depth, up, down in zip(request.depths, light.up, light.down, strict=True)
        ],
        "radiance": radiance,
    }
    return {"orders": orders, "total": total}


def _estimated(request: SlabRequest, estimate: SlabEstimate, field: str) -> dict[str, Any]:
    """Return the values of photons, or their standard errors."""

    def exits(each: ExitEstimate) -> Exit:
        return Exit(*(getattr(part, field) for part in (each.value, each.mean, each.rms)))

    orders = [
        _order_row(name, request.depths, exits(each.reflected), exits(each.transmitted), map(exits, each.fluence))
        for name, each in zip(request.orders, estimate.sets, strict=True)
    ]
    total = {
        "reflectance": getattr(estimate.reflectance, field),
        "transmittance": getattr(estimate.transmittance, field),
        "flux": [
            {"depth": depth, "up": getattr(up, field), "down": getattr(down, field)}
            for depth, up, down in zip(request.depths, estimate.up, estimate.down, strict=True)
        ],
    }
    return {"orders": orders, "total": total}


def _order_row(
    name: str, depths: Sequence[float], reflected: Exit, transmitted: Exit, fluence: Iterable[Exit]
) -> dict[str, Any]:
    return {
        "orders": name,
        "reflectance": reflected.value,
        "transmittance": transmitted.value,
        "reflected_mean": reflected.mean,
        "reflected_rms": reflected.rms,
        "transmitted_mean": transmitted.mean,
        "transmitted_rms": transmitted.rms,
        "fluence": [
            {"depth": depth, "value": each.value, "mean": each.mean, "rms": each.rms}
            for depth, each in zip(depths, fluence, strict=True)
        ],
    }


def _differences(numbers: Any, others: Any) -> Any:
    """Return the same structure with the differences of its numbers; what a row is of stays."""
    if isinstance(numbers, Mapping):
        return {
            name: value if name in _GIVEN and not isinstance(value, list) else _differences(value, others[name])
            for name, value in numbers.items()
        }
    if isinstance(numbers, list):
        return [_differences(*pair) for pair in zip(numbers, others, strict=True)]
    return None if numbers is None or others is None else abs(numbers - others)
