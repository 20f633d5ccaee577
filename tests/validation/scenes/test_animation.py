# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import replace

import drjit as dr
import numpy as np
import pytest

from realtime.frame.incremental import next_frame
from realtime.methods.registry import FOG_METHODS
from realtime.scene.read_scene import read_scene
from validation.scenes.animation import animate, moved_parts
from validation.scenes.loading import load_scene
from validation.study.configuration import configuration, prepared


def host(array) -> np.ndarray:
    return np.array(array, dtype=np.float64).ravel()


def read(name):
    loaded = load_scene(name, (16, 12))
    return read_scene(loaded.scene), loaded.animation


@pytest.mark.parametrize("name", ["open-fog", "sphere-spot"])
def test_lights_circle_at_one_height_and_come_back(variant, name):
    scene, animation = read(name)
    about = np.array(animation.about)
    places = np.array([host(moved.lights[0].position) for moved in animate(scene, animation, 8)])
    np.testing.assert_allclose(places[0], host(scene.lights[0].position), rtol=1e-7)
    np.testing.assert_allclose(places[:, 2], places[0, 2], rtol=1e-6)
    radius = np.linalg.norm(places[:, :2] - about[:2], axis=1)
    assert radius[0] > 0.1
    np.testing.assert_allclose(radius, radius[0], rtol=1e-5)
    steps = np.linalg.norm(places - np.roll(places, 1, axis=0), axis=1)
    np.testing.assert_allclose(steps, steps[0], rtol=1e-4)  # the step from the last to the first included


@pytest.mark.claim("frames-are-replayed")
@pytest.mark.parametrize(
    ("name", "moves", "method"),
    [
        ("sphere-spot", ("light",), "shadow-planes"),
        ("open-fog", ("light", "medium", "colour"), "shadow-planes"),
        ("sphere-spot", ("light",), "light-volumes"),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                ("clutter", ("light", "colour"), "shadow-planes"),
                ("fence", ("light",), "light-volumes"),
                *(("sphere-spot", ("light",), m) for m in FOG_METHODS if m not in ("shadow-planes", "light-volumes")),
            )
        ),
    ],
)
def test_frames_record_nothing_and_compile_nothing(variant, name, moves, method):
    """From the second frame on every kernel is replayed; what moves is data."""
    scene, animation = read(name)
    parameters = {"points": 4} if scene.area_lights else {}
    renderer = prepared(scene, configuration(method, None, parameters))
    animation, kept = replace(animation, moves=moves), None
    for number, moved in enumerate(animate(scene, animation, 6)):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            _, kept = next_frame(renderer, moved, kept, **moved_parts(animation))
            kernels = dr.kernel_history((dr.KernelType.JIT,))
            compiled = [kernel for kernel in kernels if not kernel["cache_hit"] or kernel["cache_disk"]]
        assert kernels
        if number:
            assert not compiled
    stages = renderer.stages
    assert stages.render.n_recordings == 1
    assert all(getattr(stage, "n_recordings", 1) == 1 for stage in (stages.surface, stages.shade))


@pytest.mark.parametrize(
    ("moves", "casts", "prepared_frames"),
    [(("light",), 1, 4), (("medium", "colour"), 1, 1), (("light", "colour"), 1, 4), (("objects", "medium"), 4, 4)],
)
def test_what_stands_still_is_kept(variant, moves, casts, prepared_frames):
    """Four frames: camera rays are cast again where objects move alone, planes are found again where the light does."""
    scene, animation = read("two-pens")
    animation = replace(animation, moves=moves)
    renderer = prepared(scene, configuration("shadow-planes"))
    calls = {"surface": 0, "prepare": 0}

    def counted(name):
        def run(*arguments):
            calls[name] += 1
            return getattr(renderer.stages, name)(*arguments)

        return run

    stages = replace(renderer.stages, surface=counted("surface"), prepare=counted("prepare"))
    counting, kept = replace(renderer, structures=dict.fromkeys(renderer.structures, stages)), None
    for moved in animate(scene, animation, 4):
        _, kept = next_frame(counting, moved, kept, **moved_parts(animation))
    assert calls == {"surface": casts, "prepare": prepared_frames}
