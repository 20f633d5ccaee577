# SPDX-License-Identifier: BSD-3-Clause
"""What derivatives of kernels cost in forward mode, beside the values alone.

A derivative by one input takes a pass that computes the value too. By all six it takes one such pass each; those that
share a kernel share the value.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from analytic.certified import SLOPES
from analytic.errors import InputError
from realtime.errors import InputError as RealtimeInputError
from realtime.kernels.preparation import prepare_kernel, with_tables
from realtime.numerics.aligned import aligned_array
from realtime.rays.ray_light import RayGeometry
from realtime.scene.lights import Light
from realtime.scene.medium import Medium
from realtime.scene.phase import named_phase
from validation.configurations.kernel_names import find_kernel
from validation.kernels.benchmark import times_per_ray
from validation.kernels.rays import wide_rays
from validation.kernels.values import Kernel

Progress = Callable[[int, int, str], None]

RAYS = 120_000
PHASES = (("isotropic", 0.0), ("hg", 0.8))


@dataclass(frozen=True)
class GradientCost:
    """What a kernel and its derivatives cost for one phase function [ns a ray]."""

    kernel: str
    phase: str
    value: float | None = None  #: of the value alone
    sigma_t: float | None = None  #: of the value and its derivative by the extinction
    every: float | None = None  #: of the value and its derivatives by all inputs
    ratio: float | None = None  #: of `sigma_t` to `value` [1]
    refused: str | None = None  #: the kernel's words


def gradient_costs(
    names: Sequence[str],
    phases: Sequence[tuple[str, float]] = PHASES,
    *,
    rays: int = RAYS,
    seconds: float = 0.2,
    progress: Progress | None = None,
) -> list[GradientCost]:
    """Measure derivatives of kernels.

    Parameters
    ----------
    names
        Kernels as in `validation.configurations.kernel_names.find_kernel`.
    phases
        Phase functions with their g.
    rays
        Number of rays.
    seconds
        How long each is timed [s].
    progress
        Called with (done, total, what) before every kernel.
    """
    costs = []
    for number, (phase, g) in enumerate(phases):
        for done, name in enumerate(names):
            if progress is not None:
                progress(number * len(names) + done, len(phases) * len(names), f"{name}, {phase}")
            costs.append(_cost(name, phase, g, rays, seconds))
    return costs


def _cost(name: str, phase: str, g: float, rays: int, seconds: float) -> GradientCost:
    inputs = SLOPES if phase == "hg" else SLOPES[:-1]
    try:
        function = find_kernel(name)
        value, by_sigma_t, by_all = (
            _median(_work(function, phase, g, rays, by), rays, seconds) for by in ((), ("sigma_t",), inputs)
        )
    except (InputError, RealtimeInputError) as reason:
        return GradientCost(name, phase, refused=str(reason))
    return GradientCost(name, phase, value, by_sigma_t, by_all, by_sigma_t / value)


def _median(work: Callable[[], Any], rays: int, seconds: float) -> float:
    device, wall = times_per_ray(work, rays, seconds)
    return (device or wall).median


def _work(function: Kernel, phase: str, g: float, rays: int, by: Sequence[str]) -> Callable[[], Any]:
    """Return work that evaluates a kernel and its derivatives by some inputs."""
    cases = wide_rays(rays, phase, g, truth=False)
    columns = [aligned_array(mi.Float, column) for column in (cases.foot, cases.height, cases.x0, cases.x1)]
    columns += [dr.opaque(mi.Float, float(cases.sigma_t[0])), dr.opaque(mi.Float, g)]
    tables = prepare_kernel(function, mi.Float)
    kernel = with_tables(function, tables)
    light = Light(dr.opaque(mi.Vector3f, 0), dr.opaque(mi.Color3f, 1))

    def evaluate(number: int | None) -> tuple[Any, Any]:
        inputs = [mi.Float(column) for column in columns]
        if number is not None:
            dr.enable_grad(inputs[number])
        foot, height, x0, x1, sigma_t, own_g = inputs
        own_phase = named_phase(phase, g=own_g if phase == "hg" else None)
        J = kernel(RayGeometry(foot, height, None, None), x0, x1, Medium((sigma_t,), mi.Color3f(1), own_phase), light)
        if number is None or not dr.grad_enabled(J):
            return dr.detach(J), J * 0
        dr.forward(inputs[number])
        return dr.detach(J), mi.Float(dr.grad(J))

    wanted: list[int | None] = [SLOPES.index(name) for name in by]

    def work() -> None:
        dr.eval([evaluate(number) for number in wanted or [None]])

    return work
