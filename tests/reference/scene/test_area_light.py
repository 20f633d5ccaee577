# SPDX-License-Identifier: BSD-3-Clause
"""Area lights are read as they are, and what has no reference is refused by the name of its shape."""

import mitsuba as mi
import numpy as np
import pytest

from analytic.errors import InputError
from reference.scene.area_light import triangle_normals
from reference.scene.read import read_reference
from tests.helpers.area_lights import NULL, lamp, lit_scene, mesh_lamp
from validation.scenes import meshes


def placed(scale=(0.5, 0.25, 1.0), turn=37.0, move=(0.1, 0.2, 3.0)):
    return mi.ScalarTransform4f().translate(list(move)).rotate([0.6, 0.0, 0.8], turn).scale(list(scale))


def light_of(**shape):
    return read_reference(lit_scene(lamp=lamp(**shape))).area[0]


def test_rectangle_has_its_sides_normal_and_power(variant):
    light = light_of(kind="rectangle", to_world=placed())
    assert (light.kind, light.name, light.opaque) == ("rectangle", "lamp", True)
    assert light.centre == pytest.approx([0.1, 0.2, 3.0], rel=1e-6)
    assert light.half == pytest.approx([0.5, 0.25], rel=1e-6)
    assert light.frame @ light.frame.T == pytest.approx(np.eye(3), abs=1e-12)
    corner = light.centre + light.half @ light.frame[:2]
    assert corner == pytest.approx(np.array(placed() @ mi.ScalarPoint3f(1, 1, 0)).ravel(), abs=1e-6)
    assert light.power == pytest.approx(np.pi * 0.5 * np.array([3, 2, 1]), rel=1e-6)


@pytest.mark.parametrize("kind", ["rectangle", "disk"])
@pytest.mark.parametrize("change", [{}, {"flip_normals": True}, {"mirror": (-1, 1, 1)}, {"mirror": (1, 1, -1)}])
def test_normal_is_that_of_the_side_that_mitsuba_lets_emit(variant, kind, change):
    mirror = np.array(change.get("mirror", (1, 1, 1)))
    shape = {"flip_normals": True} if "flip_normals" in change else {}
    scene = lit_scene(lamp=lamp(kind, to_world=placed(scale=(0.5 * mirror).tolist()), **shape))
    light = read_reference(scene).area[0]
    for side in (1, -1):
        ray = mi.Ray3f(mi.Point3f(light.centre + side * light.normal), mi.Vector3f(-side * light.normal))
        hit = scene.ray_intersect(ray)
        assert (np.array(hit.emitter(scene).eval(hit)).max() > 0) == (side > 0)


def test_disk_and_sphere_have_radius_area_and_power(variant):
    disk = light_of(kind="disk", to_world=placed((0.3, 0.3, 1.0)), bsdf=NULL)
    assert (disk.opaque, disk.radius) == (False, pytest.approx(0.3, rel=1e-6))
    assert disk.area == pytest.approx(np.pi * 0.09, rel=1e-6)
    sphere = light_of(kind="sphere", center=[0.1, 0.2, 3.0], radius=0.7)
    assert (sphere.radius, sphere.centre[2]) == (pytest.approx(0.7, rel=1e-6), pytest.approx(3.0))
    assert sphere.area == pytest.approx(4 * np.pi * 0.49, rel=1e-6)


@pytest.mark.parametrize("flipped", [False, True])
def test_a_mesh_shines_on_the_side_that_mitsuba_lets_emit(variant, flipped):
    scene = lit_scene(lamp=mesh_lamp(meshes.placed(meshes.icosphere(1), (0.1, 0.2, 4.0)), flipped=flipped))
    light = read_reference(scene).area[0]
    assert (light.kind, light.name, light.shadows_itself) == ("mesh", "lamp", flipped)
    normal = triangle_normals(light.triangles)
    middle = light.triangles.mean(axis=1)
    assert np.all((np.sum(normal * (middle - light.centre), axis=1) < 0) == flipped)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    ray = mi.Ray3f(mi.Point3f((middle + 1e-2 * normal).T), mi.Vector3f(-normal.T))
    hit = scene.ray_intersect(ray)
    assert (np.array(hit.emitter(scene).eval(hit)) > 0).all()


def refused():
    texture = {"type": "bitmap", "bitmap": mi.Bitmap(np.ones((2, 2, 3), dtype=np.float32)), "raw": True}
    shear = np.eye(4)
    shear[0, 1] = 0.3
    at = {"center": [0.0, 0.0, 5.0]}
    inside = {"interior": {"type": "homogeneous", "sigma_t": 0.3, "albedo": 0.5}}
    return {
        "is a cylinder": lamp("cylinder", to_world=placed()),
        "texture": lamp() | {"emitter": {"type": "area", "radiance": texture}},
        "no area": lamp(to_world=placed((0.0, 1.0, 1.0))),
        "sheared": lamp(to_world=mi.ScalarTransform4f(shear)),
        "different scales": lamp("disk", to_world=placed()),
        "holds the camera": lamp("sphere", center=[0.0, 0.0, 0.3], radius=0.4),
        "inside out": lamp("sphere", flip_normals=True, **at),
        "bounds a medium": lamp("sphere", bsdf=NULL, **inside, **at),
    }


MESSAGES = "is a cylinder, texture, no area, sheared, different scales, holds the camera, inside out, bounds a medium"


@pytest.mark.parametrize("message", MESSAGES.split(", "))
def test_what_has_no_reference_is_refused_by_name(variant, message):
    with pytest.raises(InputError, match=f"light 'lamp'.*{message}.*; wanted"):
        read_reference(lit_scene(lamp=refused()[message]))
