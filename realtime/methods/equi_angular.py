# SPDX-License-Identifier: BSD-3-Clause
"""Equi-angular sampling: a few random samples a ray, each of one light chosen by its power.

Let N lights have the airlight L_i along a ray. Light i is chosen with the probability q_i, its
fraction of the power. Let theta be an even random angle at light i between theta_0 and theta_1, the
angles of the ends of the ray, and x = foot + h tan theta. Then

    L = sum_i L_i = E[ (theta_1 - theta_0) / q_i  dx/dtheta  f_i(x) ],

with f_i the integrand with the visibility. One sample therefore has the mean L, and it is bounded:
dx/dtheta / r^2 = 1/h leaves the product of exponential, phase and visibility (Kulla and Fajardo
2012, section 4). Sample k of S takes the fraction (k + c)/S of the power, c the shift of the
pattern, and another place for each k, by the step of Roberts' sequence in one dimension of two; the
mean of all stays the integral, since each sample alone is right in the mean.

Lights of different structure (points, spots, samples of area lights) are in separate tables, and
one of each is sampled. Lights at infinity have one sample each, even in the distance.

References
----------
Kulla, Fajardo 2012, *Importance sampling techniques for path tracing in
participating media* (CGF 31:4).
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr

from airlight.realtime.methods.interface.marching import marched_steps
from airlight.realtime.methods.interface.method import Layers, Method, View, animate
from airlight.realtime.numerics.functions import summed
from airlight.realtime.numerics.noise import PATTERNS
from airlight.realtime.parameters import MOST_STEPS, parameter
from airlight.realtime.scene.light_table import light_choice
from airlight.realtime.scene.lights import Light

#: The largest fraction of the power: 1, to which float32 rounds, would draw the last light of a
#: table, dark or not.
_BELOW_ONE = 1 - 2.0**-24


@dataclass(frozen=True)
class EquiAngular(Method):
    """Airlight by random samples along each ray.

    References
    ----------
    Kulla, Fajardo 2012, section 4.
    """

    name = "equi-angular"
    summary = "a few random samples a ray, each of one light chosen by its power: noisy, and right in the mean"
    source = "Kulla and Fajardo 2012"
    prepared_from = frozenset({"light", "look"})
    casts_rays = True
    by_rays = True
    at_once = True

    samples: int = parameter(1, "samples of every ray", least=1, most=MOST_STEPS)
    jitter: str = parameter(
        "white",
        "noise of the samples: white, a mask of blue noise, or interleaved gradient noise",
        choices=PATTERNS,
    )
    animate: str = animate()

    def preparation(self, scene):
        """Return a function of what draws the lights of each table that have a place."""
        return lambda now: tuple(
            light_choice(table) if table.rows.w else None for table in now.tables
        )

    def render(self, view, state, kernel):
        """Return the airlight of every ray by chance [W/(m^2 sr)]."""
        golden = self.animate == "golden"
        # Two streams of the pattern: where on the ray a sample lies, and which light it takes.
        place, choice = (
            view.pattern(self.jitter, golden=golden, stream=stream) for stream in (0, 1)
        )
        total = dr.zeros(type(view.medium.albedo), dr.width(view.pixel))
        for table, by_power in zip(view.tables, state, strict=True):
            # One sample of one light of this table: the light is picked by the fraction of the
            # power, and the radiance divided by q_i.
            def sample(at: Any, fraction: Any, table: Any = table, by_power: Any = by_power) -> Any:
                if by_power is None:  # a light at infinity is a table by itself
                    return _sample(view, table.rows, at)
                number, probability = by_power.pick(dr.minimum(fraction, _BELOW_ONE))
                return _sample(view, table[number], at) / probability

            total += self._mean(sample, place, choice, total)
        return Layers(total)

    def _mean(self, sample: Any, place: Any, choice: Any, like: Any) -> Any:
        """Return the mean of samples; each is a function of its place on the ray and of the
        fraction of the power at which its light stands, both from 0 to 1.
        """
        if self.samples == 1:
            return sample(place, choice)
        Float = type(place)

        def term(number):
            # Sample k lies k steps of Roberts' sequence beyond the pattern's place, modulo 1, and
            # takes the fraction (k + c)/S of the power.
            step = 0.7548776662466927  # 1/g with g^3 = g + 1
            at = dr.fma(Float(number), step, place)
            return sample(at - dr.floor(at), (Float(number) + choice) / self.samples)

        return summed(self.samples, term, dr.zeros(type(like), dr.width(place))) / self.samples


def _sample(view: View, light: Light, at: Any) -> Any:
    """Return the radiance of one sample of a light, at a fraction of the
    angle at it [W/(m^2 sr)].
    """
    # One step in the angle over the whole ray: its width is theta_1 - theta_0, its stretch
    # dx/dtheta.
    rays = view.lit_by(light)
    span = marched_steps(rays, view.distance, 1, "equiangular")
    x = span.place(dr.fma(at, span.width, span.begin))
    lit = span.width > 0
    if view.features.shadows:
        lit &= view.visible(view.at(x), light)
    return rays.radiance(dr.select(lit, rays.source(x) * (span.stretch(x) * span.width), 0))
