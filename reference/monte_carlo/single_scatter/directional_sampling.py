# SPDX-License-Identifier: BSD-3-Clause
"""Sampling lights from infinity, in Dr.Jit: distances along a camera ray, uniform and free-flight, combined.

Nothing falls with the distance to such a light: what varies along a stretch of length d is exp(-sigma y) of the camera
ray, the transmittance of the leg, which may fall or rise, and shadows. The density is the mean of the uniform one, 1/d,
and of free flights truncated to the stretch (`reference.monte_carlo.single_scatter.distance_sampling`), with a share
for each channel. Half of the unit interval goes to the former, half to the latter: with n samples in n cells either
technique is stratified by itself. As each has a finite density from below, 1/(2 d), the estimator is bounded.

A uniform sky is asked for a direction with every distance; Mitsuba's emitter draws it evenly from the sphere.
"""

from collections.abc import Callable, Sequence
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


def is_sky(emitter) -> bool:
    """Return whether an emitter of Mitsuba is a uniform sky."""
    return bool(emitter.class_name() == "ConstantBackgroundEmitter")


def drawn(emitter, sampler, active):
    """Return the numbers by which an emitter from infinity chooses a direction: those of a sky are random."""
    return sampler.next_2d(active) if is_sky(emitter) else mi.Point2f(0.5)


def mean_over_directions(emitter, sampler, samples: int, active, one: Callable[[Any], Any]):
    """Return the mean of `one(numbers)` over directions of an emitter from infinity: of a sun there is one."""
    if not is_sky(emitter):
        return one(mi.Point2f(0.5))

    def add_sample(index, total, sampler):
        return index + 1, total + one(sampler.next_2d(active)) / samples, sampler

    state = (mi.UInt32(0), dr.zeros(mi.Spectrum, dr.width(active)), sampler)
    return dr.while_loop(state, lambda index, *_: index < samples, add_sample, label="directions")[1]
