# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a level of Blender comes in as Cycles renders it, or is refused by name: lights, cameras,
media and meshes keep their numbers, and files are whole or not there.
"""

import importlib.util
import itertools
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

import airlight
from airlight.reference.storage.exr import read_exr
from airlight.reports.machine.engine_adapter import adapter_names

ROOT = Path(__file__).resolve().parents[2]
SCRIPT = ROOT / "docs" / "adapters" / "to_mitsuba.py"
VARIABLE = "AIRLIGHT_CYCLES_PYTHON"


@pytest.fixture
def parts(monkeypatch):
    """The module that converts numbers."""
    monkeypatch.syspath_prepend(str(SCRIPT.parent))
    yield importlib.import_module("mitsuba_parts")
    sys.modules.pop("mitsuba_parts", None)


@pytest.fixture
def properties_of(monkeypatch):
    """The function that says what the adapter of Cycles sets in Blender for a description."""
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "examples"))
    from cycles_properties import cycles_properties

    return cycles_properties


def lamp_of(parts, light):
    """The light that the adapter of Cycles sets, as the script reads it in Blender."""
    data = light["data"]
    names = {"spot_size": "cone", "spot_blend": "blend", "shadow_soft_size": "radius"}
    given = {own: data[name] for name, own in names.items() if name in data}
    power = np.array(data["color"]) * data["energy"]
    return parts.Lamp(light["type"], np.array(light["matrix_world"]), power, **given)


def close(told, given, rtol=2e-6):
    np.testing.assert_allclose(np.array(told), np.array(given), rtol=rtol, atol=1e-6)


@pytest.mark.claim("level-from-blender", tolerance="2e-6, rounding to float32")
@pytest.mark.parametrize("name", ["open-fog", "sphere-spot", "lanterns", "windows"])
def test_what_the_adapter_of_cycles_sets_comes_back(parts, properties_of, variant, name, tmp_path):
    described = airlight.describe(name).enveloped("airlight describe")["result"]
    made = properties_of(described)
    # The camera, by its angle; a lens is tested below.
    camera, size = made["camera"], tuple(described["camera"]["size"])
    fov = math.degrees(camera["data"]["angle"])
    around = None if made["world"] is None else "fog"
    sensor = parts.camera_xml("view", np.array(camera["matrix_world"]), fov, size, around)
    lights = [
        element
        for number, light in enumerate(made["lights"])
        for element in parts.lamp_xml(f"lamp{number}", lamp_of(parts, light))
    ]
    # The medium, in a box where it is bounded.
    node = made["world"] or next(iter(made["media"].values()))
    inputs = {key: np.array(value) for key, value in node["inputs"].items()}
    sums = parts.coefficients("ShaderNodeVolumeCoefficients", inputs)
    medium = parts.medium_xml("fog", parts.Medium(*sums, g=float(inputs["Anisotropy"])))
    inside = parts.tag("ref", name="interior", id="fog")
    place = parts.to_world(np.diag([50.0, 50, 50, 1]))
    box = [parts.tag("shape", parts.tag("bsdf", type="null"), inside, place, type="cube", id="box")]
    if around is None:
        sensor = sensor.replace("<film", '<ref name="medium" id="fog"/><film')
    scene = [medium, sensor, *lights, *(box if around is None else [])]
    path = tmp_path / "level.xml"
    path.write_text(parts.tag("scene", *scene, version="3.0.0"))
    read = airlight.describe(str(path)).enveloped("airlight describe")["result"]
    # All that both descriptions have.
    for key in ("position", "forward", "right", "up", "size", "fov_horizontal"):
        close(read["camera"][key], described["camera"][key])
    for told, given in zip(read["lights"], described["lights"], strict=True):
        assert told["kind"] == given["kind"]
        keys = ("position", "axis", "intensity", "irradiance", "cutoff_angle", "beam_angle")
        for key in (key for key in keys if key in given):
            close(told[key], given[key])
    told, given = (each["medium"] or each["bounded_media"][0] for each in (read, described))
    close(told["sigma_s"], given["sigma_s"])
    close(told["sigma_a"], given["sigma_a"])
    assert told["phase"].get("g", 0) == pytest.approx(given["phase"].get("g", 0), abs=1e-7)


@pytest.mark.claim("level-from-blender")
@pytest.mark.parametrize(
    ("fit", "size", "tangent"),
    [
        ("AUTO", (160, 120), 36 / 100),
        ("AUTO", (120, 160), 36 / 100 * 120 / 160),
        ("AUTO", (120, 120), 36 / 100),
        ("HORIZONTAL", (120, 160), 36 / 100),
        ("VERTICAL", (160, 120), 24 / 100 * 160 / 120),
    ],
)
def test_the_field_of_view_is_that_of_the_sensor(parts, fit, size, tangent):
    fov = parts.fov_x(50.0, (36.0, 24.0), fit, size)
    assert math.tan(math.radians(fov) / 2) == pytest.approx(tangent, rel=1e-12)


@pytest.mark.claim("level-from-blender", tolerance="0.6 % of the intensity on the axis")
@pytest.mark.parametrize(("cone", "blend"), [(0.55, 0.15), (0.55, 1.0), (1.5, 0.6), (0.05, 0.5)])
def test_a_soft_spot_is_that_of_blender(parts, cone, blend):
    angles, falls = parts.spot_edge(cone, blend)
    assert falls.min() > 0
    assert falls.sum() == pytest.approx(1, abs=1e-12)
    angle = np.linspace(0, 1.2 * cone, 2001)
    # Mitsuba's edge is linear in the angle from the beam width to the cut-off.
    edges = [
        np.clip((np.radians(end) - angle) / np.radians(end - beam), 0, 1)
        for beam, end in itertools.pairwise(angles)
    ]
    step = np.clip((np.cos(angle) - math.cos(cone)) / (blend * (1 - math.cos(cone))), 0, 1)
    assert np.abs(falls @ np.array(edges) - step**2 * (3 - 2 * step)).max() < 0.006


FOG = '<medium type="homogeneous" id="fog"><float name="sigma_t" value="0.1"/></medium>'
VIEW = (
    '<sensor type="perspective"><ref name="medium" id="fog"/><film type="hdrfilm">'
    '<integer name="width" value="8"/><integer name="height" value="6"/></film></sensor>'
)


@pytest.mark.claim("level-from-blender", tolerance="2e-6, rounding to float32")
@pytest.mark.parametrize("kind", ["rectangle", "disk", "sphere"])
def test_an_area_light_keeps_its_power_and_its_side(parts, variant, kind, tmp_path):
    """The adapter sends pi L A = P; a mirrored, scaled object shines along its -z."""
    turn = np.array(mi.ScalarTransform4f().rotate([0.48, 0.6, 0.64], 77).matrix, dtype=float)
    matrix = turn @ np.diag([-1.5, 1.5, 1.5, 1])
    matrix[:3, 3] = 1.1, 2.3, 3.7
    power = np.array([31.0, 17.0, 7.0])
    shapes = {
        "rectangle": {"kind": "AREA", "shape": "RECTANGLE", "size": (0.8, 0.5)},
        "disk": {"kind": "AREA", "shape": "DISK", "size": (0.6, 0.6)},
        "sphere": {"kind": "POINT", "radius": 0.3},
    }
    areas = {"rectangle": 0.8 * 0.5 * 1.5**2, "disk": math.pi * 0.3**2 * 1.5**2}
    areas["sphere"] = 4 * math.pi * 0.3**2
    lamp = parts.Lamp(matrix=matrix, power=power, **shapes[kind])
    path = tmp_path / "light.xml"
    path.write_text(parts.tag("scene", FOG, VIEW, *parts.lamp_xml("light", lamp), version="3.0.0"))
    (light,) = airlight.describe(str(path)).enveloped("airlight describe")["result"]["lights"]
    assert (light["shape"], light["material"]) == (kind, "null")
    close(light["power"], power)
    close(light["area"], areas[kind])
    close(light["position"], matrix[:3, 3])
    if kind != "sphere":
        close(light["axis"], -turn[:3, 2])


@pytest.mark.claim("level-from-blender")
@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"kind": "SUN", "angle": 0.01}, "its Angle is not 0; expected 0, or --sharp"),
        (
            {"kind": "POINT", "radius": 0.1, "soft_falloff": True},
            "it has a Soft Falloff; expected it off, or --sharp",
        ),
        ({"kind": "SPOT", "radius": 0.1, "cone": 1.0}, "it is a spot with a radius"),
        ({"kind": "SPOT", "cone": math.pi}, "its Spot Size is 180 degrees"),
        ({"kind": "AREA", "spread": 1.0}, "its Spread is below 180 degrees"),
        ({"kind": "AREA", "shape": "ELLIPSE", "size": (1.0, 2.0)}, "it is an ellipse"),
        ({"kind": "AREA", "size": (0.0, 2.0)}, "it has no area"),
    ],
)
def test_a_light_that_no_scene_can_say_is_refused(parts, given, why):
    lamp = parts.Lamp(matrix=np.eye(4), power=np.ones(3), **given)
    with pytest.raises(parts.CannotError, match=why):
        parts.lamp_xml("lamp", lamp)
    # Without its radius or angle it can be said.
    if "--sharp" in why or given.get("radius"):
        assert parts.lamp_xml("lamp", lamp, sharp=True)


@pytest.mark.claim("level-from-blender")
def test_a_stretched_cone_and_a_mirrored_camera_are_refused(parts):
    spot = parts.Lamp("SPOT", np.diag([1.0, 2, 1, 1]), np.ones(3), cone=1.0)
    with pytest.raises(parts.CannotError, match="its scales differ"):
        parts.lamp_xml("lamp", spot)
    with pytest.raises(parts.CannotError, match="sheared or mirrored"):
        parts.camera_xml("view", np.diag([-1.0, 1, 1, 1]), 50.0, (8, 6), None)


@pytest.mark.claim("level-from-blender")
def test_volumes_are_those_of_cycles_and_add_up(parts):
    colour = np.array([0.25, 0.5, 1.0])
    given = {"Color": colour, "Density": 2.0, "Absorption Color": np.array([0.0, 0.25, 0.5])}
    expected = {
        "ShaderNodeVolumeScatter": ([0.5, 1, 2], [0, 0, 0]),
        "ShaderNodeVolumeAbsorption": ([0, 0, 0], [1.5, 1, 0]),
        # It absorbs the rest, but for the square root of the Absorption Color.
        "ShaderNodeVolumePrincipled": ([0.5, 1, 2], [1.5, 0.5, 0]),
    }
    media = {}
    for node, sums in expected.items():
        media[node] = parts.Medium(*parts.coefficients(node, given), g=0.3)
        np.testing.assert_allclose([media[node].sigma_s, media[node].sigma_a], sums, atol=1e-15)
    dark = parts.Medium(np.zeros(3), np.ones(3))
    both = dark + media["ShaderNodeVolumeScatter"]
    assert (both.g, both.sigma_t.tolist()) == (0.3, [1.5, 2, 3])
    with pytest.raises(parts.CannotError, match="several anisotropies"):
        both + parts.Medium(np.ones(3), np.zeros(3))


def socket(value=None, node=None):
    """An input of a node of Blender, with a value or linked to a node."""
    links = [SimpleNamespace(is_muted=False, from_node=node)]
    return SimpleNamespace(is_linked=node is not None, links=links, default_value=value)


@pytest.mark.parametrize("first", [True, False])
def test_a_sum_with_one_volume_is_that_volume(parts, first):
    """An Add Shader whose other input is empty."""
    module = importlib.import_module("blender_parts")
    sys.modules.pop("blender_parts")
    inputs = {"Color": socket((1.0, 0.5, 0.25, 1.0)), "Density": socket(2.0)}
    inputs |= {"Anisotropy": socket(0.3)}
    kind = {"bl_idname": "ShaderNodeVolumeScatter", "phase": "HENYEY_GREENSTEIN", "mute": False}
    ends = [socket(node=SimpleNamespace(inputs=inputs, **kind)), socket()]
    both = SimpleNamespace(bl_idname="ShaderNodeAddShader", inputs=ends if first else ends[::-1])
    medium = module.medium_of(both, 1.0)
    assert (medium.sigma_s.tolist(), medium.sigma_a.tolist()) == ([2.0, 1.0, 0.5], [0.0] * 3)
    assert (medium.phase, medium.g) == ("hg", 0.3)


CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
#: The faces of a cube, counter-clockwise from outside.
CUBE = np.array(
    [
        face
        for a, b, c, d in (
            *((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1)),
            *((2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)),
        )
        for face in ((a, b, c), (a, c, d))
    ]
)


@pytest.mark.claim("level-from-blender")
def test_a_camera_in_a_volume_is_found(parts):
    for point, inside in (
        ((0.5, 0.5, 0.5), True),
        ((0.9, 0.1, 0.99), True),
        ((1.1, 0.5, 0.5), False),
        ((0.5, -3.0, 0.5), False),
    ):
        assert parts.is_inside(CORNERS, CUBE, np.array(point)) is inside


@pytest.mark.parametrize("smooth", [False, True])
def test_a_mesh_file_is_what_mitsuba_reads(parts, variant, smooth, tmp_path):
    normals = (CORNERS - 0.5) / math.sqrt(0.75) if smooth else None
    path = tmp_path / "cube.ply"
    path.write_bytes(parts.ply_bytes(CORNERS, CUBE, normals))
    shape = mi.load_dict({"type": "ply", "filename": str(path), "face_normals": not smooth})
    read = mi.traverse(shape)
    np.testing.assert_array_equal(np.array(read["vertex_positions"]).reshape(-1, 3), CORNERS)
    np.testing.assert_array_equal(np.array(read["faces"]).reshape(-1, 3), CUBE)
    if smooth:
        close(np.array(read["vertex_normals"]).reshape(-1, 3), normals)


@pytest.mark.claim("level-from-blender")
def test_files_are_written_whole_or_not_at_all(parts, tmp_path):
    (tmp_path / "level.xml").mkdir()
    files = [(tmp_path / "level.cube.ply", b"cube"), (tmp_path / "level.xml", b"scene")]
    with pytest.raises(OSError, match="Is a directory"):
        parts.write_files(files)
    assert [path.name for path in tmp_path.iterdir()] == ["level.xml"]
    (tmp_path / "level.xml").rmdir()
    parts.write_files(files)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["level.cube.ply", "level.xml"]


@pytest.mark.claim("capture-contract")
def test_the_script_is_no_adapter():
    names = adapter_names()
    assert "cycles" in names
    assert not {"to_mitsuba", "mitsuba_parts", "blender_parts", "blender"} & set(names)


@pytest.mark.claim("level-from-blender")
@pytest.mark.parametrize(
    ("words", "status", "why"),
    [
        (["level.blend"], 2, "the following arguments are required: output"),
        (["level.blend", "out.exr"], 2, "got out.exr, expected a name that ends in .xml"),
        (["nowhere.blend", "out.xml"], 2, "nowhere.blend: no such file; expected a .blend file"),
        (["level.blend", "out.xml", "--gray", "1"], 2, "unrecognized arguments: --gray 1"),
        (["level.blend", "out.xml", "--grey", "7"], 2, "--grey: got 7, expected a reflectance"),
        (["level.blend", "out.xml"], 3, "to_mitsuba: the module bpy is missing: `python3.11 -m"),
        (["--", "level.blend", "out.xml"], 2, "unrecognized arguments: out.xml"),
    ],
)
def test_a_wrong_command_line_is_told_in_a_line(words, status, why, tmp_path, monkeypatch):
    (tmp_path / "level.blend").write_bytes(b"")
    (tmp_path / "bpy.py").write_text("raise ModuleNotFoundError('bpy')\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.delenv(VARIABLE, raising=False)
    ended = subprocess.run([sys.executable, str(SCRIPT), *words], capture_output=True, text=True)
    assert (ended.returncode, ended.stdout, ended.stderr.count("\n")) == (status, "", 1)
    assert why in ended.stderr
    assert not (tmp_path / "out.xml").exists()


def test_an_older_blender_is_refused(tmp_path, monkeypatch):
    """Its area lights have another radiance."""
    (tmp_path / "level.blend").write_bytes(b"")
    older = "from types import SimpleNamespace\n"
    older += "app = SimpleNamespace(version=(4, 5, 3), version_string='4.5.3')\n"
    (tmp_path / "bpy.py").write_text(older)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    words = [sys.executable, str(SCRIPT), "level.blend", "out.xml"]
    ended = subprocess.run(words, capture_output=True, text=True)
    why = "to_mitsuba: Blender is 4.5.3; expected 5.0 or newer\n"
    assert (ended.returncode, ended.stderr) == (3, why)


# With Blender.


@pytest.fixture
def blender(variant, tmp_path, monkeypatch):
    """A function that runs a file by a Python that has `bpy`."""
    python = os.environ.get(VARIABLE)
    if not python:
        if importlib.util.find_spec("bpy") is None:
            pytest.skip(f"no bpy here; {VARIABLE} can name a Python that has it")
        python = sys.executable
    monkeypatch.chdir(tmp_path)

    def run(*words):
        return subprocess.run([python, *map(str, words)], capture_output=True, text=True)

    return run


BUILT = """
import sys
sys.path.insert(0, sys.argv[4])
import bpy
from render_cycles import build, read
build(read(sys.argv[1]), sys.argv[2])
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[3])
"""


def through_blender(blender, scene, size, folder):
    """Set a scene up in Blender as the adapter of Cycles does, and write it as `back.xml`."""
    described = airlight.describe(scene, size=size, output=folder / "scene.glb")
    described = described.enveloped("airlight describe")
    (folder / "scene.json").write_text(json.dumps(described))
    (folder / "built.py").write_text(BUILT)
    built = ("built.py", "scene.json", "scene.glb", "scene.blend", ROOT / "docs" / "examples")
    assert blender(*built).returncode == 0
    written = blender(SCRIPT, "scene.blend", "back.xml")
    assert written.returncode == 0, written.stderr
    return described["result"]


@pytest.mark.slow
@pytest.mark.claim("level-from-blender", tolerance="3e-5: places are rounded to float32")
@pytest.mark.parametrize(
    "name",
    [
        *("open-fog", "sphere-spot", "colonnade", "two-pens", "three-media", "clutter"),
        *("hall", "omni-box", "tangle", "windows", "lanterns", "fireflies"),
    ],
)
def test_a_built_in_scene_comes_back_from_blender(blender, name, tmp_path):
    size = (32, 24)
    through_blender(blender, name, size, tmp_path)
    there, back = airlight.reference(name, size=size), airlight.reference("back.xml", size=size)
    for layer in ("airlight", "surface"):
        given, got = (np.array(getattr(each, layer)) for each in (there, back))
        rms = np.sqrt(np.mean((got - given) ** 2))
        assert rms <= 3e-5 * np.mean(given), (layer, rms / np.mean(given))


@pytest.mark.slow
@pytest.mark.claim("level-from-blender", tolerance="2e-6, rounding to float32")
def test_sides_and_colours_of_surfaces_come_back(blender, tmp_path):
    """A ball that is black from behind, and a floor that is not."""
    scene = str(ROOT / "docs" / "examples" / "lobe-fog.xml")
    given = through_blender(blender, scene, (32, 24), tmp_path)
    back = airlight.describe("back.xml").enveloped("airlight describe")["result"]
    surfaces = [{each["name"]: each for each in one["surfaces"]} for one in (given, back)]
    assert surfaces[0].keys() == surfaces[1].keys() == {"ball", "floor"}
    for name, each in surfaces[0].items():
        assert surfaces[1][name]["two_sided"] == each["two_sided"] == (name == "floor")
        close(surfaces[1][name]["reflectance"], each["reflectance"])


#: By level: its bounded media, paths of a pixel, and the noise of airlight and surface in blocks of
#: 2 x 2 pixels. Paths near lights with a size are noisy in Cycles.
LEVELS = {
    "world": (0, 128, 0.005, 0.02),
    "bank": (1, 128, 0.005, 0.02),
    "lamps": (0, 1024, 0.04, 0.04),
}


@pytest.mark.slow
@pytest.mark.claim("level-from-blender", tolerance="noise: means 0.5 %, blocks 0.5 to 4 %")
@pytest.mark.parametrize("name", LEVELS)
def test_a_level_is_what_cycles_renders(blender, name, tmp_path):
    """Parents, modifiers of renders, mirrored instances, units, volumes that meet, lights."""
    media, samples, *noise = LEVELS[name]
    script = ROOT / "tests" / "helpers" / "blender_level.py"
    made = blender(script, name, "a.blend", tmp_path / "a.exr", samples)
    assert made.returncode == 0, made.stderr
    written = blender(SCRIPT, "a.blend", "a.xml")
    assert written.returncode == 0, written.stderr
    assert written.stdout.strip().splitlines()[-1].startswith("a.xml: 4 meshes, ")
    assert written.stdout.strip().endswith(f", {media} bounded media")
    exact, layers = airlight.reference("a.xml"), read_exr(tmp_path / "a.exr").layers
    volume = layers["ViewLayer.Volume Direct"][..., :3]
    surface = layers["ViewLayer.Combined"][..., :3] - volume
    pairs = (exact.airlight, volume), (exact.surface, surface)
    for (given, got), off in zip(pairs, noise, strict=True):
        blocks = [
            np.array(each, dtype=float).reshape(len(got) // 2, 2, -1, 2, 3).mean(axis=(1, 3))
            for each in (given, got)
        ]
        rms = np.sqrt(np.mean((blocks[1] - blocks[0]) ** 2))
        assert rms <= off * blocks[0].mean(), rms / blocks[0].mean()
        assert blocks[1].mean() == pytest.approx(blocks[0].mean(), rel=0.005)


@pytest.mark.slow
@pytest.mark.claim("level-from-blender")
def test_what_no_scene_can_say_is_refused_or_left_out_by_name(blender, tmp_path):
    level = (ROOT / "tests/helpers/blender_level.py", "refused", "a.blend")
    assert blender(*level).returncode == 0
    names = ("light 'point'", "light 'sun'", "light 'spot'", "mesh 'window'", "volume 'Volume'")
    refused = blender(SCRIPT, "a.blend", "a.xml")
    assert refused.returncode == 2
    assert sorted(
        line.split(":")[1].strip() for line in refused.stderr.splitlines()[:-1]
    ) == sorted(names)
    assert "nothing was written" in refused.stderr.splitlines()[-1]
    assert not list(tmp_path.glob("*.xml")) + list(tmp_path.glob("*.ply"))
    # The rest of the level, without these, and with some of them by options.
    skipped = blender(SCRIPT, "a.blend", "a.xml", "--skip")
    assert (skipped.returncode, skipped.stderr.count("left out: ")) == (0, len(names))
    described = airlight.describe("a.xml").enveloped("airlight describe")["result"]
    assert [light["kind"] for light in described["lights"]] == ["point"]
    assert [surface["name"] for surface in described["surfaces"]].count("window") == 0
    more = blender(SCRIPT, "a.blend", "b.xml", "--skip", "--sharp", "--grey", "0.5")
    assert (more.returncode, more.stderr.count("left out: ")) == (0, 3)
    described = airlight.describe("b.xml").enveloped("airlight describe")["result"]
    assert [light["kind"] for light in described["lights"]] == ["point", "point"]
    (window,) = [each for each in described["surfaces"] if each["name"] == "window"]
    assert window["reflectance"] == [0.5, 0.5, 0.5]


@pytest.mark.slow
@pytest.mark.claim("level-from-blender")
def test_a_file_that_is_no_level_is_refused_in_a_line(blender, tmp_path):
    (tmp_path / "a.blend").write_bytes(b"no level")
    ended = blender(SCRIPT, "a.blend", "a.xml")
    assert (ended.returncode, ended.stderr.count("\n")) == (2, 1), ended.stderr
    assert "to_mitsuba: a.blend: " in ended.stderr
