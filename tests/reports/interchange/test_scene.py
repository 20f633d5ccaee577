# SPDX-License-Identifier: BSD-3-Clause
"""What `describe` says of a scene: for engines, for Cycles, its fog as a grid."""

import json
import math
import os
import re
import runpy
from pathlib import Path
from xml.etree import ElementTree

import mitsuba as mi
import numpy as np
import pytest

import airlight
from airlight.reference.quadrature.height_fog import fog_of
from airlight.reference.scene.read import read_reference
from airlight.reports.commands.main import run
from airlight.reports.interchange.fog_grid import fog_grid, write_fog_grid
from airlight.reports.interchange.gltf import _TURNS
from airlight.reports.interchange.scene import describe_scene, spot_power_angle
from airlight.reports.interchange.words import description_table
from airlight.validation.scenes.loading import LoadedScene, load_scene
from airlight.validation.scenes.registry import FOG_SCENES
from tests.helpers.area_lights import lamp
from tests.helpers.height_fog import FOG, LAMP, SUN, fog_xml
from tests.helpers.scenes import bounded_medium, spot, tiny_scene

EXAMPLES = Path(__file__).resolve().parents[3] / "docs" / "examples"
cycles_properties = runpy.run_path(str(EXAMPLES / "cycles_properties.py"))["cycles_properties"]


def described(**changes):
    return describe_scene(
        LoadedScene("tiny", mi.load_dict(tiny_scene(**changes)), "A tiny scene.", "")
    )


@pytest.mark.claim("pixel-centre", tolerance="5e-7: Mitsuba's float32 matrices")
def test_camera_is_enough_to_make_mitsubas_rays(variant):
    camera = described(size=(16, 12))["camera"]
    forward, right, up = (np.array(camera[name]) for name in ("forward", "right", "up"))
    tangents = [
        np.tan(0.5 * np.deg2rad(camera[f"fov_{way}"])) for way in ("horizontal", "vertical")
    ]
    sensor = mi.load_dict(tiny_scene(size=(16, 12))).sensors()[0]
    for column, row in ((0, 0), (15, 11), (3, 8)):
        x, y = 2 * (column + 0.5) / 16 - 1, 1 - 2 * (row + 0.5) / 12
        wanted = forward + x * tangents[0] * right + y * tangents[1] * up
        place = mi.Point2f((column + 0.5) / 16, (row + 0.5) / 12)
        ray, _ = sensor.sample_ray(0, 0, place, mi.Point2f(0.5))
        # float32
        np.testing.assert_allclose(
            wanted / np.linalg.norm(wanted), np.array(ray.d)[:, 0], atol=5e-7
        )
    assert camera["position"] == [0.2, -4.1, 1.3]
    # Right-handed.
    np.testing.assert_allclose(np.cross(right, up), -forward, atol=1e-6)


def test_a_description_does_not_follow_the_print_options_of_the_process(variant):
    """Importing `colour`, as pictures do, sets the oldest ones: a mean free path of
    9.090909 m became 9.09091 m.
    """
    usual = described(size=(16, 12))
    with np.printoptions(legacy="1.13"):
        assert described(size=(16, 12)) == usual


def test_medium_is_in_every_form_that_engines_ask_for(variant):
    medium = described()["medium"]
    assert medium["sigma_t"] == [0.31] * 3
    assert medium["albedo"] == [0.9, 0.8, 0.7]
    np.testing.assert_allclose(medium["sigma_s"], [0.279, 0.248, 0.217], rtol=1e-7)
    np.testing.assert_allclose(np.add(medium["sigma_s"], medium["sigma_a"]), 0.31, rtol=1e-7)
    np.testing.assert_allclose(medium["mean_free_path"], 1 / 0.31, rtol=1e-7)
    assert medium["phase"] == {"name": "isotropic", "formula": "1/(4 pi) [1/sr]"}


