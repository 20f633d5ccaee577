# SPDX-License-Identifier: BSD-3-Clause
import json
import struct

import mitsuba as mi
import numpy as np
import pytest
import trimesh

from airlight.reports.interchange.gltf import write_gltf
from airlight.reports.interchange.meshes import SIDES, shape_mesh
from airlight.validation.scenes.loading import LoadedScene, load_scene
from tests.helpers.area_lights import lamp
from tests.helpers.scenes import spot, tiny_scene


def loaded(**changes):
    return LoadedScene("tiny", mi.load_dict(tiny_scene(**changes)), "A tiny scene.", "")


def parts(path):
    """Return the JSON and the binary part of a .glb file, its framing checked."""
    data = path.read_bytes()
    magic, version, length = struct.unpack("<4sII", data[:12])
    assert (magic, version, length) == (b"glTF", 2, len(data))
    chunks, place = [], 12
    while place < len(data):
        size, kind = struct.unpack("<I4s", data[place : place + 8])
        assert size % 4 == 0
        chunks.append((kind, data[place + 8 : place + 8 + size]))
        place += 8 + size
    assert [kind for kind, _ in chunks] == [b"JSON", b"BIN\0"][: len(chunks)]
    return json.loads(chunks[0][1]), chunks[1][1] if len(chunks) > 1 else b""


def project(document, points):
    """Return where points of glTF's world are in the image, in fractions of its
    size from the upper left.
    """
    node = next(node for node in document["nodes"] if "camera" in node)
    lens = document["cameras"][node["camera"]]["perspective"]
    matrix = np.array(node["matrix"]).reshape(4, 4).T
    x, y, z = ((points - matrix[:3, 3]) @ matrix[:3, :3]).T
    half = np.tan(lens["yfov"] / 2)
    return np.stack(
        [0.5 + 0.5 * x / (-z * half * lens["aspectRatio"]), 0.5 - 0.5 * y / (-z * half)], axis=1
    )


@pytest.mark.claim("gltf", tolerance="1e-6: float32")
@pytest.mark.parametrize("up", [(0, 0, 1), (0.1, -1, 0.2)])
def test_vertices_are_in_the_image_where_mitsuba_has_them(variant, tmp_path, up):
    sensor = tiny_scene(size=(40, 24))["sensor"]
    view = mi.ScalarTransform4f().look_at([0.2, -4.1, 1.3], [0.1, 0.2, 0.6], list(up))
    cube = loaded(
        sensor=sensor | {"to_world": view},
        ball={"type": "cube", "to_world": mi.ScalarTransform4f().scale(0.4)},
    )
    write_gltf(tmp_path / "tiny.glb", cube)
    document, _ = parts(tmp_path / "tiny.glb")
    ball = trimesh.load(tmp_path / "tiny.glb", process=False).geometry["ball"]
    projected = project(document, np.asarray(ball.vertices))
    shape = next(shape for shape in cube.scene.shapes() if shape.id() == "ball")
    interaction = mi.Interaction3f()
    interaction.p = mi.Point3f(
        mi.traverse(shape)["vertex_positions"].numpy().reshape(-1, 3).T.copy()
    )
    sample, _ = cube.scene.sensors()[0].sample_direction(interaction, mi.Point2f(0.5))
    wanted = np.array(sample.uv, dtype=np.float64).T / [40, 24]
    assert wanted.min() > 0
    np.testing.assert_allclose(projected, wanted, atol=1e-6)


@pytest.mark.claim("gltf")
def test_trimesh_reads_it_back(variant, tmp_path):
    scene = load_scene("sphere-spot")
    written = write_gltf(tmp_path / "scene.glb", scene)
    assert written["triangles"] == 1090
    assert written["bytes"] == (tmp_path / "scene.glb").stat().st_size
    assert written["tessellated"] == []
    back = trimesh.load(tmp_path / "scene.glb", process=False)
    assert set(back.geometry) == {"sphere", "floor"}
    sphere = back.geometry["sphere"]
    assert (len(sphere.faces), sphere.is_watertight) == (1088, True)
    assert sphere.volume > 0  # outward normals
    # Biri's sphere, at (0.11, -0.07, 1.93) with z up.
    np.testing.assert_allclose(sphere.bounds.mean(axis=0), [0.11, 1.93, 0.07], atol=2e-3)
    # trimesh keeps a colour in 8 bits.
    np.testing.assert_allclose(
        sphere.visual.material.baseColorFactor[:3] / 255, [0.57, 0.31, 0.23], atol=0.003
    )
    # trimesh takes the aspect ratio for the ratio of the angles of view, so the
    # other one comes back wrong.
    np.testing.assert_allclose(back.camera.fov[1], 39.9394506, rtol=1e-6)
    np.testing.assert_allclose(back.camera_transform[:3, 3], [0.63, 1.87, 5.31], rtol=1e-6)


