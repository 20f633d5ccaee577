# SPDX-License-Identifier: BSD-3-Clause
import json
import math

import mitsuba as mi
import numpy as np
import pytest

from reports.commands.main import run
from reports.interchange.scene import describe_scene, spot_power_angle
from tests.helpers.area_lights import lamp
from tests.helpers.scenes import bounded_medium, tiny_scene
from validation.scenes.loading import LoadedScene, load_scene
from validation.scenes.registry import FOG_SCENES


def described(**changes):
    return describe_scene(LoadedScene("tiny", mi.load_dict(tiny_scene(**changes)), "A tiny scene.", ""))


@pytest.mark.claim("pixel-centre", tolerance="5e-7: Mitsuba's float32 matrices")
def test_camera_is_enough_to_make_mitsubas_rays(variant):
    camera = described(size=(16, 12))["camera"]
    forward, right, up = (np.array(camera[name]) for name in ("forward", "right", "up"))
    tangents = [np.tan(0.5 * np.deg2rad(camera[f"fov_{way}"])) for way in ("horizontal", "vertical")]
    sensor = mi.load_dict(tiny_scene(size=(16, 12))).sensors()[0]
    for column, row in ((0, 0), (15, 11), (3, 8)):
        x, y = 2 * (column + 0.5) / 16 - 1, 1 - 2 * (row + 0.5) / 12
        wanted = forward + x * tangents[0] * right + y * tangents[1] * up
        place = mi.Point2f((column + 0.5) / 16, (row + 0.5) / 12)
        ray, _ = sensor.sample_ray(0, 0, place, mi.Point2f(0.5))
        # float32
        np.testing.assert_allclose(wanted / np.linalg.norm(wanted), np.array(ray.d)[:, 0], atol=5e-7)
    assert camera["position"] == [0.2, -4.1, 1.3]
    # Right-handed.
    np.testing.assert_allclose(np.cross(right, up), -forward, atol=1e-6)


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
        {"type": "sphere", "center": [2.0, 0.3, 1.1], "radius": 0.3}, (0.5, 0.25, 1.0), (0.5, 0.4, 0.3)
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
    transform = mi.ScalarTransform4f().look_at([0.9, 0.7, 1.9], [0.1, -0.5, 0.4], [0, 0, 1]).scale(scale)
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


@pytest.mark.claim("described-power", tolerance="1e-9 relative: the quadrature's; 1e-7: float32 angles")
@pytest.mark.parametrize(
    ("beam", "cutoff"), [(25.0, 40.0), (33.0, 33.0), (0.0, 90.0), (24.3, 24.3000001), (0.01, 0.02)]
)
def test_power_of_a_spot_is_the_integral_of_its_falloff(beam, cutoff):
    from scipy.integrate import quad

    b, c = np.deg2rad([beam, cutoff])
    inside = quad(np.sin, 0, b, epsabs=0)[0]
    edge = quad(lambda t: (c - t) / (c - b) * np.sin(t), b, c, epsabs=0)[0] if c > b else 0.0
    tolerance = 1e-9 if cutoff > 1 else 1e-8  # 1 - cos of a hundredth of a degree has lost eight digits
    np.testing.assert_allclose(spot_power_angle(b, c), 2 * np.pi * (inside + edge), rtol=tolerance)


def test_command_prints_json_and_writes_gltf(capsys, tmp_path):
    glb = tmp_path / "fog.glb"
    assert run(["describe", "open-fog", "--size", "64x48", "--json", "-o", str(glb)]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert (printed["scene"], printed["camera"]["size"]) == ("open-fog", [64, 48])
    assert printed["gltf"]["bytes"] == glb.stat().st_size


@pytest.mark.slow
@pytest.mark.parametrize("name", FOG_SCENES)
def test_every_built_in_scene_can_be_described_and_written(name, variant, tmp_path, capsys):
    assert run(["describe", name, "-o", str(tmp_path / "scene.glb")]) == 0
    assert "sigma_t" in capsys.readouterr().out