def test_bodies_of_media_are_listed_with_their_bounds(variant):
    ball = bounded_medium(
        {"type": "sphere", "center": [2.0, 0.3, 1.1], "radius": 0.3},
        (0.5, 0.25, 1.0),
        (0.5, 0.4, 0.3),
    )
    cube = bounded_medium({"type": "cube"}, 0.7, (0.5, 0.4, 0.3))
    sensor = {key: entry for key, entry in tiny_scene()["sensor"].items() if key != "medium"}
    description = described(fog=None, sensor=sensor, haze=ball, box=cube, ball=None)
    assert description["medium"] is None
    assert [medium["name"] for medium in description["bounded_media"]] == ["haze", "box"]
    haze, box = description["bounded_media"]
    assert haze["bounds"] == {"kind": "sphere", "centre": [2.0, 0.3, 1.1], "radius": 0.3}
    assert haze["sigma_t"] == [0.5, 0.25, 1.0]
    assert box["bounds"]["kind"] == "convex mesh"


def test_a_light_at_infinity_has_a_direction_and_no_place(variant):
    loaded = load_scene("windows", (8, 6))
    (sun,) = describe_scene(loaded)["lights"]
    assert sun["kind"] == "directional"
    assert "position" not in sun
    assert sun["irradiance"] == [33.1, 28.7, 22.3]
    direction = np.array([0.737, -0.271, -0.419])
    np.testing.assert_allclose(sun["axis"], direction / np.linalg.norm(direction), atol=1e-6)


@pytest.mark.claim("describe-area-lights", tolerance="1e-6 relative: float32")
@pytest.mark.parametrize(
    ("kind", "scale", "area"),
    [
        ("rectangle", [0.5, 0.3, 1.0], 0.6),
        ("disk", [0.4, 0.4, 1.0], math.pi * 0.16),
        ("sphere", [0.3] * 3, 4 * math.pi * 0.09),
    ],
)
def test_lights_with_extent_have_radiance_power_and_luminous_flux(variant, kind, scale, area):
    """Rationale: power pi Le A, and 683 lm/W times 0.2126 R + 0.7152 G + 0.0722 B, here by hand."""
    transform = (
        mi.ScalarTransform4f().look_at([0.9, 0.7, 1.9], [0.1, -0.5, 0.4], [0, 0, 1]).scale(scale)
    )
    found = described(lamp=lamp(kind, radiance=(5.0, 4.0, 3.0), to_world=transform))
    (light,) = found["lights"]
    assert (light["kind"], light["shape"], light["material"]) == ("area", kind, "black")
    power = math.pi * area * np.array([5.0, 4.0, 3.0])
    assert light["radiance"] == [5.0, 4.0, 3.0]
    assert light["power"] == pytest.approx(power, rel=1e-6)
    # The primaries of sRGB as four digits of IEC 61966-2-1.
    assert light["luminous_flux"] == pytest.approx(683 * power @ [0.2126, 0.7152, 0.0722], rel=2e-4)
    assert [surface["name"] for surface in found["surfaces"]] == ["ball", "floor"]
    if kind == "sphere":
        assert light["radius"] == pytest.approx(0.3, rel=1e-6)
    else:
        expected = np.array([-0.8, -1.2, -1.5]) / np.linalg.norm([-0.8, -1.2, -1.5])
        assert light["axis"] == pytest.approx(expected, abs=1e-6)


@pytest.mark.claim(
    "described-power", tolerance="1e-9 relative: the quadrature's; 1e-7: float32 angles"
)
@pytest.mark.parametrize(
    ("beam", "cutoff"), [(25.0, 40.0), (33.0, 33.0), (0.0, 90.0), (24.3, 24.3000001), (0.01, 0.02)]
)
def test_power_of_a_spot_is_the_integral_of_its_falloff(beam, cutoff):
    from scipy.integrate import quad

    b, c = np.deg2rad([beam, cutoff])
    inside = quad(np.sin, 0, b, epsabs=0)[0]
    edge = quad(lambda t: (c - t) / (c - b) * np.sin(t), b, c, epsabs=0)[0] if c > b else 0.0
    # 1 - cos of a hundredth of a degree has lost eight digits
    tolerance = 1e-9 if cutoff > 1 else 1e-8
    np.testing.assert_allclose(spot_power_angle(b, c), 2 * np.pi * (inside + edge), rtol=tolerance)


