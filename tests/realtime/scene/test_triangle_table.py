# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

from realtime.frame.renderer import frame_renderer, render_frame
from realtime.methods.registry import METHODS
from realtime.scene.read_scene import read_scene
from tests.helpers.scenes import tiny_scene


def shaded(scene, *, table: bool):
    """Render the surfaces of a scene with its table of triangles, or with Mitsuba's interactions."""
    read = read_scene(mi.load_dict(scene))
    return read, render_frame(
        frame_renderer(read if table else replace(read, facets=None), METHODS["ray-march"], steps=1)
    )


def mesh_scene(**changes):
    """Return a scene of meshes only, seen from inside a box that is lit from both sides or from one."""
    frame = mi.ScalarTransform4f().translate([0.1, 0.3, 0.4]).rotate([0.36, 0.48, 0.8], 37).scale(0.37)
    surface = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.3, 0.5, 0.7]}}
    both = {"type": "twosided", "inner": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.6, 0.2, 0.4]}}}
    cube = {"type": "cube", "to_world": frame, "bsdf": both}
    floor = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(3), "bsdf": surface}
    return tiny_scene(size=(48, 36), ball=None, floor=floor, box=cube, **changes)


def test_the_table_shades_as_mitsuba_does(variant):
    read, by_table = shaded(mesh_scene(), table=True)
    _, by_mitsuba = shaded(mesh_scene(), table=False)
    assert read.facets is not None
    assert by_mitsuba.surface.max() > 0
    assert np.array_equal(by_table.distance, by_mitsuba.distance)
    same = np.isclose(by_table.surface, by_mitsuba.surface, rtol=1e-5, atol=0).all(axis=2)
    # Shadow rays of pixels at a shadow's edge start from a point that differs in the last bit.
    assert same.mean() > 0.995


@pytest.mark.parametrize("tilt", [0.4, 0.0])
def test_normals_of_corners_are_interpolated(variant, tilt):
    """A corner's normal leans over: shading is smooth, with normals of unit length between the corners."""
    flake = mi.Mesh("flake", 3, 1, has_vertex_normals=True)
    parameters = mi.traverse(flake)
    parameters["vertex_positions"] = [-1.5, -1.5, 0.2, 1.5, -1.5, 0.2, 0, 1.5, 0.2]
    parameters["vertex_normals"] = [0, 0, 1, 0, 0, 1, np.sin(tilt), 0, np.cos(tilt)]
    parameters["faces"] = [0, 1, 2]
    parameters.update()
    read, by_table = shaded(mesh_scene(flake=flake), table=True)
    _, by_mitsuba = shaded(mesh_scene(flake=flake), table=False)
    assert read.facets.smooth == (tilt > 0)
    # Normals are of float32, shadow rays at an edge start from a point that differs in the last bit.
    same = np.isclose(by_table.surface, by_mitsuba.surface, rtol=2e-5, atol=0).all(axis=2)
    assert same.mean() > 0.995
