# SPDX-License-Identifier: BSD-3-Clause
"""Sampling distances along a camera ray for directional lights, in Dr.Jit: uniform and free-flight, combined.

Nothing falls with the distance to such a light: what varies along a stretch of length d is exp(-sigma y) of the camera
ray, the transmittance of the leg, which may fall or rise, and shadows. The density is the mean of the uniform one, 1/d,
and of free flights truncated to the stretch (`reference.monte_carlo.single_scatter.distance_sampling`), with a share
for each channel. Half of the unit interval goes to the former, half to the latter: with n samples in n cells either
technique is stratified by itself. As each has a finite density from below, 1/(2 d), the estimator is bounded.
"""

from collections.abc import Sequence
from typing import Any

import drjit as dr
import mitsuba as mi

from reference.monte_carlo.single_scatter.distance_sampling import free_flight, free_flight_pdf, free_flights


def sample_stretch(u, length, sigma_t: Sequence[Any]) -> tuple[Any, Any]:
    """Sample a distance from the start of a stretch.

    `u`: uniform in [0, 1); `length`: of the stretch, finite and above 0 [m]; `sigma_t`: one extinction for all
    channels, or one for each [1/m]. Returns `y`, `density`: distance [m] and density of the mixture there [1/m], in
    single precision.
    """
    length = mi.Float64(length)
    flights = [free_flights(length, mi.Float64(rate)) for rate in sigma_t]
    share = 0.5 / len(flights)
    y = 2 * u * length
    for number, flight in enumerate(flights):
        low = 0.5 + number * share
        y = dr.select(u >= low, free_flight(dr.clip((u - low) / share, 0, 1), flight), y)
    y = dr.minimum(y, length)
    density = 0.5 / length + share * sum(free_flight_pdf(y, flight) for flight in flights)
    return mi.Float(y), mi.Float(density)
