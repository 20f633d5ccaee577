# SPDX-License-Identifier: BSD-3-Clause
"""What light volumes refuse, and what they take of memory."""

import mitsuba as mi
import numpy as np
import pytest

from realtime.errors import InputError
from tests.helpers.frames import render, renderer
from tests.helpers.light_frames import EVALUATIONS, loaded_scene
from tests.helpers.scenes import bounded_medium, clear_scene


def test_a_mesh_is_for_media_without_bounds(variant):
    smoke = bounded_medium({"type": "sphere", "center": [0.1, 0.2, 0.9], "radius": 0.4}, 0.7, (0.9, 0.8, 0.7))
    loaded = mi.load_dict(clear_scene(cloud=smoke))
    with pytest.raises(InputError, match=r"evaluation=mesh: the scene has a medium with bounds.*evaluation=walk"):
        renderer(loaded, "light-volumes", evaluation="mesh")
    assert np.max(render(loaded, "light-volumes", map=16).airlight) > 0


@pytest.mark.claim("memory-before-it-is-taken")
@pytest.mark.parametrize("evaluation", EVALUATIONS)
def test_memory_is_counted_before_it_is_taken(variant, monkeypatch, evaluation):
    import realtime.memory
    import realtime.methods.light_volumes.method

    def never(*args):
        raise AssertionError("a map was cast")

    loaded = loaded_scene(size=(4, 4))
    monkeypatch.setattr(realtime.memory, "usable_memory", lambda: realtime.memory.Memory(10**9, "this machine has"))
    with monkeypatch.context() as patch:
        patch.setattr(realtime.methods.light_volumes.method, "cast_shadow_map", never)
        message = r"map: 4096 texels for 1 light\(s\): needs [0-9.]+ GB of memory, this machine has 1 GB; use a smaller"
        with pytest.raises(InputError, match=message):
            renderer(loaded, "light-volumes", map=4096, evaluation=evaluation)
    render(loaded, "light-volumes", map=64, evaluation=evaluation)
