# SPDX-License-Identifier: BSD-3-Clause
"""Protects what `describe --json` says of Cycles: every number that a script needs, none left to guess."""

import math

import mitsuba as mi
import numpy as np
import pytest

from reports.interchange.scene import describe_scene
from tests.helpers.scenes import spot, tiny_scene
from validation.scenes.loading import LoadedScene, load_scene


def properties(**changes):
    described = describe_scene(LoadedScene("tiny", mi.load_dict(tiny_scene(**changes)), "A tiny scene.", ""))
    return described, described["properties"]["Cycles"]


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
    assert (data["sensor_fit"], math.degrees(data["angle"])) == ("HORIZONTAL", pytest.approx(camera["fov_horizontal"]))
    assert data["clip_start"] < 1e-5


def test_lights_have_watts_whole_angles_and_directions(variant):
    described, cycles = properties(hard=spot())
    lamp, hard = cycles["lights"]
    assert lamp["type"] == "POINT"
    np.testing.assert_allclose(
        np.array(lamp["data"]["color"]) * lamp["data"]["energy"], described["lights"][0]["power_all_round"], rtol=1e-12
    )
    assert (lamp["data"]["shadow_soft_size"], lamp["data"]["use_soft_falloff"]) == (0.0, False)
    assert math.degrees(hard["data"]["spot_size"]) == pytest.approx(2 * described["lights"][1]["cutoff_angle"])
    assert hard["data"]["spot_blend"] == 0.0
    matrix = np.array(hard["matrix_world"])
    np.testing.assert_allclose(-matrix[:3, 2], described["lights"][1]["axis"], atol=1e-12)
    np.testing.assert_allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3), atol=1e-6)


def test_media_have_coefficients_and_the_sign_of_g(variant):
    fog = tiny_scene()["fog"] | {"phase": {"type": "hg", "g": -0.37}}
    described, cycles = properties(fog=fog)
    assert cycles["world"]["phase"] == "HENYEY_GREENSTEIN"
    assert cycles["world"]["inputs"] == {
        "Scatter Coefficients": described["medium"]["sigma_s"],
        "Absorption Coefficients": described["medium"]["sigma_a"],
        "Anisotropy": -0.37,
    }
    three = describe_scene(load_scene("three-media", (8, 6)))["properties"]["Cycles"]
    assert three["world"] is None
    assert len(three["media"]) == 3
