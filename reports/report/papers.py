# SPDX-License-Identifier: BSD-3-Clause
"""The parts of a report that belong to no scene of it.

These are the stability of the kernels, and how times grow with the work.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from reference.storage.kept import key_of
from reports.data.serialize import scaling_data
from reports.machine.environment import machine
from reports.machine.own_process import in_own_process
from reports.machine.progress import Progress, counted
from validation.metrics.errors import plain
from validation.study.results import Computed
from validation.study.scene import Effort

_GROWING = "colonnade"  # of which times are measured as its work grows
_GROWING_SIZE = (400, 300)  # of its images [pixels]


@dataclass(frozen=True)
class OtherPart:
    """A part of a report that belongs to no scene."""

    kind: str  #: 'stability', 'scaling' or 'papers'
    title: str  #: shown as the progress
    key: str  #: of its result
    compute: Callable[[Progress], Computed]


def other_parts(effort: Effort, scenes: Sequence[str]) -> list[OtherPart]:
    """Return the parts that an effort asks for."""
    parts = []
    if effort.rays:
        from validation.kernels.stability import stability

        key = key_of("report-stability", stability, rays=effort.rays)
        parts.append(OtherPart("stability", "stability", key, lambda progress: _stability(effort.rays, progress)))
    if _GROWING in scenes:
        parts += [_scaling(kind, effort.seconds) for kind in effort.scaling]
    return parts


def _stability(rays: int, progress: Progress) -> Computed:
    """Return how stable kernels are. Nearly all of its time goes into compilation: a process compiles them quickly."""
    from realtime.kernels.registry import KERNELS
    from validation.kernels.stability import stability

    known = in_own_process(known_kernels, rays, what="study", name="of the kernels", limit=None, quick=True)
    added = [name for name in KERNELS if name not in {kernel["kernel"] for kernel in known}]
    return {"kernels": known + (plain(stability(added, count=rays, progress=counted(progress))) if added else [])}, {}


def known_kernels(rays: int) -> list[dict[str, Any]]:
    """Return how stable the kernels of airlight are, in a process that knows no others."""
    from validation.kernels.stability import stability

    return plain(stability(count=rays))


def _scaling(kind: str, seconds: float) -> OtherPart:
    """Return how times grow with one kind of work."""
    from validation.study.growth import METHODS, study_scaling
    from validation.study.ladders import ladder

    def compute(progress: Progress) -> Computed:
        steps = ladder(kind, _GROWING, _GROWING_SIZE)
        found = study_scaling(kind, steps, METHODS, seconds=seconds, progress=counted(progress))
        return {"scaling": [scaling_data(_GROWING, _GROWING_SIZE, each) for each in found]}, {}

    identity = {"scene": _GROWING, "size": _GROWING_SIZE, "kind": kind, "seconds": seconds}
    key = key_of("report-scaling", study_scaling, ladder, scaling_data, machine=machine(), **identity)
    return OtherPart("scaling", "how times grow", key, compute)
