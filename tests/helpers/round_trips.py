# SPDX-License-Identifier: BSD-3-Clause
"""Count where work on the device stops for the host: each time costs a GPU all that it could have done meanwhile."""

import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi

import realtime.numerics.array_types as array_types

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("realtime", "validation", "reports")


@contextmanager
def round_trips() -> Iterator[Counter[str]]:
    """Count, by file and function of ours, what waits for the device: reads of arrays, and sizes that arrays decide.

    Dr.Jit forbids what waits in any other way (`dr.JitFlag.ForbidSynchronization`): that raises. The processor takes
    the way of a GPU where the two differ, `realtime.numerics.array_types`.
    """
    import pytest

    trips: Counter[str] = Counter()
    inside = False

    def counted(old: Callable[..., Any], waits: Callable[[Any], bool]) -> Callable[..., Any]:
        def call(*given, **named):
            nonlocal inside
            if inside or (given and not waits(given[0])):
                return old(*given, **named)
            trips[_caller()] += 1
            inside = True
            try:
                with dr.scoped_set_flag(dr.JitFlag.ForbidSynchronization, False):
                    return old(*given, **named)
            finally:
                inside = False

        return call

    with pytest.MonkeyPatch.context() as patch:
        for name in ("numpy", "__array__", "__dlpack__"):
            patch.setattr(dr.ArrayBase, name, counted(getattr(dr.ArrayBase, name), _on_device))
        for kind in _flat_types():
            for name in ("__getitem__", "__bool__", "__iter__"):
                patch.setattr(kind, name, counted(getattr(kind, name), _on_device))
        for name in ("compress", "sync_thread", "flush_malloc_cache", "slice"):
            patch.setattr(dr, name, counted(getattr(dr, name), lambda given: True))
        patch.setattr(array_types, "_on_processor", lambda number: False)
        with dr.scoped_set_flag(dr.JitFlag.ForbidSynchronization):
            yield trips


def _flat_types() -> list[type]:
    """Return the types of arrays without rows of the backend in use, with and without derivatives."""
    named = {kind for name in dir(mi) if isinstance(kind := getattr(mi, name), type)}
    plain = {dr.detached_t(kind) for kind in named if dr.is_array_v(kind)}
    return sorted(
        (
            kind
            for kind in named | plain
            if dr.is_array_v(kind) and dr.depth_v(kind) == 1 and not dr.is_tensor_v(kind) and dr.is_jit_v(kind)
        ),
        key=str,
    )


def _on_device(value: Any) -> bool:
    """Return whether reading a value asks the device; a literal is known without it."""
    if dr.depth_v(value) > 1:
        return any(_on_device(component) for component in value)
    return bool(dr.is_jit_v(value) and value.state != dr.VarState.Literal)


def _caller() -> str:
    for frame in reversed(traceback.extract_stack()):
        path = Path(frame.filename)
        if path.is_relative_to(ROOT) and path.relative_to(ROOT).parts[0] in FOLDERS:
            return f"{path.relative_to(ROOT).as_posix()}: {frame.name}"
    return "a test"