def test_command_prints_json_and_writes_gltf(capsys, tmp_path):
    glb = tmp_path / "fog.glb"
    assert run(["describe", "open-fog", "--size", "64x48", "--json", "-o", str(glb)]) == 0
    printed = json.loads(capsys.readouterr().out)["result"]
    assert (printed["scene"], printed["camera"]["size"]) == ("open-fog", [64, 48])
    assert printed["gltf"]["bytes"] == glb.stat().st_size


@pytest.mark.slow
@pytest.mark.parametrize("name", FOG_SCENES)
def test_every_built_in_scene_can_be_described_and_written(name, variant, tmp_path, capsys):
    assert run(["describe", name, "-o", str(tmp_path / "scene.glb")]) == 0
    assert "sigma_t" in capsys.readouterr().out


def properties(**changes):
    described = describe_scene(
        LoadedScene("tiny", mi.load_dict(tiny_scene(**changes)), "A tiny scene.", "")
    )
    return described, cycles_properties(described)


def test_a_camera_looks_along_minus_z_and_cuts_no_fog_away(variant):
    described, cycles = properties()
    camera = described["camera"]
    matrix = np.array(cycles["camera"]["matrix_world"])
    np.testing.assert_allclose(matrix[:3, 2], -np.array(camera["forward"]), atol=1e-12)
    np.testing.assert_allclose(matrix[:3, 3], camera["position"], atol=1e-12)
    # A rotation, float32's digits.
    np.testing.assert_allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3), atol=1e-6)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1.0, abs=1e-6)
    data = cycles["camera"]["data"]
    assert (data["sensor_fit"], math.degrees(data["angle"])) == (
        "HORIZONTAL",
        pytest.approx(camera["fov_horizontal"]),
    )
    assert data["clip_start"] < 1e-5


@pytest.mark.parametrize("up", ["x", "-x", "y", "-y", "z", "-z"])
def test_meshes_stand_before_the_camera_whatever_is_up(variant, up):
    """Camera and lights have the axes of the scene, and so must what Blender imports."""
    turn = np.array(cycles_properties(properties()[0] | {"up": up})["turn"])
    place = np.array([0.3, -1.1, 2.7])
    x, y, z = np.array(_TURNS[up]) @ place
    assert (turn @ [x, -z, y, 1] == [*place, 1]).all()  # Blender's y is -z of glTF


def test_lights_have_watts_whole_angles_and_directions(variant):
    described, cycles = properties(hard=spot())
    lamp, hard = cycles["lights"]
    assert lamp["type"] == "POINT"
    np.testing.assert_allclose(
        np.array(lamp["data"]["color"]) * lamp["data"]["energy"],
        described["lights"][0]["power_all_round"],
        rtol=1e-12,
    )
    assert (lamp["data"]["shadow_soft_size"], lamp["data"]["use_soft_falloff"]) == (0.0, False)
    assert math.degrees(hard["data"]["spot_size"]) == pytest.approx(
        2 * described["lights"][1]["cutoff_angle"]
    )
    assert hard["data"]["spot_blend"] == 0.0
    matrix = np.array(hard["matrix_world"])
    np.testing.assert_allclose(-matrix[:3, 2], described["lights"][1]["axis"], atol=1e-12)
    np.testing.assert_allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3), atol=1e-6)


def test_a_spot_that_blender_would_widen_is_refused(variant):
    _, cycles = properties(wide=spot(cutoff=0.6, beam=0.6), narrow=spot(cutoff=0.4, beam=0.4))
    _, wide, narrow = cycles["lights"]
    assert math.degrees(wide["data"]["spot_size"]) == pytest.approx(1.2)
    assert narrow == {"cannot": "Blender's spots are at least a degree wide"}


def test_media_have_coefficients_and_the_sign_of_g(variant):
    fog = tiny_scene()["fog"] | {"phase": {"type": "hg", "g": -0.37}}
    described, cycles = properties(fog=fog)
    assert cycles["world"]["phase"] == "HENYEY_GREENSTEIN"
    assert cycles["world"]["inputs"] == {
        "Scatter Coefficients": described["medium"]["sigma_s"],
        "Absorption Coefficients": described["medium"]["sigma_a"],
        "Anisotropy": -0.37,
    }
    three = cycles_properties(describe_scene(load_scene("three-media", (8, 6))))
    assert three["world"] is None
    assert len(three["media"]) == 3


