# SPDX-License-Identifier: BSD-3-Clause
"""Claim: each form of a scene of the kit is the certified scene, and right renderers pass its
tolerance.
"""

import json
import os
import re
import shutil
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest

import airlight
from airlight.reports.kit.scenes import kit_scenes
from airlight.validation.certified.files import certified_data

SCENES = {scene.name: scene for scene in kit_scenes()}
#: A method of single precision whose shadows are exact in the scene: of spheres by their shadow
#: volumes, of spots with a soft edge by planes.
WITH_SPHERES = ("sphere-shadow", "thick-spheres", "three-spheres", "hard-spot", "many-lights")
#: Scenes that pbrt cannot have; see `pbrt_scene`.
NOT_FOR_PBRT = {"light-behind", "camera-in-shadow", "hard-spot", "soft-spot"}
#: z up of the scene as y up.
TURN = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])


@pytest.fixture(params=SCENES)
def folder(kit, request):
    return kit / "scenes" / request.param


def read(folder):
    return json.loads((folder / "scene.json").read_text())


def expected(folder):
    return np.array([pixel["radiance"] for pixel in read(folder)["pixels"]])


def airlight_of(image):
    return np.asarray(image.airlight, dtype=float).reshape(-1, 3)


@pytest.mark.claim("kit-scenes", tolerance="the certified bound, and 1e-10 of the value")
def test_the_second_route_has_the_expected_pixels(folder):
    """The reference reads the Mitsuba file: other shadows and another quadrature, in float64."""
    value = expected(folder)
    bound = np.array([pixel["bound"] for pixel in read(folder)["pixels"]])
    difference = np.abs(airlight_of(airlight.reference(str(folder / "scene.xml"))) - value)
    assert np.all(difference <= bound + 1e-10 * value)


def test_a_right_renderer_of_single_precision_passes_the_tolerance(folder):
    scene, value = read(folder), expected(folder)
    method = "light-volumes" if folder.name in WITH_SPHERES else "shadow-planes"
    image = airlight_of(airlight.render(str(folder / "scene.xml"), method))
    tolerance = scene["tolerance"]
    allowed = tolerance["of_value"] * value + tolerance["of_mean"] * value.mean()
    assert np.all(np.abs(image - value) < 0.5 * allowed)


@pytest.mark.claim("kit-scenes")
def test_the_numbers_are_the_words_of_the_certified_file(folder):
    certified = json.loads(certified_data().read_text())["scenes"]
    pixels = next(scene for scene in certified if scene["name"] == folder.name)["pixels"]
    words = json.loads((folder / "scene.json").read_text(), parse_float=str, parse_int=str)
    assert len(words["set_up"]) == 10
    assert [pixel["radiance"] for pixel in words["pixels"]] == [
        pixel["radiance"] for pixel in pixels
    ]
    assert [pixel["bound"] for pixel in words["pixels"]] == [pixel["bound"] for pixel in pixels]
    places = [(int(pixel["row"]), int(pixel["column"])) for pixel in words["pixels"]]
    assert places == [divmod(number, 8) for number in range(64)]


def test_pixels_are_rays_of_the_camera(folder):
    scene = read(folder)
    camera = scene["camera"]
    rays = camera_rays(camera["right"], camera["up"], camera["forward"], camera["fov"])
    given = np.array([pixel["direction"] for pixel in scene["pixels"]])
    np.testing.assert_allclose(rays, given, atol=3e-7)  # axes are float32


def camera_rays(right, up, forward, fov):
    """Return the unit directions through the centres of 8 x 8 pixels."""
    half = np.tan(np.deg2rad(fov) / 2)
    side = (np.arange(8) - 3.5) / 4 * half
    x, y = np.meshgrid(side, -side)
    rays = np.array(forward) + x[..., None] * np.array(right) + y[..., None] * np.array(up)
    return (rays / np.linalg.norm(rays, axis=-1, keepdims=True)).reshape(-1, 3)


@pytest.mark.claim("kit-scenes", tolerance="1e-6, float32 numbers of the file")
def test_pbrt_files_are_the_scenes(folder):
    path = folder / "scene.pbrt"
    assert path.exists() == (folder.name not in NOT_FOR_PBRT)
    if path.exists():
        value = expected(folder)
        image = airlight_of(airlight.reference(str(path)))
        assert np.all(np.abs(image - value) <= 1e-6 * value + 1e-9 * value.mean())


