# SPDX-License-Identifier: BSD-3-Clause
"""Frames wait for the host only as a table says, as a GPU needs it; every wait
is counted, without a GPU.
"""

import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import pytest

import airlight.realtime.numerics.array_types as array_types
from airlight.realtime.frame.incremental import next_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.methods.registry import FOG_METHODS, METHODS
from airlight.realtime.scene.read_scene import read_scene
from airlight.reports.machine.environment import activate
from tests.helpers.clouds import cloud_scene
from tests.helpers.lamps import lit_by
from tests.helpers.scenes import spot
from tests.helpers.sunlit import plank, shaded
from tests.helpers.transport_formula import use_formula

ROOT = Path(__file__).resolve().parents[3]
FOLDERS = ("realtime", "validation", "reports")


@contextmanager
def round_trips() -> Iterator[Counter[str]]:
    """Count, by file and function of ours, what waits for the device: reads of arrays, and
    sizes that arrays decide.

    Dr.Jit forbids what waits in any other way (`dr.JitFlag.ForbidSynchronization`): that raises.
    The processor takes the way of a GPU where the two differ, `realtime.numerics.array_types`.
    """
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
    """Return the types of arrays without rows of the backend in use, with
    and without derivatives.
    """
    named = {kind for name in dir(mi) if isinstance(kind := getattr(mi, name), type)}
    plain = {dr.detached_t(kind) for kind in named if dr.is_array_v(kind)}
    return sorted(
        (
            kind
            for kind in named | plain
            if dr.is_array_v(kind)
            and dr.depth_v(kind) == 1
            and not dr.is_tensor_v(kind)
            and dr.is_jit_v(kind)
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
        path = Path(frame.filename).resolve()  # `src` holds links
        if path.is_relative_to(ROOT) and path.relative_to(ROOT).parts[0] in FOLDERS:
            return f"{path.relative_to(ROOT).as_posix()}: {frame.name}"
    return "a test"


# The waits of frames ------------------------------------------------------------------------------


POINTS = 4  # of an area light
LAMP = {
    "type": "point",
    "position": [0.9, 0.7, 1.9],
    "intensity": {"type": "rgb", "value": [5.0, 4.0, 3.0]},
}

MOVES = {"look": "", "camera": "camera_moved", "light": "light_moved", "objects": "geometry_moved"}

READ = "realtime/numerics/array_types.py: _in_one_transfer"
POWER = "realtime/scene/light_table.py: light_choice"
SIDES = "realtime/methods/light_volumes/jump_search.py: _jumping_sides"

#: By method the moves after which a frame waits for the host, where, and how often in each of the
#: scenes below. There is no other wait.
WAITS: dict[str, tuple[tuple[str, ...], str, dict[str, int]]] = {
    "shadow-planes": (
        ("camera", "light", "objects"),
        READ,
        {"lamp": 2, "spot": 2, "sun": 2, "area": 2 * POINTS, "box": 2},
    ),
    "light-volumes": (
        ("light", "objects"),
        SIDES,
        {"lamp": 2, "spot": 2, "sun": 2, "area": 2 * POINTS, "box": 2},
    ),
    "equi-angular": (tuple(MOVES), POWER, {"lamp": 1, "spot": 1, "area": 1, "box": 1}),
}


def scenes() -> dict[str, Callable[[], dict[str, Any]]]:
    """By name small scenes with each kind of light, and with bounded media in vacuum."""
    return {
        "lamp": lambda: lit_by(changes={"lamp": LAMP}),
        "spot": lambda: lit_by(changes={"lamp": spot(cutoff=33.0, beam=21.0)}),
        "area": lit_by,
        "sun": lambda: shaded(solid=plank()),
        "box": lambda: shaded(solid=plank(), lamp=LAMP),
    }


@pytest.fixture(scope="module")
def elsewhere(variant) -> Iterator[Executor]:
    """A process of its own: counting replaces methods of Dr.Jit's types, and putting them
    back does not heal these.

    In one process Mitsuba crashed in a later test, where a mesh was built.
    """
    with ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=activate) as process:
        yield process


def waits_in_fog(scene: str, method: str) -> dict[str, Counter[str]]:
    """By what moved, the waits of a frame of one of `scenes`."""
    return waits_of_frames(scenes()[scene](), method)


def waits_in_clouds(method: str) -> dict[str, Counter[str]]:
    """By what moved, the waits of a frame of a cloud, with the formula in the place of
    tables that take minutes.
    """
    with pytest.MonkeyPatch.context() as patch:
        use_formula(patch)
        return waits_of_frames(cloud_scene(size=(8, 6)), method)


def waits_of_frames(scene: dict[str, Any], method: str) -> dict[str, Counter[str]]:
    """By what moved, the waits of a frame that has been rendered before."""
    read = read_scene(mi.load_dict(scene))
    points = {"points": POINTS} if read.area_lights else {}
    renderer = frame_renderer(read, METHODS[method], kernel=KERNELS["exact"], **points)
    cache, waits = None, {}
    for counting in (False, True):
        for name, moved in MOVES.items():
            moves = {word: word == moved for word in MOVES.values() if word}
            if not counting:
                _, cache = next_frame(renderer, read, cache, **moves)
                continue
            with round_trips() as waits[name]:
                _, cache = next_frame(renderer, read, cache, **moves)
    return waits


@pytest.mark.slow
@pytest.mark.claim("no-wait-in-a-frame")
@pytest.mark.parametrize("scene", scenes())
@pytest.mark.parametrize("method", [*FOG_METHODS, "equi-angular"])
def test_a_frame_waits_for_the_host_where_the_table_says(elsewhere, method, scene):
    moves, where, counts = WAITS.get(method, ((), "", {}))
    expected = {
        name: {where: counts[scene]} if name in moves and scene in counts else {} for name in MOVES
    }
    assert elsewhere.submit(waits_in_fog, scene, method).result() == expected


@pytest.mark.slow
@pytest.mark.claim("no-wait-in-a-frame")
@pytest.mark.parametrize(
    "method", [name for name, method in METHODS.items() if method.renders_clouds]
)
def test_a_frame_of_clouds_never_waits(elsewhere, method):
    assert elsewhere.submit(waits_in_clouds, method).result() == {name: {} for name in MOVES}
