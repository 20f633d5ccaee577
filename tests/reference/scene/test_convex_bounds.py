# SPDX-License-Identifier: BSD-3-Clause
import mitsuba as mi
import numpy as np
import pytest

from analytic.errors import InputError
from reference.scene.convex_bounds import Polyhedron, read_bounds
from reference.scene.read import read_reference
from tests.helpers.scenes import bounded_medium, clear_scene
from tests.helpers.shapes import bounds_of, box, sphere

GREY = (0.7, 0.7, 0.7)


def mesh(vertices, faces):
    properties = mi.Properties()
    properties["mesh_bsdf"] = mi.load_dict({"type": "null"})
    properties["interior"] = mi.load_dict({"type": "homogeneous", "sigma_t": 0.3, "albedo": 0.5})
    result = mi.Mesh("odd", vertex_count=len(vertices), face_count=len(faces), props=properties)
    parameters = mi.traverse(result)
    parameters["vertex_positions"] = np.asarray(vertices, dtype=np.float32).ravel()
    parameters["faces"] = np.asarray(faces, dtype=np.uint32).ravel()
    parameters.update()
    return result


def test_cube_has_six_planes_and_twelve_edges_that_bend(variant):
    bounds = bounds_of(box((0.1, 0.2, 0.3), (0.4, 0.5, 0.6)))
    assert isinstance(bounds, Polyhedron)
    assert len(bounds.edge) == 12
    assert sorted({tuple(np.round(n, 6)) for n in bounds.normal}) == sorted(
        map(tuple, np.vstack([np.eye(3), -np.eye(3)]))
    )
    assert np.all(bounds.normal @ [0.1, 0.2, 0.3] < bounds.offset)


L_SHAPE = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]


def prism(outline):
    """Vertices and faces of an upright prism; the fan from the first corner covers the L as well."""
    n = len(outline)
    vertices = [(*p, 0) for p in outline] + [(*p, 1) for p in outline]
    sides = [f for i in range(n) for f in ((i, (i + 1) % n, n + (i + 1) % n), (i, n + (i + 1) % n, n + i))]
    fan = [(0, i + 1, i) for i in range(1, n - 1)] + [(n, n + i, n + i + 1) for i in range(1, n - 1)]
    return vertices, sides + fan


@pytest.mark.claim("media-refused")
def test_refused_meshes(variant):
    square, faces = prism([(0, 0), (1, 0), (1, 1), (0, 1)])
    assert isinstance(read_bounds(mesh(square, faces)), Polyhedron)
    with pytest.raises(InputError, match="bounds a medium and is not convex"):
        read_bounds(mesh(*prism(L_SHAPE)))
    with pytest.raises(InputError, match="bounds a medium and is not a closed surface"):
        read_bounds(mesh(square, faces[:-1]))
    with pytest.raises(InputError, match="bounds a medium and is inside out"):
        read_bounds(mesh(square, [face[::-1] for face in faces]))
    with pytest.raises(InputError, match="is a rectangle"):
        bounds_of({"type": "rectangle"})
    with pytest.raises(InputError, match="inside out"):
        bounds_of(sphere() | {"flip_normals": True})


def glass(shape):
    return bounded_medium(shape, 0.3, GREY) | {"bsdf": {"type": "dielectric"}}


AMBIENT = {"type": "homogeneous", "sigma_t": 0.2, "albedo": 0.5}


@pytest.mark.claim("media-refused")
@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (lambda: {"a": glass(box())}, "'a' bounds a medium and has a SmoothDielectric material"),
        (lambda: {"a": bounded_medium(box((0, -4.0, 1.0)), 0.3, GREY)}, "the camera is inside of shape 'a'"),
        (lambda: {"a": bounded_medium(box(), 0.3, GREY) | {"exterior": AMBIENT}}, "exterior medium of shape 'a'"),
        (lambda: {"a": box() | {"bsdf": {"type": "null"}, "exterior": AMBIENT}}, "'a' is a hole in a medium"),
        (lambda: {"a": box() | {"bsdf": {"type": "mask", "opacity": 0.5, "nested": {"type": "diffuse"}}}}, "partly"),
        (lambda: {"a": bounded_medium({"type": "cylinder"}, 0.3, GREY)}, "is a cylinder"),
        (lambda: {}, "references no medium"),
    ],
)
def test_refused_scenes(variant, changes, message):
    with pytest.raises(InputError, match=message):
        read_reference(mi.load_dict(clear_scene(size=(4, 3), **changes())))