def test_gltf_files_have_the_camera_the_lights_and_the_fog(folder):
    scene, data = read(folder), (folder / "scene.glb").read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    document = json.loads(data[20 : 20 + length])
    camera = document["cameras"][0]["perspective"]
    assert np.rad2deg(camera["yfov"]) == pytest.approx(scene["camera"]["fov"], rel=1e-6)
    assert len(document["extensions"]["KHR_lights_punctual"]["lights"]) == len(scene["lights"])
    assert len(document.get("meshes", [])) == len(scene["occluders"])
    medium = document["scenes"][0]["extras"]["medium"]
    assert medium["sigma_t"] == pytest.approx(scene["medium"]["sigma_t"], rel=1e-6)
    assert medium["albedo"] == pytest.approx(scene["medium"]["albedo"], rel=1e-6)


# Godot's files, by a parser of their grammar: sections in brackets, and a value after each name.

SECTION = re.compile(r"\[(\w+)((?: \w+=(?:\"[^\"]*\"|\w+))*)\]")
VALUE = re.compile(r'-?\d+(\.\d+)?(e[+-]\d+)?|true|false|"[^"]*"|(\w+)\((.*)\)')
COUNTS = {"Color": 4, "Vector3": 3, "Vector2": 2, "Vector2i": 2, "Transform3D": 12}


def parsed(path):
    """Return the sections of a `.tscn` file: kind, attributes and properties."""
    sections = []
    for line in filter(None, path.read_text().split("\n")):
        section = SECTION.fullmatch(line)
        if section:
            sections.append((section[1], dict(re.findall(r'(\w+)="?([^" ]*)"?', section[2])), {}))
            continue
        name, value = re.fullmatch(r"(\w+) = (.+)", line).groups()
        match = VALUE.fullmatch(value)
        assert match, line
        if match[3] in COUNTS:
            numbers = [float(word) for word in match[4].split(", ")]
            assert len(numbers) == COUNTS[match[3]]
            value = numbers
        assert name not in sections[-1][2]
        sections[-1][2][name] = value
    return sections


def test_godot_scenes_are_well_formed_and_refer_to_what_is_there(folder):
    sections = parsed(folder / "scene.tscn")
    kind, head, _ = sections[0]
    resources = [each for each in sections if each[0].endswith("_resource")]
    assert (kind, head) == ("gd_scene", {"load_steps": str(len(resources) + 1), "format": "3"})
    places = {(each[0][:3], each[1]["id"]) for each in resources}
    text = (folder / "scene.tscn").read_text()
    for kind, name in re.findall(r'(Ext|Sub)Resource\("(\w+)"\)', text):
        assert (kind.lower(), name) in places
    (script,) = [each[1]["path"] for each in resources if each[0] == "ext_resource"]
    assert (folder.parent / script.removeprefix("res://")).is_file()
    nodes = [attributes["name"] for kind, attributes, _ in sections if kind == "node"]
    assert len(nodes) == len(set(nodes))
    # A node comes after its parent.
    for kind, attributes, _ in sections:
        if kind == "node" and attributes["name"] != "Root":
            assert attributes["parent"] in (".", *nodes[: nodes.index(attributes["name"])])


