# SPDX-License-Identifier: BSD-3-Clause
"""Ray marching: the airlight integral by the midpoint rule, with one visibility test a step.

Two spacings of the same number of steps:

* `uniform` in the distance x, weight dx exp(-sigma_t (x + r)) p / r^2. Most shaders do this; it
  misses the peak near the light. Where nothing ends the ray it stops at 20 optical depths (e^-20 =
  2e-9 is left).
* `equiangular` in theta, the angle at the light; for a light at infinity these are equal steps in
  x. With x = foot + h tan theta, dx / r^2 = dtheta / h: the peak is gone and the weight is dtheta/h
  exp(-sigma_t (x + r)) p.

The order of convergence in the number of steps is 2 on a ray without shadows and 1 where shadow
edges fall between steps.

``sum=transitions`` is the marcher with which Billeter, Sintorn and Assarsson 2010 compare (their
section 6): N samples of the visibility alone, and the airlight "only calculated when a transition
between a lit and an unlit region is detected", as the integral up to there (their eq. 3). The paper
does not say where between two samples the transition is. With the cells [u_k, u_k+1] about the
samples, u the variable of the spacing and V_k the visibility in the middle of a cell, it is here at
their border:

    J = sum_k V_k J(x_k, x_k+1) = sum over the runs of lit cells of J(x_i, x_j),     x_k = x(u_k),

for neighbouring cells that are lit add up to one integral, by the kernel. Nothing is left of the
error of the integrand, so on a ray without shadows the sum is that of the kernel with any N. A
shadow edge is wrong by half a cell at most: the order is 1. The paper starts at the farthest
sample; the sum is the same from either end.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.errors import InputError
from airlight.realtime.intervals import add_waiting, close_interval, no_intervals, sum_at_end
from airlight.realtime.methods.interface.marching import marched_integral, marched_steps
from airlight.realtime.methods.interface.method import Method, animate, jitter, no_state
from airlight.realtime.parameters import MOST_STEPS, parameter
from airlight.realtime.scene.media.medium import LitRays
from airlight.realtime.shadow_maps.shadow_map import (
    cast_shadow_maps,
    check_maps,
    lit_in_map,
    map_size,
)

_DUE = 3  # in the last bits of a step's number: there an interval that has ended is integrated


@dataclass(frozen=True)
class RayMarch(Method):
    """Airlight by steps along each ray.

    References
    ----------
    Billeter, Sintorn, Assarsson 2010, section 6 (the marcher that they compare with). Kulla,
    Fajardo 2012, *Importance sampling techniques for path tracing in participating media*, section
    4 (the equi-angular variable).
    """

    name = "ray-march"
    summary = "midpoint steps with one visibility test each: the baseline to beat"
    source = (
        "Billeter, Sintorn, Assarsson 2010, section 2; Kulla and Fajardo 2012 (equi-angular steps)"
    )
    prepared_from = frozenset({"geometry", "light"})
    by_rays = True
    by_table = True

    steps: int = parameter(100, "steps of every ray and light", least=1, most=MOST_STEPS)
    spacing: str = parameter(
        "equiangular",
        "in the angle at the light, or in the distance",
        choices=("equiangular", "uniform"),
    )
    shadow: str = parameter(
        "ray",
        "a shadow ray a step, a look-up in a shadow map, or no shadows",
        choices=("ray", "map", "none"),
    )
    sum: str = parameter(
        "steps",
        "the integrand at every step, or an integral by the kernel for each run of lit steps, as "
        "Billeter 2010 marches",
        choices=("steps", "transitions"),
    )
    depth: str = parameter(
        "exact",
        "optical depth up to a step, with `sum=steps`: exact, or a running sum over the steps, as "
        "engines have it",
        choices=("exact", "running"),
    )
    jitter: str = jitter()
    animate: str = animate()
    map: int = map_size(512, "texels on a side of a face of the map, with `shadow=map`")

    def _check_together(self) -> None:
        # The depth of a run of lit steps is the kernel's.
        if self.depth == "running" and self.sum == "transitions":
            raise InputError(
                "depth: got running with sum=transitions, whose integrals have the exact depth; "
                "expected sum=steps with it"
            )
        if self.jitter != "none" and self.sum == "transitions":
            raise InputError(
                f"jitter: got {self.jitter} with sum=transitions, expected sum=steps: a mean of "
                "runs is no integral"
            )
        if self.jitter == "none" and self.animate != "none":
            raise InputError(
                f"animate: got {self.animate} without jitter, expected jitter=white, blue or ign "
                "with it"
            )

    @property
    def uses_kernel(self):
        """Runs of lit steps are integrated by a kernel."""
        return self.sum == "transitions"

    def check(self, scene):
        """Refuse maps that have no room, and uniform steps on an unbounded ray through a vacuum."""
        if self.spacing == "uniform" and scene.medium.vacuum and not scene.medium.clear:
            raise InputError(
                "spacing=uniform: an unbounded ray through a vacuum has no step length; use "
                "spacing=equiangular"
            )
        if self.shadow == "map" and scene.features.shadows:
            check_maps(scene.lights, self.map)

    def preparation(self, scene):
        """Return a function that casts the shadow maps of each table of lights, if
        they are asked for.
        """
        if self.shadow != "map" or not scene.features.shadows:
            return no_state
        return lambda now: tuple(
            cast_shadow_maps(now.geometry, table, self.map) for table in now.tables
        )

    def airlight(self, view, light, state, kernel):
        """Return the airlight of every ray by marching [W/(m^2 sr)]."""
        airlight = view.lit_by(light, kernel if self.uses_kernel else None)

        def lit(x):
            if self.shadow == "none" or not view.features.shadows:
                return True
            return (
                lit_in_map(state, light, view.at(x))
                if self.shadow == "map"
                else view.visible(view.at(x), light)
            )

        if self.sum == "transitions":
            integral = _lit_runs(
                airlight, view.distance, steps=self.steps, spacing=self.spacing, lit=lit
            )
        else:
            how: dict[str, Any] = {
                "steps": self.steps,
                "spacing": self.spacing,
                "lit": lit,
                "running": self.depth == "running",
            }
            if self.noisy:
                how["shift"] = view.pattern(self.jitter, golden=self.animate == "golden")
            integral = marched_integral(airlight, view.distance, **how)
        return airlight.radiance(integral)

    def error_causes(self, size):
        """Return the causes of its errors, see `Method.error_causes`."""
        without = "shadows" if self.shadow == "none" else "map"
        return (without, {"shadow": "ray"}), ("steps", None)


def _lit_runs(airlight: LitRays, distance, *, steps: int, spacing: str, lit) -> Any:
    """Integrate the runs of cells whose middles are lit."""
    Float, lanes = type(distance), dr.width(distance)
    cells = marched_steps(airlight, distance, steps, spacing)
    meets = cells.width > 0  # rays that miss all bodies march on the spot, where a map can be asked
    x0, x1 = cells.x0, cells.x1

    def step(index, was_lit, opened, intervals):
        border = dr.select(
            index == 0,
            x0,
            dr.maximum(cells.place(dr.fma(Float(index), cells.width, cells.begin)), x0),
        )
        x = cells.place(dr.fma(Float(index) + 0.5, cells.width, cells.begin))
        now = meets & lit(x)
        closes = was_lit & ~now
        intervals = add_waiting(intervals, airlight.airlight, closes | ((index & _DUE) == _DUE))
        intervals = close_interval(intervals, border, closes, begin=opened)
        return index + 1, now, dr.select(now & ~was_lit, border, opened), intervals

    start = x0 + dr.zeros(Float, lanes)
    intervals = no_intervals(airlight.nothing(lanes), start)
    _, was_lit, opened, intervals = dr.while_loop(
        state=(mi.UInt32(0), dr.full(mi.Bool, False, lanes), +start, intervals),
        cond=lambda index, was_lit, opened, intervals: index < steps,
        body=step,
        labels=("index", "was_lit", "opened", "intervals"),
    )
    return sum_at_end(intervals, airlight.airlight, x1, opened=opened, lit=was_lit, active=meets)
