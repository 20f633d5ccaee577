# SPDX-License-Identifier: BSD-3-Clause
"""Claim: what a scene does not need costs nothing. No time can say it better than the same kernels and planes."""

import drjit as dr
import pytest

from realtime.frame.renderer import run_stages
from realtime.scene.read_scene import read_scene
from validation.scenes.loading import load_scene
from validation.study.configuration import Configuration, prepared


def kernels(renderer):
    """The kernels of a replayed frame: what each is by its hash, and how many lanes it has."""
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
