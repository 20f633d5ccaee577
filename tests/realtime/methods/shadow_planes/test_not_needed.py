# SPDX-License-Identifier: BSD-3-Clause
"""Claim: what a scene does not need costs nothing. No time can say it better than the same kernels and planes."""

import mitsuba as mi
import numpy as np
import pytest

from realtime.frame.renderer import run_stages
from realtime.scene.read_scene import read_scene
from validation.configurations.methods import Configuration, prepared
from validation.scenes.loading import load_scene, resize
from validation.scenes.parts import mitsuba_mesh, placed, rotation
from validation.scenes.solids import torus
from validation.scenes.sphere_spot import sphere_spot


def kernels(renderer):
    """The kernels of a replayed frame: what each is by its hash, and how many lanes it has."""
    import drjit as dr

    ready = renderer.prepare(renderer.scene)
    run_stages(renderer, ready)
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        run_stages(renderer, ready)
        return [(kernel["type"], kernel.get("hash"), kernel["size"]) for kernel in dr.kernel_history()]


@pytest.mark.claim("without-occluders", "not-needed-costs-nothing")
def test_without_occluders_shadow_planes_run_the_kernels_of_unshadowed(variant):
    """The same machine code on the same lanes."""
    scene = read_scene(load_scene("open-fog", (16, 12)).scene)
    planes, plain = (prepared(scene, Configuration(method, "exact")) for method in ("shadow-planes", "unshadowed"))
    recorded = kernels(planes)
    assert recorded
    # Arrays from NumPy are aligned as Dr.Jit's: the code that loads them would differ with their alignment.
    assert recorded == kernels(plain)


def sphere_spot_with(unseen):
    """`sphere-spot` with a number of rings behind the camera."""
    described = sphere_spot()
    for number in range(unseen):
        where = (0.73 * (number % 7) - 2.3, -9.7 - 0.61 * (number // 7), 1.3)
        ring = placed(torus(0.29, 0.071, (31, 17)), where, rotation((0.3, 1, 0.2), 23.0 * number))
        described[f"unseen-{number}"] = mitsuba_mesh(f"unseen-{number}", ring, (0.31, 0.37, 0.41))
    scene = mi.load_dict(described)
    resize(scene, (16, 12))
    return read_scene(scene)


@pytest.mark.claim("not-needed-costs-nothing")
def test_unseen_occluders_leave_no_plane(variant):
    """41 rings behind the camera: the planes of the frame are those of the sphere and the floor alone."""
    scenes = [sphere_spot_with(unseen) for unseen in (41, 0)]
    more, less = (prepared(scene, Configuration("shadow-planes", "exact")).prepare(scene)[0] for scene in scenes)
    for name in ("start", "entries", "lines", "spans", "ends", "layers"):
        np.testing.assert_array_equal(np.array(getattr(more, name)), np.array(getattr(less, name)), err_msg=name)
