# SPDX-License-Identifier: BSD-3-Clause
"""Both sides read the same scene; area lights and clouds are read as they are, rays and
the epsilon are Mitsuba's.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.scene.camera import ray_directions
from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.scene.area_light import triangle_normals
from airlight.reference.scene.camera import film_positions, pixel_centres
from airlight.reference.scene.clouds import read_clouds
from airlight.reference.scene.convex_bounds import Sphere, read_bounds
from airlight.reference.scene.read import read_reference
from airlight.reference.scene.shadow_epsilon import measure_shadow_epsilon
from airlight.reference.scene.shapes import read_shapes
from airlight.validation.scenes import meshes
from airlight.validation.scenes.meshes import icosphere, placed, torus
from airlight.validation.scenes.parts import (
    camera,
    fog,
    medium_boundary,
    mitsuba_mesh,
    point_light,
    sky,
    sun,
)
from tests.helpers.area_lights import NULL, lamp, lit_scene, mesh_lamp
from tests.helpers.lamps import area_lamp
from tests.helpers.scenes import spot, tiny_scene


def test_both_sides_read_the_same_scene(variant):
    """The reference and the methods under test read a scene by routes of their own; the
    numbers must be the same.
    """
    fog = tiny_scene()["fog"] | {"scale": 1.7, "phase": {"type": "hg", "g": -0.31}}
    scene = mi.load_dict(tiny_scene(fog=fog, spot=spot(cutoff=31.0, beam=17.0)))
    reference, other = read_reference(scene), read_scene(scene, "double")
    assert np.array(other.camera.origin).ravel() == pytest.approx(reference.origin)
    direction = np.array(
        ray_directions(other.camera, mi.UInt32(np.arange(reference.width * reference.height)))[0]
    ).T
    assert np.max(np.abs(direction - reference.direction)) < 1e-14
    assert float(other.medium.sigma_t[0][0]) == pytest.approx(reference.medium.sigma_t[0], rel=1e-6)
    assert np.array(other.medium.albedo).ravel() == pytest.approx(reference.medium.albedo, rel=1e-6)
    assert reference.medium.phase.g == pytest.approx(-0.31)
    for mine, theirs in zip(reference.lights, other.lights, strict=True):
        assert mine.position == pytest.approx(np.array(theirs.position).ravel(), rel=1e-6)
        assert mine.intensity == pytest.approx(np.array(theirs.intensity).ravel(), rel=1e-6)
    cone = reference.lights[1]
    assert cone.axis == pytest.approx(np.array(other.lights[1].axis).ravel(), abs=1e-6)
    assert np.rad2deg([cone.cutoff, cone.beam]) == pytest.approx([31, 17])


@pytest.mark.parametrize("scale", [[3.0, 3.0, 3.0], [-1.0, 1.0, 1.0], [0.5, 0.5, -0.5]])
def test_one_scale_and_a_mirror_leave_a_spot_as_it_is(variant, scale):
    """Mitsuba compares angles with the cone, which neither changes; the light
    travels along the image of z.
    """
    plain = spot(cutoff=31.0, beam=17.0)
    turned = plain["to_world"] @ mi.ScalarTransform4f().scale(scale)
    scene = mi.load_dict(tiny_scene(spot=plain | {"to_world": turned}))
    way = np.sign(scale[2]) * np.array([-0.6, 0.4, -2.2]) / np.linalg.norm([-0.6, 0.4, -2.2])
    reference, other = read_reference(scene).lights[1], read_scene(scene).lights[1]
    np.testing.assert_allclose(reference.axis, way, atol=1e-6)
    np.testing.assert_allclose(np.ravel(other.axis), way, atol=1e-6)
    # Mitsuba's own answer 27 degrees off the axis, in the cone's edge.
    side = np.cross(way, [0, 1, 0]) / np.linalg.norm(np.cross(way, [0, 1, 0]))
    angle = np.deg2rad(27)
    interaction = dr.zeros(mi.Interaction3f)
    interaction.p = mi.Point3f(
        (reference.position + 8 * (np.cos(angle) * way + np.sin(angle) * side)).tolist()
    )
    arriving = np.ravel(scene.emitters()[1].sample_direction(interaction, mi.Point2f(0.5))[1]) * 64
    fraction = (reference.cutoff - angle) / (reference.cutoff - reference.beam)
    np.testing.assert_allclose(arriving, fraction * reference.intensity, rtol=1e-4)


@pytest.mark.claim("pixel-centre", tolerance="5e-7: Mitsuba's float32 matrices")
@pytest.mark.parametrize("principal", [(0.0, 0.0), (0.13, -0.07)])
def test_rays_are_those_of_mitsuba(variant, principal):
    size = (33, 21)
    scene = mi.load_dict(tiny_scene(size=size))
    parameters = mi.traverse(scene.sensors()[0])
    for axis, offset in zip("xy", principal):
        parameters[f"principal_point_offset_{axis}"] = offset
    parameters.update()
    reference = read_reference(scene)
    position = pixel_centres(size)
    film = mi.Point2f(*(position / size).T)
    ray, _ = scene.sensors()[0].sample_ray(0.0, 0.5, film, mi.Point2f(0.5))
    # float32 matrices on Mitsuba's side
    assert np.max(np.abs(np.array(ray.d).T - reference.direction)) < 5e-7
    found = film_positions(
        scene.sensors()[0], np.concatenate([3 * reference.direction, -reference.direction]), size
    )
    np.testing.assert_allclose(found[: len(position)], position, rtol=0, atol=1e-11)
    assert np.isnan(found[len(position) :]).all()


@pytest.mark.claim("shadow-ray-epsilon")
def test_equals_mitsubas_constant(variant):
    # maxt is rounded to float32, half a unit in the last place of a number just
    # below 2: 6e-8, relative to 2
    assert measure_shadow_epsilon() == pytest.approx(mi.math.ShadowEpsilon, abs=6e-8)


@pytest.mark.parametrize("scale", [[2.0, 1.0, 1.0], [1.0, 2.0, 0.5], [-1.5, 1.5, 1.5]])
def test_a_stretched_sphere_is_the_sphere_that_mitsuba_makes_of_it(variant, scale):
    """Mitsuba warns of it, and intersects a sphere whose radius is the first of the scales."""
    turned = (
        mi.ScalarTransform4f().translate([0.3, 0.2, 0.1]).rotate([0.0, 0.6, 0.8], 40.0).scale(scale)
    )
    scene = mi.load_dict(
        {"type": "scene", "ball": {"type": "sphere", "to_world": turned, "flip_normals": True}}
    )
    shapes = read_shapes(scene)
    assert shapes.radius == pytest.approx(abs(scale[0]), rel=1e-6)
    direction = np.random.default_rng(3).normal(size=(3, 50))
    direction /= np.linalg.norm(direction, axis=0)
    start = shapes.centre[0][:, None] + 7 * direction
    hit = scene.ray_intersect_preliminary(
        mi.Ray3f(mi.Point3f(start), mi.Vector3f(-direction)), coherent=False
    )
    assert np.array(hit.t) == pytest.approx(7 - shapes.radius.item(), rel=1e-5)


def test_a_sphere_of_fog_has_the_radius_of_its_surface(variant):
    """Scales that differ by rounding: Mitsuba takes the first."""
    to_world = mi.ScalarTransform4f().scale([2.0, 2.000015, 2.000015])
    shape = mi.load_dict({"type": "sphere", "to_world": to_world})
    bounds = read_bounds(shape)
    assert isinstance(bounds, Sphere)
    assert bounds.radius == pytest.approx(2.0, rel=1e-7)


def test_shapes_keep_their_names(variant):
    """Names that are no keys of a dictionary became numbers in messages."""
    nothing = {"type": "sphere", "bsdf": {"type": "null"}}
    scene = mi.load_dict(tiny_scene(nothing=nothing))
    for number, shape in enumerate(scene.shapes()):
        shape.set_id(f"wall.{number}")
    read_reference(scene)
    assert [shape.id() for shape in scene.shapes()] == ["wall.0", "wall.1", "wall.2"]


def test_shapes_are_sorted_and_others_refused_by_name(variant):
    disk = {"type": "disk", "to_world": mi.ScalarTransform4f().translate([0, 0, 3])}
    shapes = read_shapes(mi.load_dict(tiny_scene(lid=disk)))
    assert shapes.triangles.shape == (2, 3, 3)
    assert shapes.centre == pytest.approx(np.array([[0.1, 0.1, 0.7]]), rel=1e-6)
    assert shapes.disks.centre == pytest.approx(np.array([[0.0, 0.0, 3.0]]))
    with pytest.raises(
        InputError, match="'lid' is a cylinder; expected meshes, rectangles, spheres and disks"
    ):
        read_shapes(mi.load_dict(tiny_scene(lid=disk | {"type": "cylinder"})))
    oval = disk | {"to_world": mi.ScalarTransform4f().scale([1.0, 2.0, 1.0])}
    with pytest.raises(InputError, match="'lid' is an oval disk"):
        read_shapes(mi.load_dict(tiny_scene(lid=oval)))


# Area lights --------------------------------------------------------------------------------------


def place(scale=(0.5, 0.25, 1.0), turn=37.0, move=(0.1, 0.2, 3.0)):
    return (
        mi.ScalarTransform4f()
        .translate(list(move))
        .rotate([0.6, 0.0, 0.8], turn)
        .scale(list(scale))
    )


@pytest.mark.parametrize(
    ("kind", "size", "area"),
    [
        ("rectangle", (0.31, 0.17), 4 * 0.31 * 0.17),
        ("disk", 0.29, np.pi * 0.29**2),
        ("sphere", 0.23, 4 * np.pi * 0.23**2),
    ],
)
def test_both_sides_read_the_same_area_light(variant, kind, size, area):
    """Its place, sides, area and power, by hand."""
    scene = mi.load_dict(tiny_scene(lamp=area_lamp(kind, size=size)))
    light, other = read_reference(scene).area[0], read_scene(scene).area_lights[0]
    for each, middle in ((light, light.centre), (other, other.middle)):
        assert (each.name, each.kind, each.opaque) == ("lamp", kind, True)
        assert each.area == pytest.approx(area, rel=1e-6)
        np.testing.assert_allclose(each.power, np.pi * area * np.array([5.3, 4.1, 2.9]), rtol=1e-6)
        np.testing.assert_allclose(middle, [0.83, 0.61, 1.97], rtol=1e-6)
        if kind != "sphere":
            toward = np.array([0.13, 0.07, 0.31]) - middle
            np.testing.assert_allclose(each.normal, toward / np.linalg.norm(toward), atol=1e-6)
    if kind == "rectangle":
        assert light.half == pytest.approx(size, rel=1e-6)
        corner = light.centre + light.half @ light.frame[:2]
        corners = (
            other.middle
            + np.array([1, -1])[:, None, None] * other.across
            + np.array([1, -1])[:, None] * other.up
        )
        assert np.abs(corners - corner).max(axis=-1).min() < 1e-6
    else:
        assert light.radius == pytest.approx(size, rel=1e-6)
    clear = mi.load_dict(tiny_scene(lamp=area_lamp(kind, size=size, material=NULL)))
    assert not read_reference(clear).area[0].opaque


@pytest.mark.parametrize("kind", ["rectangle", "disk"])
@pytest.mark.parametrize(
    "change", [{}, {"flip_normals": True}, {"mirror": (-1, 1, 1)}, {"mirror": (1, 1, -1)}]
)
def test_normal_is_that_of_the_side_that_mitsuba_lets_emit(variant, kind, change):
    mirror = np.array(change.get("mirror", (1, 1, 1)))
    shape = {"flip_normals": True} if "flip_normals" in change else {}
    scene = lit_scene(lamp=lamp(kind, to_world=place(scale=(0.5 * mirror).tolist()), **shape))
    light = read_reference(scene).area[0]
    for side in (1, -1):
        ray = mi.Ray3f(
            mi.Point3f(light.centre + side * light.normal), mi.Vector3f(-side * light.normal)
        )
        hit = scene.ray_intersect(ray)
        assert (np.array(hit.emitter(scene).eval(hit)).max() > 0) == (side > 0)


@pytest.mark.parametrize("flipped", [False, True])
def test_a_mesh_shines_on_the_side_that_mitsuba_lets_emit(variant, flipped):
    scene = lit_scene(
        lamp=mesh_lamp(meshes.placed(meshes.icosphere(1), (0.1, 0.2, 4.0)), flipped=flipped)
    )
    light = read_reference(scene).area[0]
    assert (light.kind, light.name, light.shadows_itself) == ("mesh", "lamp", flipped)
    normal = triangle_normals(light.triangles)
    middle = light.triangles.mean(axis=1)
    assert np.all((np.sum(normal * (middle - light.centre), axis=1) < 0) == flipped)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    ray = mi.Ray3f(mi.Point3f((middle + 1e-2 * normal).T), mi.Vector3f(-normal.T))
    hit = scene.ray_intersect(ray)
    assert (np.array(hit.emitter(scene).eval(hit)) > 0).all()


# Clouds -------------------------------------------------------------------------------------------


def cloud(mesh, name="puff"):
    return medium_boundary(name, mesh, fog(0.7, (0.9, 0.9, 0.9)))


def read_clouds_of(**parts):
    usual = {
        "sensor": camera((0.3, -7.1, 0.7), (0, 0, 0), fov=41.0, size=(4, 3), in_fog=False),
        "sun": sun((0.1, 0.2, -0.9), (1.3, 1.1, 0.9)),
    }
    return read_clouds(
        mi.load_dict(
            {"type": "scene"} | {k: v for k, v in (usual | parts).items() if v is not None}
        )
    )


def test_non_convex_and_several_clouds_are_read(variant):
    clouds = read_clouds_of(
        a=cloud(torus(0.9, 0.3, (17, 9)), "a"), b=cloud(placed(icosphere(1), (2.9, 0, 0)), "b")
    )
    assert [each.name for each in clouds.clouds] == ["a", "b"]
    assert clouds.camera_cloud == -1
    inside = read_clouds_of(puff=cloud(torus(0.9, 0.3, (17, 9))), b=None)
    assert len(inside.suns) == 1


def test_other_lights_and_scenes_without_clouds_are_refused(variant):
    ball = icosphere(1)
    with pytest.raises(InputError, match="light 'lamp' is a PointLight; clouds are lit by"):
        read_clouds_of(puff=cloud(ball), lamp=point_light((0, 0, 4), (1.0, 1.1, 1.2)))
    with pytest.raises(InputError, match="the scene has no cloud"):
        read_clouds_of(a=mitsuba_mesh("solid", ball, (0.3, 0.4, 0.5)))
    with pytest.raises(InputError, match="no light; expected"):
        read_clouds_of(puff=cloud(ball), sun=None)
    np.testing.assert_allclose(
        read_clouds_of(puff=cloud(ball), sky=sky((0.1, 0.2, 0.3))).sky, (0.1, 0.2, 0.3), rtol=1e-6
    )