def test_the_size_of_a_drawn_light_is_no_number_of_pixels(variant):
    lights = [{"name": "a", "size": [0.3, 0.2]}, {"name": "b", "size": []}]
    told = description_table(described() | {"drawn": {"lights": lights}})
    cells = [tuple(row.values.values()) for row in told.rows]
    words = {(what, part): value for what, part, value in cells}
    assert words["drawn", "lights 1"] == "name a; size (0.3, 0.2) m"
    assert words["", "lights 2"] == "name b; size ()"
    assert words["", "size"] == "(16, 12) pixels"


@pytest.fixture
def medium(variant, tmp_path):
    path = tmp_path / "fog.xml"
    path.write_text(fog_xml(LAMP))
    return read_reference(load_scene(str(path)).scene).medium


def test_a_sky_that_lights_media_is_described_and_one_that_does_not_is_none(variant, tmp_path):
    """The reference has its light: who renders without it is judged wrong."""
    sky = '<emitter type="constant"><rgb name="radiance" value="0.07, 0.11, 0.21"/></emitter>'
    (tmp_path / "fog.xml").write_text(fog_xml(LAMP + sky))
    found = airlight.describe(str(tmp_path / "fog.xml"))
    assert found["sky"]["radiance"] == [0.07, 0.11, 0.21]
    assert "(0.07, 0.11, 0.21) W/(m^2 sr)" in found.text()
    away = {"type": "constant", "radiance": {"type": "rgb", "value": [0.07, 0.11, 0.21]}}
    assert described(sky=away)["sky"] is None  # through an unbounded medium nothing of it arrives


@pytest.mark.claim("height-fog-grid", tolerance="1e-12 relative between nodes, u^2/8 of the whole")
def test_optical_depths_between_nodes_are_exact(medium):
    density, fog = fog_grid(medium), fog_of(medium)
    step = (medium.cap - medium.floor) / len(density)
    z = medium.floor + step * (np.arange(len(density)) + 0.5)
    cells = 0.5 * (density[1:] + density[:-1]) * step
    np.testing.assert_allclose(cells, fog.optical_depth(z[:-1], z[1:], step), rtol=1e-12)
    # The lowest half voxel is constant: it lacks u^2/8 of sigma H, u = 1/20.
    assert density.sum() * step == pytest.approx(float(fog.column(medium.floor)), rel=1 / 20**2 / 8)


def test_mitsuba_reads_the_file(medium, tmp_path):
    text = write_fog_grid(tmp_path / "fog.vol", medium)
    read = mi.load_string(text.replace("<medium ", '<medium version="3.0.0" ', 1))
    z = np.linspace(medium.floor + 1, medium.cap - 1, 57)
    interaction = mi.MediumInteraction3f()
    interaction.p = mi.Point3f(np.stack([31 - z, 3 * z, z]).astype(np.float32))
    found = np.array(read.get_scattering_coefficients(interaction)[2])[0]
    np.testing.assert_allclose(found, fog_of(medium).density(z), rtol=5e-4)


def test_the_grid_of_fog_far_from_the_origin_is_there(variant, tmp_path):
    """A grid ends at its box, which was about the origin whatever the scene."""
    far = FOG.replace('<translate x="-20" y="-20"', '<translate x="90000" y="-70000"')
    (tmp_path / "fog.xml").write_text(fog_xml(LAMP, fog=far))
    medium = read_reference(load_scene(str(tmp_path / "fog.xml")).scene).medium
    text = write_fog_grid(tmp_path / "fog.vol", medium)
    read = mi.load_string(text.replace("<medium ", '<medium version="3.0.0" ', 1))
    ray = mi.Ray3f(mi.Point3f(90020, -69980, 99), mi.Vector3f(0, 0, -1))
    meets, begin, end = (np.array(each).item() for each in read.intersect_aabb(ray))
    assert meets
    assert (begin, end) == (pytest.approx(99 - 42.5, rel=1e-6), pytest.approx(99.5, rel=1e-6))


