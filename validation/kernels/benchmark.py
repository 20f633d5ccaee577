# SPDX-License-Identifier: BSD-3-Clause
"""The cost and error of kernels: nanoseconds a ray with the error, all
kernels and sizes in one run.

Times are of frozen functions after warm-up, on rays that lie ready on the device: from Dr.Jit's
kernel history (the kernel alone) and from the wall clock (launch and replay included). The kernels
of one phase function take turns. Errors are of float32 on the set W of
`validation.kernels.rays.wide_rays`; the same rays, more of them, are timed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, product

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.analytic.clock import Spent
from airlight.errors import InputError
from airlight.realtime.kernels.registry import KERNELS, Kernel
from airlight.realtime.numerics.array_types import aligned_array
from airlight.realtime.numerics.recorded import Frozen
from airlight.realtime.rays import RayGeometry
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.medium import Homogeneous
from airlight.realtime.scene.phase import named_phase
from airlight.validation.arrays import Counted
from airlight.validation.clock import Piece, in_turns, timed, timing_of
from airlight.validation.kernels.case_files import Cases
from airlight.validation.kernels.cases import TABLE
from airlight.validation.kernels.errors import errors_by_group
from airlight.validation.kernels.rays import wide_rays
from airlight.validation.kernels.records import ErrorLevel, KernelCost, RayTime
from airlight.validation.study.configuration import find_kernel, sized, split_name

RAYS = 480_000  # 800 x 600
ERROR_RAYS = 6000
LEVELS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
#: Phase functions with their g, the first with all sizes of all kernels, the
#: others with the default sizes.
PHASES = (("isotropic", 0.0), ("rayleigh", 0.0), ("hazy", 0.0), ("murky", 0.0), ("hg", 0.8))
#: Sizes to try, by the name of the parameter.
SIZES: dict[str, tuple[int, ...]] = {
    "nodes": (2, 4, 6, 8, 12, 16, 24, 32),
    "degree": (2, 4, 6, 8, 11, 15, 23, 31),
    "steps": tuple(2**k for k in range(2, 15)),
    "size": (32, 64, 128, 256, 512, 1024),
}


def bench_kernels(
    names: Sequence[str] | None = None,
    *,
    phases: Sequence[tuple[str, float]] = PHASES,
    progress: Counted | None = None,
) -> list[KernelCost]:
    """Measure kernels, all of the registry by default: 'name' stands for all its
    sizes, 'name-N' for one.

    The first of the phase functions, given with their g, is measured with all sizes, the
    others with the default sizes.
    """
    # Wrong names are refused here, before any time is spent.
    ladders = [_ladder(name) for name in names or KERNELS]
    total = len(ladders) * len(phases)
    costs: list[KernelCost] = []
    for number, (phase, g) in enumerate(phases):
        # Errors need J, which takes long to compute: fewer rays have it. Times need many rays, and
        # no J.
        reference, rays = (
            wide_rays(ERROR_RAYS, phase, g),
            wide_rays(RAYS, phase, g, reference=False),
        )
        tried: list[Tried] = []
        for done, (family, default, sizes) in enumerate(ladders):
            if progress is not None:
                progress(number * len(ladders) + done, total, f"{family}, {phase}")
            for size in sizes if number == 0 else (default,):
                each = try_kernel(family, size, reference=reference, rays=rays)
                # a size that the kernel does not have is left out
                if each.work is not None or size == default:
                    tried.append(each)
        costs += timed_in_turns(tried)
    return costs


@dataclass(frozen=True)
class Tried:
    """A kernel with its errors, and the work that is to be timed; None where it refused."""

    cost: KernelCost
    work: Callable[[], mi.Float] | None = None


def try_kernel(family: str, size: int | None, *, reference: Cases, rays: Cases) -> Tried:
    """Return the kernel 'family-size' with its error on rays with known J, and its work
    on others, of one phase.
    """
    name, phase, g = sized(family, size), reference.phase[0], float(reference.g[0])
    kernel, count = find_kernel(name), len(rays.x0)
    cost = KernelCost(kernel=name, family=family, size=size, phase=phase, g=g)
    if (
        size is not None
        and family in KERNELS
        and next(iter(KERNELS[family].parameters), None) == "steps"
    ):
        # Marching is timed on all rays up to 64 steps, on fewer in proportion where it takes more.
        count //= max(1, size // 64)
    try:
        # A refusal of a kernel (a phase function, a size) is noted in its cost, and the study goes
        # on.
        J = np.array(_frozen(kernel, reference)(), dtype=np.float64)
        work = _frozen(kernel, rays, count)
    except InputError as reason:
        return Tried(replace(cost, refused=str(reason)))
    error = errors_by_group(reference, J, "single", {"all": np.ones(len(J), dtype=bool)})["all"]
    cost = replace(
        cost,
        median=error.median,
        p99=error.p99,
        max=error.max,
        nonfinite=error.nan + error.infinite,
    )
    return Tried(replace(cost, rays=count), work)


def timed_in_turns(tried: Sequence[Tried], seconds: float = 0.3) -> list[KernelCost]:
    """Return the costs of kernels with their times: of the wall clock, and of the
    device where it tells them.
    """
    works = [each.work for each in tried if each.work is not None]
    for work in [*works, *works]:  # records, and replays once
        timed(work)
    pieces = [Piece(partial(_wall_and_device, work), seconds) for work in works]
    # The rounds of a kernel are chained: one list of times for each kernel that was timed.
    spent = iter(list(chain(*rounds)) for rounds in in_turns(pieces))
    return [
        each.cost if each.work is None else _with_times(each.cost, next(spent)) for each in tried
    ]


def speed_against_error(costs: Sequence[KernelCost]) -> list[ErrorLevel]:
    """Return the cheapest kernel, and its cost [ns a ray], for each phase function,
    statistic and error level.

    A kernel reaches a level if its error stays at or below it; one that gave values that are
    not finite reaches none.
    """
    levels = []
    for phase, statistic, level in product(
        dict.fromkeys(cost.phase for cost in costs), ("max", "p99"), LEVELS
    ):
        # A kernel may reach a level with several sizes; the cheapest of all counts.
        good = [cost for cost in costs if cost.phase == phase and _reaches(cost, statistic, level)]
        best = min(good, key=_ns, default=None)
        cheapest, ns = (best.kernel, _ns(best)) if best else (None, None)
        levels.append(
            ErrorLevel(phase=phase, statistic=statistic, level=level, cheapest=cheapest, ns=ns)
        )
    return levels


def _reaches(cost: KernelCost, statistic: str, level: float) -> bool:
    error: float | None = getattr(cost, statistic)
    return cost.refused is None and error is not None and not cost.nonfinite and error <= level


def _ns(cost: KernelCost) -> float:
    assert cost.time is not None
    return cost.time.median


def _ladder(name: str) -> tuple[str, int | None, tuple[int | None, ...]]:
    """Return the kernel's family, its default size and the sizes to try."""
    # A user's kernel, 'FILE:NAME', has no sizes of its own.
    if ":" in name:
        find_kernel(name)
        return name, None, (None,)
    record, size = split_name(name)
    if size is not None:
        return record.name, size, (size,)
    if not record.parameters:
        return record.name, None, (None,)
    parameter, default = next(iter(record.parameters.items()))
    # Parameters without a list of sizes are tried at fractions and multiples of the default.
    sizes = SIZES.get(parameter, (default // 4, default // 2, default, 2 * default, 4 * default))
    return record.name, default, tuple(sorted({each for each in (*sizes, default) if each > 0}))


def _frozen(kernel: Kernel, cases: Cases, rays: int | None = None) -> Callable[[], mi.Float]:
    """Return work that evaluates a kernel on rays that lie on the device, and returns J [1/m].

    It is frozen after its first call.
    """
    part = slice(0, rays)
    name = cases.phase[0]
    # Numbers are opaque inputs: a literal would be folded into the kernel, which is then faster
    # than in a frame.
    phase = named_phase(
        name,
        g=dr.opaque(mi.Float, float(cases.g[0])) if name == "hg" else None,
        values=mi.Float(np.asarray(TABLE)) if name == "tabulated" else None,
    )
    medium = Homogeneous(
        (dr.opaque(mi.Float, float(cases.sigma_t[0])),), dr.opaque(mi.Color3f, 1), phase
    )
    light = Light(dr.opaque(mi.Vector3f, 0), dr.opaque(mi.Color3f, 1))
    columns = (cases.foot, cases.height, cases.x0, cases.x1)
    foot, height, x0, x1 = (aligned_array(mi.Float, column[part]) for column in columns)
    # Foot and height are given: neither the origin nor the direction of a ray is needed.
    geometry = RayGeometry(foot, height, None, None)
    dr.eval(geometry.foot, geometry.height, x0, x1)
    kernel = kernel.prepared(mi.Float)
    # Once outside: what a kernel refuses must not be raised while it is recorded.
    dr.eval(kernel(geometry, x0, x1, medium, light))
    replay = Frozen(lambda kernel, *case: kernel(*case))

    def work():
        J = replay(kernel, geometry, x0, x1, medium, light)
        dr.eval(J)
        return J

    return work


def _wall_and_device(work: Callable[[], object]) -> tuple[Spent, Spent]:
    """Return the time of work by the wall clock, and the time of its compiled kernels alone in a
    second run.
    """
    wall = timed(work)[1]
    # The history of kernels is recorded in a second run, so that the wall clock times a run without
    # it.
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        timed(work)
        ms = sum(
            entry.get("execution_time", 0.0) for entry in dr.kernel_history((dr.KernelType.JIT,))
        )
        dr.kernel_history_clear()
    return wall, Spent(1e-3 * ms)


def _with_times(cost: KernelCost, spent: Sequence[tuple[Spent, Spent]]) -> KernelCost:
    """Return the cost of a kernel with its times [ns a ray]."""
    # From milliseconds for all rays to nanoseconds for one.
    scale = 1e6 / cost.rays
    wall, device = (
        RayTime(
            median=each.median_ms * scale,
            low=each.low_ms * scale,
            high=each.high_ms * scale,
            repetitions=each.repetitions,
        )
        for each in map(timing_of, zip(*spent, strict=True))
    )
    return replace(cost, device=device if device.median > 0 else None, wall=wall)
