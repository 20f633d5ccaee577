# SPDX-License-Identifier: BSD-3-Clause
"""A reservoir of lights: of some candidates of each ray one is kept by chance, and one
shadow ray is cast for it.

`airlight render fireflies --size 64x48 --method docs/examples/reservoirs.py:Reservoirs --set
candidates=16 -o fog.png`

A candidate y is a light, taken by its power with the probability q, and an even fraction of the
angle at it. With f(y) its radiance without shadows, its weight is w = |f(y)| / q, |f| the mean of
the channels. The reservoir keeps a candidate with the probability w over the sum of all weights so
far, and in the end

    L = f(y) V(y) / |f(y)|  (1/M) sum of the M weights,        V the visibility,

has the airlight for its mean, with any M (Talbot, Cline, Egbert 2005; Bitterli et al. 2020, eq. 6).
Reservoirs of neighbours and of the last frame are not used: reuse makes pixels alike, and biased
where visibility differs.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

import airlight


@dataclass(frozen=True)
class Reservoirs(airlight.Method):
    """One shadow ray for the best of some candidates."""

    name = "reservoirs"
    summary = "one of some candidates of light and place, kept by its radiance without shadows"
    source = "Talbot, Cline, Egbert 2005; Bitterli et al. 2020"
    prepared_from = frozenset({"light", "look"})
    uses_kernel = False
    casts_rays = True
    at_once = True
    noisy = True

    candidates: int = airlight.parameter(8, "candidates of every ray", least=1)

    def check(self, scene):
        """Refuse lights at infinity, which have no angle."""
        if not all(light.w for light in scene.lights):
            raise airlight.InputError(
                "reservoirs: needs lights that have a place; remove the directional ones"
            )

    def preparation(self, scene):
        """Return a function of what draws the lights of each table: of points, of spots,
        of samples of area lights.
        """
        return lambda now: tuple(map(airlight.light_choice, airlight.light_tables(now.lights)))

    def render(self, view, state, kernel):
        """Return the airlight of every ray by chance [W/(m^2 sr)]."""
        total = dr.zeros(type(view.medium.albedo), dr.width(view.pixel))
        for first, (table, by_power) in enumerate(zip(view.tables, state, strict=True)):
            total += self._reservoir(view, table, by_power, stream=first << 16)
        return airlight.Layers(total)

    def _reservoir(self, view, table, by_power, stream):
        Float, lanes = type(view.distance), dr.width(view.pixel)

        def step(number, weights, kept, at):
            fraction, place, coin, _ = view.uniform(stream + number)
            light, probability = by_power.pick(fraction)
            color, _ = unshadowed(view, table[light], place)
            weight = dr.mean(color) / probability
            weights = weights + weight
            takes = coin * weights < weight
            return number + 1, weights, dr.select(takes, light, kept), dr.select(takes, place, at)

        nothing = dr.zeros(Float, lanes)
        _, weights, kept, at = dr.while_loop(
            state=(mi.UInt32(0), nothing, dr.zeros(mi.UInt32, lanes), +nothing),
            cond=lambda number, weights, kept, at: number < self.candidates,
            body=step,
        )
        light = table[kept]
        color, point = unshadowed(view, light, at)
        lit = weights > 0
        if view.features.shadows:
            lit &= view.visible(point, light)
        mean = dr.mean(color)
        return dr.select(
            lit, color * (weights / (self.candidates * dr.select(mean > 0, mean, 1))), 0
        )


def unshadowed(view, light, place):
    """Return the radiance of one sample of a light without shadows [W/(m^2
    sr)], and where it is [m].
    """
    rays = view.lit_by(light)
    span = airlight.marched_steps(rays, view.distance, 1, "equiangular")
    x = span.place(dr.fma(place, span.width, span.begin))
    value = rays.source(x) * (span.stretch(x) * span.width)
    return rays.radiance(dr.select(span.width > 0, value, 0)), view.at(x)