def test_godot_scenes_have_the_camera_the_lights_the_fog_and_the_shapes(folder):
    scene = read(folder)
    nodes = {each[1]["name"]: each for each in parsed(folder / "scene.tscn") if "name" in each[1]}
    resources = {each[1]["id"]: each for each in parsed(folder / "scene.tscn") if "id" in each[1]}
    # The camera looks along -z with x to the right.
    axes, place = transform(nodes["Camera"])
    rays = camera_rays(axes[:, 0], axes[:, 1], -axes[:, 2], float(nodes["Camera"][2]["fov"]))
    given = np.array([pixel["direction"] for pixel in scene["pixels"]])
    np.testing.assert_allclose(rays, given @ TURN.T, atol=3e-7)
    np.testing.assert_allclose(place, TURN @ scene["camera"]["position"], rtol=1e-8)
    for number, light in enumerate(scene["lights"]):
        _, attributes, values = nodes[f"Light{number}"]
        axes, place = transform(nodes[f"Light{number}"])
        np.testing.assert_allclose(place, TURN @ light["position"], rtol=1e-8)
        intensity = np.pi * float(values["light_energy"]) * linear(values["light_color"])
        np.testing.assert_allclose(intensity, light["intensity"], rtol=1e-7)
        assert attributes["type"] == {"point": "OmniLight3D", "spot": "SpotLight3D"}[light["type"]]
        if light["type"] == "spot":
            np.testing.assert_allclose(-axes[:, 2], TURN @ light["axis"], atol=1e-8)
            assert float(values["spot_angle"]) == light["cutoff"]
    fog, medium = resources["fog"][2], scene["medium"]
    assert float(fog["volumetric_fog_density"]) == pytest.approx(medium["sigma_t"][1], rel=1e-8)
    assert float(fog["volumetric_fog_anisotropy"]) == medium["g"]
    np.testing.assert_allclose(linear(fog["volumetric_fog_albedo"]), medium["albedo"], rtol=1e-7)
    for number, shape in enumerate(scene["occluders"]):
        axes, place = transform(nodes[f"Occluder{number}"])
        np.testing.assert_allclose(place, TURN @ shape["centre"], atol=1e-8)
        mesh = resources[f"mesh{number}"]
        if shape["type"] == "sphere":
            assert float(mesh[2]["radius"]) == pytest.approx(shape["radius"], rel=1e-8)
            continue
        # Meshes of 2 m: a box, or a square that faces z.
        edges = np.array(shape["half_edges"])
        np.testing.assert_allclose(axes[:, : len(edges)], TURN @ edges.T, atol=1e-8)
        assert mesh[1]["type"] == {"box": "BoxMesh", "screen": "QuadMesh"}[shape["type"]]


def transform(node):
    """Return the columns of a transform and its place."""
    numbers = node[2]["transform"]
    return np.array(numbers[:9]).reshape(3, 3), np.array(numbers[9:])


def linear(colour):
    """Return a colour of a file of Godot as linear light."""
    encoded = np.array(colour[:3])
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


# Blender, which wants a Python of its own.


@pytest.fixture(scope="module")
def blender():
    """The Python that has `bpy`, as the adapters find it."""
    cache = os.environ.get("AIRLIGHT_CACHE_DIR") or "~/.cache/airlight"
    own = Path(cache).expanduser() / "adapters-bpy-5.0.1" / "bin" / "python"
    python = shutil.which(os.environ.get("AIRLIGHT_CYCLES_PYTHON", str(own)))
    if python is None:
        pytest.skip("no bpy here; AIRLIGHT_CYCLES_PYTHON can name a Python that has it")
    return python


def judged(python, folder):
    ran = subprocess.run([python, "blender.py"], cwd=folder, capture_output=True, text=True)
    return ran.returncode, ran.stdout + ran.stderr


@pytest.mark.claim("kit-languages", tolerance="that of the kit")
@pytest.mark.slow
def test_cycles_passes(blender, folder):
    status, told = judged(blender, folder)
    assert f"{folder.name}: 0 of 192 values fail" in told
    assert status == 0


@pytest.mark.claim("kit-languages", tolerance="that of the kit")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "before", "after"),
    [
        ("near-light", '= medium["g"]', '= -medium["g"]'),
        ("thin-open", "4 * math.pi * brightest", "brightest"),
        ("soft-spot", "max(cutoff - beam, 1e-6)", "1e-6"),
        ("box-floor", 'in scene["occluders"]', "in []"),
        ("thin-open", "cycles.volume_bounces = 0", "cycles.volume_bounces = 4"),
    ],
)
def test_cycles_with_a_fault_fails(blender, kit, tmp_path, name, before, after):
    shutil.copy(kit / "scenes" / name / "scene.json", tmp_path)
    text = (kit / "scenes" / name / "blender.py").read_text()
    assert text.count(before) == 1
    (tmp_path / "blender.py").write_text(text.replace(before, after))
    status, told = judged(blender, tmp_path)
    assert status == 1, told
    assert f"FAIL {name} column " in told
