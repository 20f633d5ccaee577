# SPDX-License-Identifier: BSD-3-Clause
"""What a GPU needs of a frame: no wait for the host but those of a table.

No GPU is asked: frames are rendered while every wait is counted.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import mitsuba as mi
import pytest

from realtime.frame.incremental import next_frame
from realtime.frame.renderer import frame_renderer
from realtime.kernels.registry import KERNELS
from realtime.methods.registry import METHODS
from realtime.scene.read_scene import read_scene
from reports.machine.environment import activate
from tests.helpers.clouds import cloud_scene
from tests.helpers.lamps import lit_by
from tests.helpers.round_trips import round_trips
from tests.helpers.scenes import spot
from tests.helpers.sunlit import plank, shaded
from tests.helpers.transport_formula import use_formula

POINTS = 4  # of an area light
LAMP = {"type": "point", "position": [0.9, 0.7, 1.9], "intensity": {"type": "rgb", "value": [5.0, 4.0, 3.0]}}

MOVES = {"look": "", "camera": "camera_moved", "light": "light_moved", "objects": "geometry_moved"}

READ = "realtime/numerics/array_types.py: _in_one_transfer"
SIDES = "realtime/methods/light_volumes/jump_search.py: _jumping_sides"

#: By method the moves after which a frame waits for the host, where, and how often in each of the scenes below. There
#: is no other wait.
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
    "equi-angular": (tuple(MOVES), READ, {"lamp": 1, "spot": 1, "area": 1, "box": 1}),
    "froxel-fog": (("light", "objects"), READ, {"area": 1}),
    "soft-shafts": (("light", "objects"), READ, {"area": 1}),
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
    """A process of its own: counting replaces methods of Dr.Jit's types, and putting them back does not heal these.

    In one process Mitsuba crashed in a later test, where a mesh was built.
    """
    with ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=activate) as process:
        yield process


def waits_in_fog(scene: str, method: str) -> dict[str, Counter[str]]:
    """By what moved, the waits of a frame of one of `scenes`."""
    return waits_of_frames(scenes()[scene](), method)


def waits_in_clouds(method: str) -> dict[str, Counter[str]]:
    """By what moved, the waits of a frame of a cloud, with the formula in the place of tables that take minutes."""
    with pytest.MonkeyPatch.context() as patch:
        use_formula(patch)
        return waits_of_frames(cloud_scene(size=(8, 6)), method)


def waits_of_frames(scene: dict[str, Any], method: str) -> dict[str, Counter[str]]:
    """By what moved, the waits of a frame that has been rendered before."""
    read = read_scene(mi.load_dict(scene))
    points = {"points": POINTS} if read.area_lights else {}
    renderer = frame_renderer(read, METHODS[method], kernel=KERNELS["exact"].function, **points)
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
@pytest.mark.parametrize("method", [name for name, method in METHODS.items() if not method.renders_clouds])
def test_a_frame_waits_for_the_host_where_the_table_says(elsewhere, method, scene):
    moves, where, counts = WAITS.get(method, ((), "", {}))
    expected = {name: {where: counts[scene]} if name in moves and scene in counts else {} for name in MOVES}
    assert elsewhere.submit(waits_in_fog, scene, method).result() == expected


@pytest.mark.slow
@pytest.mark.claim("no-wait-in-a-frame")
@pytest.mark.parametrize("method", [name for name, method in METHODS.items() if method.renders_clouds])
def test_a_frame_of_clouds_never_waits(elsewhere, method):
    assert elsewhere.submit(waits_in_clouds, method).result() == {name: {} for name in MOVES}