def test_a_grid_takes_the_place_of_an_older_file_and_its_path_is_safe_in_xml(medium, tmp_path):
    """Who reads the older file goes on to: nothing is written into it."""
    path, kept = tmp_path / 'fog & "smoke".vol', tmp_path / "kept"
    path.write_bytes(b"older")
    os.link(path, kept)
    text = write_fog_grid(path, medium)
    assert kept.read_bytes() == b"older"
    assert ElementTree.fromstring(text).find("volume/string").get("value") == str(path)
    assert mi.VolumeGrid(str(path)).max() == pytest.approx(fog_grid(medium).max())


def test_describe_writes_it(variant, tmp_path):
    (tmp_path / "fog.xml").write_text(fog_xml(LAMP))
    found = airlight.describe(str(tmp_path / "fog.xml"), output=tmp_path / "fog.vol")
    assert (tmp_path / "fog.vol").exists()
    assert "gridvolume" in found.grid
    airlight.describe("smoke", output=tmp_path / "smoke.vol")
    assert mi.VolumeGrid(str(tmp_path / "smoke.vol")).max() == pytest.approx(4.7)
    # The other files, which the scene fits, are not written either.
    files = [tmp_path / f"open.{ending}" for ending in ("pbrt", "glb", "vol")]
    with pytest.raises(airlight.InputError, match="the medium is no height fog and no grid"):
        airlight.describe("open-fog", output=files)
    assert not list(tmp_path.glob("open.*"))


def test_fog_under_a_sun_that_only_a_model_lets_through_is_written_too(variant, tmp_path):
    """The description took the model, and the grid was refused by physics."""
    level = SUN.replace('z="-0.45"', 'z="0"')
    (tmp_path / "fog.xml").write_text(fog_xml(level))
    target = tmp_path / "fog.vol"
    found = airlight.describe(str(tmp_path / "fog.xml"), model="light-path=off", output=target)
    assert "gridvolume" in found.grid
    assert target.exists()
    with pytest.raises(airlight.InputError, match="sun"):
        airlight.describe(str(tmp_path / "fog.xml"), output=target)


#: Units of the numbers that an engine programmer types, by their names: those
#: of the notation of DESIGN.
UNITS = {
    **dict.fromkeys(("position", "mean_free_path", "scale_height", "radius"), "m"),
    **dict.fromkeys(("sigma_t", "sigma_s", "sigma_a"), "1/m"),
    **dict.fromkeys(("cutoff_angle", "beam_angle"), "degrees from the axis"),
    **dict.fromkeys(("fov_horizontal", "fov_vertical"), "degrees"),
    **dict.fromkeys(("power", "power_all_round"), "W"),
    **{
        "intensity": "W/sr",
        "size": "pixels",
        "albedo": "",
        "axis": "",
        "forward": "",
        "right": "",
        "up": "",
    },
}


def test_the_printed_description_has_the_numbers_of_the_json_with_their_units(variant, capsys):
    """Each number of camera, medium and light, once, to seven digits, with
    the unit that its name has.
    """
    assert run(["describe", "sphere-spot", "--size", "16x12"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert run(["describe", "sphere-spot", "--size", "16x12", "--json"]) == 0
    data = json.loads(capsys.readouterr().out)["result"]
    parts = {"camera": data["camera"], "medium": data["medium"], "light": data["lights"][0]}
    begins = {
        part: next(n for n, line in enumerate(lines) if re.match(rf"{part}\s", line))
        for part in parts
    }
    checked = set()
    for part, values in parts.items():
        for name, value in values.items():
            if isinstance(value, str | dict):
                continue
            written = (
                ", ".join(f"{each:.7g}" for each in value)
                if isinstance(value, list)
                else f"{value:.7g}"
            )
            wanted = (
                f"({written}) {UNITS[name]}"
                if isinstance(value, list)
                else f"{written} {UNITS[name]}"
            )
            shown = next(
                line for line in lines[begins[part] :] if re.search(rf"(^|\s){name}\s", line)
            )
            assert shown.rpartition(f"{name} ")[2].strip() == wanted.strip()
            checked.add(name)
    assert checked == set(UNITS) - {"scale_height", "radius"}
