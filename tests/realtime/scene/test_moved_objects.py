# SPDX-License-Identifier: BSD-3-Clause
"""Shapes that moved: images are those of a file with the same shapes there."""

import mitsuba as mi
import numpy as np
import pytest

from realtime.frame.renderer import render_frame
from realtime.scene.animate import read_objects, turned_objects
from realtime.scene.read_scene import read_scene
from tests.helpers.scenes import tiny_scene
from validation.scenes.meshes import grid, icosphere, rotation
from validation.scenes.parts import mitsuba_mesh
from validation.study.configuration import configuration, prepared
from validation.study.ladders import bumpy

TURN = rotation((0.3, -0.2, 1), 71.0)


def bumpy_ball(turn=None, *, normals: bool):
    """A closed mesh that no turn maps to itself, turned about the middle of its bounding box as it was.

    Its normals, if it has any, are arbitrary and not those that Mitsuba would compute.
    """

    sphere, faces = icosphere(3)
    vertices = 0.31 * bumpy(sphere, np.full(3, -1.0), 3.5) * (1.0, 0.6, 1.3) + np.array([0.13, -0.07, 0.73])
    vertices = vertices.astype(np.float32).astype(np.float64)
    turn = np.eye(3) if turn is None else turn
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    mesh = mi.Mesh("ball", len(vertices), len(faces), has_vertex_normals=normals)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = ((vertices - middle) @ turn.T + middle).astype(np.float32).ravel()
    parameters["faces"] = faces.astype(np.uint32).ravel()
    if normals:
        parameters["vertex_normals"] = (sphere @ turn.T).astype(np.float32).ravel()
    parameters.update()
    return mesh


def floor():
    return mitsuba_mesh("floor", grid((-3.1, -3.3, -0.03), (6.7, 0, 0), (0, 6.1, 0), (2, 2)), (0.5, 0.6, 0.4))


def read(turn=None, *, normals: bool = False):
    parts = {"ball": bumpy_ball(turn, normals=normals), "floor": floor()}
    return read_scene(mi.load_dict(tiny_scene(size=(48, 36), **parts)))


def image(scene, method: str, parameters):
    return render_frame(prepared(scene, configuration(method, None, parameters)))


@pytest.mark.parametrize(
    ("method", "parameters", "normals"), [("shadow-planes", {}, True), ("light-volumes", {"map": 64}, False)]
)
def test_moved_objects_are_those_of_a_file_with_the_object_moved(variant, method, parameters, normals):
    """Rays, normals, shadows on surfaces and in the fog."""
    scene = read(normals=normals)
    before = image(scene, method, parameters)  # moved vertices move in this scene too
    objects = read_objects(scene, ["ball"])
    moved, loaded = turned_objects(scene, objects, TURN), read(TURN, normals=normals)
    here, there = (image(each, method, parameters) for each in (moved, loaded))
    for name in ("airlight", "surface"):
        old, ours, theirs = (getattr(frame, name) for frame in (before, here, there))
        scale = theirs.mean()
        assert np.mean(np.abs(old - theirs).max(axis=-1) > 1e-2 * scale) > 0.02  # what moved is seen
        # Rays and vertices are rounded to float32: 1e-6 of a distance. Beside an edge, of the object or of its shadow,
        # a ray or a sample of it is on the other side, in a few pixels.
        same = np.isclose(ours, theirs, rtol=1e-4, atol=1e-4 * scale).all(axis=-1)
        assert np.mean(~same) < 0.01
