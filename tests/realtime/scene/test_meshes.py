# SPDX-License-Identifier: BSD-3-Clause
"""Meshes: which are closed, what is said of their flaws, and that their
table shades as Mitsuba does.
"""

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.frame.image import render_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.methods.registry import METHODS
from airlight.realtime.scene.mesh_adjacency import make_occluders, read_occluders
from airlight.realtime.scene.read_scene import read_scene
from tests.helpers.occluders import AWKWARD, SOUND, closed_sphere
from tests.helpers.scenes import tiny_scene


def occluders_of(*meshes):
    return make_occluders([(f"mesh {number}", *mesh) for number, mesh in enumerate(meshes)])


@pytest.mark.parametrize("name", SOUND)
def test_sound_meshes_are_closed_and_in_silence(name):
    occluders = occluders_of(SOUND[name]())
    assert occluders.closed.all()
    assert occluders.warnings == ()
    assert not occluders.incidence.sum(axis=1).any()
    assert len(occluders.edges) == 3 * len(occluders.triangles) // 2


@pytest.mark.claim("flawed-meshes-warn")
@pytest.mark.parametrize(
    ("name", "closed", "words"),
    [
        ("open grid", False, "is open"),
        ("open cylinder", False, "is open"),
        ("Moebius strip", False, "is open"),
        ("mixed winding", False, "run both ways round"),
        ("boxes sharing an edge", True, "1 edges at which more than two triangles meet"),
        ("doubled faces", True, "7 repeated triangles"),
        ("degenerate faces", True, None),
        ("sliver", True, None),
        ("inside out", True, None),
    ],
)
def test_flaws_are_named(name, closed, words):
    occluders = occluders_of(AWKWARD[name]())
    assert bool(occluders.closed.all()) is closed
    if words is None:
        assert occluders.warnings == ()
    else:
        assert any(words in warning and "'mesh 0'" in warning for warning in occluders.warnings)


def test_seams_are_closed_and_shapes_kept_apart():
    """Every triangle has vertices of its own, as where texture coordinates differ."""
    vertices, faces = closed_sphere(1)
    seams = (vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3))
    occluders = occluders_of(seams, seams)
    assert occluders.closed.tolist() == [True, True]
    assert len(occluders.vertices) == 2 * len(vertices)
    assert np.all(occluders.triangles[: len(faces)] < len(vertices))
    assert np.all(occluders.triangles[len(faces) :] >= len(vertices))


@pytest.mark.claim("shapes-without-edges-refused")
def test_shapes_without_triangles_are_refused_by_name(variant):
    with pytest.raises(InputError, match=r"shape 'ball' is a sphere.*replace it by a mesh"):
        read_occluders(mi.load_dict(tiny_scene()))


def test_what_lets_light_pass_casts_no_shadow(variant):
    veil = {"type": "cube", "to_world": mi.ScalarTransform4f().scale(0.3), "bsdf": {"type": "null"}}
    occluders = read_occluders(mi.load_dict(tiny_scene(ball=None, veil=veil)))
    assert len(occluders.triangles) == 2


# The table of triangles ---------------------------------------------------------------------------


def shaded(scene, *, table: bool):
    """Render the surfaces of a scene with its table of triangles, or
    with Mitsuba's interactions.
    """
    read = read_scene(mi.load_dict(scene))
    return read, render_frame(
        frame_renderer(read if table else replace(read, facets=None), METHODS["ray-march"], steps=1)
    )


def mesh_scene(**changes):
    """Return a scene of meshes only, seen from inside a box that is lit
    from both sides or from one.
    """
    frame = (
        mi.ScalarTransform4f().translate([0.1, 0.3, 0.4]).rotate([0.36, 0.48, 0.8], 37).scale(0.37)
    )
    surface = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.3, 0.5, 0.7]}}
    both = {
        "type": "twosided",
        "inner": {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.6, 0.2, 0.4]}},
    }
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
    """A corner's normal leans over: shading is smooth, with normals of unit
    length between the corners.
    """
    flake = mi.Mesh("flake", 3, 1, has_vertex_normals=True)
    parameters = mi.traverse(flake)
    parameters["vertex_positions"] = [-1.5, -1.5, 0.2, 1.5, -1.5, 0.2, 0, 1.5, 0.2]
    parameters["vertex_normals"] = [0, 0, 1, 0, 0, 1, np.sin(tilt), 0, np.cos(tilt)]
    parameters["faces"] = [0, 1, 2]
    parameters.update()
    read, by_table = shaded(mesh_scene(flake=flake), table=True)
    _, by_mitsuba = shaded(mesh_scene(flake=flake), table=False)
    assert read.facets.smooth == (tilt > 0)
    # Normals are of float32, shadow rays at an edge start from a point that
    # differs in the last bit.
    same = np.isclose(by_table.surface, by_mitsuba.surface, rtol=2e-5, atol=0).all(axis=2)
    assert same.mean() > 0.995