@pytest.mark.parametrize(("scale", "near"), [(1.0, 1e-3), (1e-4, None)])
def test_the_near_plane_takes_no_small_scene_away(variant, tmp_path, scale, near):
    """It was a millimetre, behind which a scene of half a millimetre lay."""
    place = mi.ScalarTransform4f().look_at([0, -4.1 * scale, 0], [0, 0, 0], [0, 0, 1])
    sensor = tiny_scene()["sensor"] | {"to_world": place}
    ball = {"type": "sphere", "center": [0, 0, 0], "radius": 0.41 * scale}
    bulb = tiny_scene()["lamp"] | {"position": [0.9 * scale, 0, 0]}
    write_gltf(tmp_path / "a.glb", loaded(sensor=sensor, ball=ball, lamp=bulb, floor=None))
    lens = parts(tmp_path / "a.glb")[0]["cameras"][0]["perspective"]
    assert 0 < lens["znear"] < 1e-2 * scale
    assert near is None or lens["znear"] == near


@pytest.mark.claim("gltf")
def test_lights_are_those_of_the_scene(variant, tmp_path):
    scene = loaded(spot=spot(cutoff=40.0, beam=25.0), hard=spot())
    write_gltf(tmp_path / "tiny.glb", scene)
    document, _ = parts(tmp_path / "tiny.glb")
    lights = document["extensions"]["KHR_lights_punctual"]["lights"]
    assert [light["type"] for light in lights] == ["point", "spot", "spot"]
    for light, intensity in zip(lights, ([5, 4, 3], [9, 7, 8], [9, 7, 8])):
        np.testing.assert_allclose(
            light["intensity"] * np.array(light["color"]), intensity, rtol=1e-12
        )
        assert light["extras"]["intensity_w_per_sr"] == intensity
        assert max(light["color"]) == 1
    np.testing.assert_allclose(np.rad2deg(lights[1]["spot"]["innerConeAngle"]), 25, rtol=1e-6)
    np.testing.assert_allclose(np.rad2deg(lights[1]["spot"]["outerConeAngle"]), 40, rtol=1e-6)
    assert 0.999 < lights[2]["spot"]["innerConeAngle"] / lights[2]["spot"]["outerConeAngle"] < 1
    nodes = [
        node for node in document["nodes"] if "KHR_lights_punctual" in node.get("extensions", {})
    ]
    assert [node["extensions"]["KHR_lights_punctual"]["light"] for node in nodes] == [0, 1, 2]
    matrix = np.array(nodes[1]["matrix"]).reshape(4, 4).T
    np.testing.assert_allclose(matrix[:3, 3], [0.7, 2.6, 0.3], rtol=1e-6)
    axis = np.array([0.1, 0.1, 0.4]) - [0.7, -0.3, 2.6]
    axis = (axis / np.linalg.norm(axis))[[0, 2, 1]] * [1, 1, -1]
    np.testing.assert_allclose(-matrix[:3, 2], axis, atol=1e-6)
    np.testing.assert_allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix[:3, :3]) > 0


@pytest.mark.claim("gltf", tolerance="the sagitta of 128 sides")
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(
    ("kind", "flipped"),
    # Mitsuba's cube cannot be turned inside out.
    [
        ("cube", False),
        *(
            (kind, way)
            for kind in ("sphere", "disk", "cylinder", "rectangle")
            for way in (False, True)
        ),
    ],
)
def test_shapes_become_meshes_that_lie_on_them(variant, kind, mirrored, flipped):
    """Rays of Mitsuba meet shape and mesh at the same place, with normals on the same side."""
    place = mi.ScalarTransform4f().translate([0.3, 0.2, -0.1]).rotate([0.6, 0, 0.8], 40).scale(0.7)
    place = place.scale([1, 1, -1 if mirrored else 1])
    entry = {"type": kind, "to_world": place} | ({"flip_normals": True} if flipped else {})
    shape = mi.load_dict(entry)
    mesh = shape_mesh(shape)
    twin = mi.Mesh("twin", vertex_count=len(mesh.vertices), face_count=len(mesh.faces))
    parameters = mi.traverse(twin)
    parameters["vertex_positions"] = mesh.vertices.astype(np.float32).ravel()
    parameters["faces"] = mesh.faces.astype(np.uint32).ravel()
    parameters.update()
    rng = np.random.default_rng(5)
    start = rng.standard_normal((3, 4096))
    start *= 4 / np.linalg.norm(start, axis=0)
    aim = rng.uniform(-0.6, 0.6, (3, 4096)) - start
    ray = mi.Ray3f(mi.Point3f(start), mi.Vector3f(aim / np.linalg.norm(aim, axis=0)))
    scenes = [mi.load_dict({"type": "scene", "shape": surface}) for surface in (shape, twin)]
    hits = [scene.ray_intersect(ray) for scene in scenes]
    distance = [np.array(hit.t, dtype=np.float64) for hit in hits]
    both = np.isfinite(distance[0]) & np.isfinite(distance[1])
    assert both.mean() > 0.05
    # An edge moves by 3e-4 of the radius; rays that graze it meet one of the two.
    assert (np.isfinite(distance[0]) != np.isfinite(distance[1])).mean() < 0.005
    assert mesh.exact == (kind in ("rectangle", "cube"))
    normal = [np.array(hits[0].sh_frame.n), np.array(hits[1].n)]
    cosine = np.abs(np.sum(np.array(ray.d) * normal[0], axis=0))
    steep = both & (cosine > 0.2)
    away = np.abs(distance[0][steep] - distance[1][steep]) * cosine[steep]
    # A sphere is cut along both of its angles. Rays are float32, 4 m from the shape.
    cuts = {"sphere": 2, "cylinder": 1}.get(kind, 0)
    assert away.max() < cuts * (1 - np.cos(np.pi / SIDES)) + 1e-5
    assert (np.sum(normal[0] * normal[1], axis=0)[steep] > 0.99).all()
    if mesh.normals is not None:
        corners = mesh.vertices[mesh.faces]
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert (np.sum(mesh.normals[mesh.faces].mean(axis=1) * area, axis=1) > 0).all()


