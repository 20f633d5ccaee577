# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import replace

import numpy as np
import pytest

from realtime.methods.shadow_planes.plane_counts import caster_plan, describe_casters


def read(name):
    from realtime.scene.read_scene import read_scene
    from validation.scenes.loading import load_scene

    return read_scene(load_scene(name, (16, 12)).scene)


def test_the_sphere_has_32_edges_and_the_floor_4(variant):
    plan = caster_plan(read("sphere-spot"))
    assert (plan.shapes, plan.components, plan.closed, plan.triangles) == (2, 2, 1, 2 * 32 * 17 + 2)
    assert plan.lights[0].edges == 36
    assert len(plan.warnings) == 1
    assert "'floor' is open" in plan.warnings[0]


@pytest.mark.claim("culled-casters")
def test_what_is_left_out_is_said(variant):
    """Behind the camera nothing of the pens' shadows can be seen: the light is turned to the other side."""
    import drjit as dr

    scene = read("two-pens")
    seen = caster_plan(scene).lights[0]
    origin, forward = (np.array(v, dtype=np.float64).ravel() for v in (scene.camera.origin, scene.camera.forward))
    beyond = origin + 40 * forward / np.linalg.norm(forward)
    position = type(scene.lights[0].position)(*beyond.tolist())
    dr.make_opaque(position)
    away = replace(scene.camera, forward=-scene.camera.forward, origin=type(scene.camera.origin)(0.4, -90.0, 1.3))
    moved = replace(scene, camera=away)
    plan = caster_plan(moved)
    assert seen.components == 4
    assert plan.lights[0].components < seen.components
    assert plan.lights[0].edges == seen.edges
    assert plan.lights[0].planes < seen.planes
    assert "left out" in describe_casters(plan)["planes"]


def test_no_casters_no_planes(variant):
    plan = caster_plan(read("open-fog"))
    assert plan.triangles == plan.components == 0
    assert describe_casters(plan)["casters"].startswith("none")
