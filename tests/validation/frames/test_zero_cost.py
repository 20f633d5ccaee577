# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest

from realtime.frame.renderer import run_stages
from validation.configurations.methods import Configuration, prepared
from validation.frames.zero_cost import sphere_spot_with, zero_costs


def kernels(renderer):
    """The kernels of a replayed frame: what each is by its hash, and how many lanes it has."""
    import drjit as dr

    ready = renderer.prepare(renderer.scene)
    run_stages(renderer, ready)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        run_stages(renderer, ready)
        return [(kernel["type"], kernel.get("hash"), kernel["size"]) for kernel in dr.kernel_history()]


@pytest.mark.claim("without-occluders")
def test_without_casters_shadow_planes_run_the_kernels_of_unshadowed(variant):
    """No time can say it better: it is the same machine code on the same lanes."""
    from realtime.scene.read_scene import read_scene
    from validation.scenes.loading import load_scene

    scene = read_scene(load_scene("open-fog", (16, 12)).scene)
    planes, plain = (prepared(scene, Configuration(method, "exact")) for method in ("shadow-planes", "unshadowed"))
    recorded = kernels(planes)
    assert recorded
    # Arrays from NumPy are aligned as Dr.Jit's: the code that loads them would differ with their alignment.
    assert recorded == kernels(plain)


@pytest.mark.claim("not-needed-costs-nothing")
def test_unseen_casters_leave_no_plane(variant):
    """41 rings behind the camera: the planes of the frame are those of the sphere and the floor alone."""
    scenes = [sphere_spot_with(unseen, (16, 12)) for unseen in (41, 0)]
    more, less = (prepared(scene, Configuration("shadow-planes", "exact")).prepare(scene)[0] for scene in scenes)
    for name in ("start", "entries", "lines", "spans", "ends", "layers"):
        np.testing.assert_array_equal(np.array(getattr(more, name)), np.array(getattr(less, name)), err_msg=name)


@pytest.mark.claim("not-needed-costs-nothing")
@pytest.mark.slow
def test_what_is_not_needed_costs_nothing(variant):
    """Within 3 %; two standard errors of the median of 150 turns are what the machine's other work can add to it."""
    for cost in zero_costs(size=(400, 300), turns=150):
        assert cost.least_ratio < 1.03, cost