@pytest.mark.claim("gltf-area-lights", tolerance="1e-6: float32")
def test_a_light_that_reflects_is_one_mesh_and_all_others_keep_their_materials(variant, tmp_path):
    grey = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.5, 0.4, 0.3]}}
    place = mi.ScalarTransform4f().look_at([0.9, 0.7, 1.9], [0.1, -0.5, 0.4], [0, 0, 1])
    # It stands before the others: by their names the parts of a dictionary are in order.
    write_gltf(tmp_path / "tiny.glb", loaded(a_lamp=lamp(bsdf=grey, to_world=place.scale(0.3))))
    document, _ = parts(tmp_path / "tiny.glb")
    names = {
        mesh["name"]: document["materials"][mesh["primitives"][0]["material"]]["name"]
        for mesh in document["meshes"]
    }
    assert names == {"ball": "ball", "floor": "floor", "a_lamp": "light a_lamp"}
    (material,) = (each for each in document["materials"] if each["name"] == "light a_lamp")
    assert material["pbrMetallicRoughness"]["baseColorFactor"] == [0.5, 0.4, 0.3, 1.0]


@pytest.mark.claim("gltf-area-lights", tolerance="1e-6: float32")
@pytest.mark.parametrize(("kind", "flipped"), [("rectangle", True), ("sphere", False)])
def test_a_light_with_extent_is_a_mesh_that_emits_from_the_side_of_its_normal(
    variant, tmp_path, kind, flipped
):
    """Rationale: core glTF has no such light; faces run counter-clockwise
    seen from where it shines.
    """
    scale = {"rectangle": [0.5, 0.3, 1.0], "sphere": [0.3] * 3}[kind]
    transform = (
        mi.ScalarTransform4f().look_at([0.9, 0.7, 1.9], [0.1, -0.5, 0.4], [0, 0, 1]).scale(scale)
    )
    light = lamp(kind, radiance=(5.0, 4.0, 2.5), to_world=transform, flip_normals=flipped)
    write_gltf(tmp_path / "tiny.glb", loaded(lamp=light))
    document, _ = parts(tmp_path / "tiny.glb")
    assert set(document["extensionsUsed"]) == {
        "KHR_materials_specular",
        "KHR_materials_emissive_strength",
    }
    assert "extensions" not in document
    names = [mesh["name"] for mesh in document["meshes"]]
    assert sorted(names) == ["ball", "floor", "lamp"]
    number = names.index("lamp")
    material = document["materials"][document["meshes"][number]["primitives"][0]["material"]]
    assert material["emissiveFactor"] == [1.0, 0.8, 0.5]
    assert material["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] == 5.0
    assert "core glTF has no area light" in material["extras"]["note"]
    assert material["extras"]["light"]["radiance"] == [5.0, 4.0, 2.5]
    corners = np.asarray(
        trimesh.load(tmp_path / "tiny.glb", process=False).geometry["lamp"].triangles
    )
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # The sphere is of 128 sides.
    assert 0.5 * np.linalg.norm(across, axis=1).sum() == pytest.approx(
        material["extras"]["light"]["area"], rel=2e-3
    )
    turn = np.array(document["scenes"][0]["extras"]["scene_to_gltf"])
    if kind == "sphere":
        outward = corners.mean(axis=1) - turn @ material["extras"]["light"]["position"]
    else:
        outward = np.broadcast_to(turn @ material["extras"]["light"]["axis"], across.shape)
    assert np.all(np.sum(across * outward, axis=1) > 0)
