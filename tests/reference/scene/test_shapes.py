# SPDX-License-Identifier: BSD-3-Clause
import mitsuba as mi
import numpy as np
import pytest

from analytic.errors import InputError
from reference.scene.shapes import read_shapes
from tests.helpers.scenes import tiny_scene


@pytest.mark.parametrize("scale", [[2.0, 1.0, 1.0], [1.0, 2.0, 0.5], [-1.5, 1.5, 1.5]])
def test_a_stretched_sphere_is_the_sphere_that_mitsuba_makes_of_it(variant, scale):
    """Mitsuba warns of it, and intersects a sphere whose radius is the first of the scales."""
    turned = mi.ScalarTransform4f().translate([0.3, 0.2, 0.1]).rotate([0.0, 0.6, 0.8], 40.0).scale(scale)
    scene = mi.load_dict({"type": "scene", "ball": {"type": "sphere", "to_world": turned, "flip_normals": True}})
    shapes = read_shapes(scene)
    assert shapes.radius == pytest.approx(abs(scale[0]), rel=1e-6)
    direction = np.random.default_rng(3).normal(size=(3, 50))
    direction /= np.linalg.norm(direction, axis=0)
    start = shapes.centre[0][:, None] + 7 * direction
    hit = scene.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(start), mi.Vector3f(-direction)), coherent=False)
    assert np.array(hit.t) == pytest.approx(7 - shapes.radius.item(), rel=1e-5)


def test_shapes_are_sorted_and_others_refused_by_name(variant):
    disk = {"type": "disk", "to_world": mi.ScalarTransform4f().translate([0, 0, 3])}
    shapes = read_shapes(mi.load_dict(tiny_scene(lid=disk)))
    assert shapes.triangles.shape == (2, 3, 3)
    assert shapes.centre == pytest.approx(np.array([[0.1, 0.1, 0.7]]), rel=1e-6)
    assert shapes.disks.centre == pytest.approx(np.array([[0.0, 0.0, 3.0]]))
    with pytest.raises(InputError, match="'lid' is a cylinder; wanted meshes, rectangles, spheres and disks"):
        read_shapes(mi.load_dict(tiny_scene(lid=disk | {"type": "cylinder"})))
    oval = disk | {"to_world": mi.ScalarTransform4f().scale([1.0, 2.0, 1.0])}
    with pytest.raises(InputError, match="'lid' is an oval disk"):
        read_shapes(mi.load_dict(tiny_scene(lid=oval)))
