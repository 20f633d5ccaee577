# SPDX-License-Identifier: BSD-3-Clause
"""Claim: certified scenes of fog and rows of area lights are what their programs give
and the reference computes.
"""

import json
import re
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

from airlight.analytic.phase import HenyeyGreenstein, Isotropic
from airlight.reference.quadrature.homogeneous import HomogeneousField
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.quadrature.integrate import Terms, profile_of
from airlight.reference.quadrature.intervals import lit_stretches
from airlight.reference.scene.homogeneous_medium import ReferenceMedium
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.read import ReferenceScene, read_reference
from airlight.reference.visibility.certificate import LitIntervals
from airlight.reference.visibility.planes import Rays, cone_interval
from tests.evidence.certified import area_lights
from tests.evidence.certified.fog import certify_pixel, directions, scene_data
from tests.evidence.certified.model import FogBox, FogScreen, fog_scenes, load_fog, mitsuba_dict
from tests.evidence.closed_forms import sphere_airlight

ROOT = Path(__file__).resolve().parents[2]
NAMES = [scene.name for scene in fog_scenes()]
SCENES = {scene.name: scene for scene in fog_scenes()}
# One ray of each kind: unbounded, near a light, ended by a sphere, among needles, in the
# fading part of a spot, dark.
SOME = {
    "thin-open": 27,
    "near-light": 36,
    "sphere-shadow": 9,
    "three-spheres": 29,
    "box-floor": 34,
    "needles": 20,
    "camera-in-shadow": 0,
    "hard-spot": 21,
    "soft-spot": 19,
}


@pytest.fixture(scope="module")
def text(data_folder):
    return (data_folder / "certified_fog.json").read_text()


@pytest.fixture(scope="module")
def certified(text):
    return {scene["name"]: scene for scene in json.loads(text)["scenes"]}


def radiance(scene):
    return np.array([pixel["radiance"] for pixel in scene["pixels"]], dtype=float)


def bound(scene):
    return np.array([pixel["bound"] for pixel in scene["pixels"]], dtype=float)


def reference_of(scene):
    """Read the file's Mitsuba scene; its lights must be those of the file, bit by bit."""
    reference = read_reference(load_fog(scene["mitsuba"]))
    for light, given in zip(reference.lights, scene["lights"], strict=True):
        assert np.array_equal(light.intensity, np.array(given["intensity"], dtype=float))
    return reference


@pytest.mark.parametrize("name", NAMES)
def test_the_files_parts_say_the_same_of_a_scene(certified, name):
    given = {key: value for key, value in certified[name].items() if key != "pixels"}
    assert given == json.loads(json.dumps(scene_data(SCENES[name], directions(SCENES[name]))))


@pytest.mark.claim("certified-fog-inputs")
def test_all_inputs_are_exact_in_float32():
    def numbers(value):
        if isinstance(value, dict):
            value = list(value.values())
        if isinstance(value, list | tuple):
            return [number for entry in value for number in numbers(entry)]
        return [value] if isinstance(value, float) else []

    for scene in fog_scenes():
        given = numbers(asdict(scene))
        assert len(given) > 20
        assert all(float(np.float32(number)) == number for number in given), scene.name


def corners(shape):
    signs = (
        np.array(np.meshgrid(*[[-1.0, 1.0]] * len(shape.half_edges)))
        .reshape(len(shape.half_edges), -1)
        .T
    )
    return {
        tuple(map(float, corner))
        for corner in np.array(shape.centre) + signs @ np.array(shape.half_edges)
    }


@pytest.mark.claim("certified-fog-inputs")
def test_corners_are_exact_in_mitsuba(variant):
    for scene in fog_scenes():
        # Mitsuba merges meshes of one material, and then screens are among them.
        parameters = [mi.traverse(shape) for shape in load_fog(mitsuba_dict(scene)).shapes()]
        vertices = [
            np.array(mesh["vertex_positions"]).reshape(-1, 3)
            for mesh in parameters
            if "vertex_positions" in mesh
        ]
        mesh_corners = {tuple(map(float, corner)) for part in vertices for corner in part}
        boxes = set().union(
            *(corners(shape) for shape in scene.occluders if isinstance(shape, FogBox))
        )
        screens = set().union(
            *(corners(shape) for shape in scene.occluders if isinstance(shape, FogScreen))
        )
        assert boxes <= mesh_corners <= boxes | screens, scene.name


@pytest.mark.claim("certified-fog", tolerance="none: equal digits")
@pytest.mark.parametrize(
    ("name", "pixel"),
    [
        pytest.param(*each, marks=pytest.mark.slow if each[0] == "near-light" else ())
        for each in SOME.items()
    ],
)
def test_some_rays_come_out_the_same(certified, name, pixel):
    certificate = json.loads(
        json.dumps(asdict(certify_pixel(SCENES[name], directions(SCENES[name])[pixel])))
    )
    assert certificate == certified[name]["pixels"][pixel]


@pytest.mark.claim("certified-fog", tolerance="none: equal digits")
@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_all_rays_come_out_the_same(certified, name):
    for direction, expected in zip(
        directions(SCENES[name]), certified[name]["pixels"], strict=True
    ):
        assert json.loads(json.dumps(asdict(certify_pixel(SCENES[name], direction)))) == expected


@pytest.mark.claim(
    "bound-in-every-pixel", tolerance="the bound of the pixel, 1e-9 of the largest at most"
)
@pytest.mark.claim("certified-fog", tolerance="the bound of the pixel, 1e-9 of the largest at most")
@pytest.mark.parametrize("name", NAMES)
def test_quadrature_agrees_within_its_own_bound(variant, certified, name):
    """The route that shares nothing: lit intervals of triangles and spheres in a plane,
    Kronrod's panels in float64.
    """
    image = quadrature_image(reference_of(certified[name]))
    value = radiance(certified[name])
    difference = np.abs(image.airlight.reshape(-1, 3) - value)
    # The last term: both routes take the directions through the pixel centres for
    # themselves, 3e-16 apart.
    allowed = image.airlight_error.reshape(-1, 3) + bound(certified[name]) + 1e-13 * value
    assert np.all(difference <= allowed), (difference / np.maximum(allowed, 1e-300)).max()
    assert image.airlight_error.max() < 1e-9 * value.max()
    assert image.left == 0
    distance = np.array([float(pixel["distance"]) for pixel in certified[name]["pixels"]])
    # `distance` is as it was cast, in float32: a few roundings of coordinates of a few metres.
    np.testing.assert_allclose(image.distance.reshape(-1), distance, rtol=3e-6)


@pytest.mark.claim("certified-fog-snippet")
@pytest.mark.slow
def test_the_pages_tell_of_every_scene_and_the_snippet_runs(variant):
    formats, page = (
        (ROOT / "docs" / name).read_text() for name in ("formats.md", "your-engine.md")
    )
    assert all(f"`{name}`" in formats for name in NAMES)
    (code,) = re.findall(r"^```python\n(.*?)^```", page, flags=re.DOTALL | re.MULTILINE)
    code = code.replace("llvm_ad_rgb", variant)
    ran = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=300
    )
    assert ran.returncode == 0, ran.stderr
    bias, interval = (
        float(word) for word in re.fullmatch(r"bias (\S+)% \+- (\S+)%\n", ran.stdout).groups()
    )
    assert interval < 1.5
    assert abs(bias) < 2.5 * interval  # five standard errors


@pytest.fixture(scope="module")
def area_rows(data_folder):
    return json.loads((data_folder / "certified_area_lights.json").read_text())


def test_rows_are_those_of_the_generator(area_rows):
    assert area_rows["schema"] == area_lights.SCHEMA
    for rows, inputs in (
        (area_rows["points"], area_lights.POINTS),
        (area_rows["spheres"], area_lights.SPHERES),
    ):
        assert [tuple(list(row.values())[:-1]) for row in rows] == list(inputs)
    assert (
        area_lights._text(area_lights.point_integral(*area_lights.POINTS[0]))
        == area_rows["points"][0]["J"]
    )


@pytest.mark.slow
def test_all_rows_again(area_rows):
    assert area_lights.certified_rows() == json.loads(json.dumps(area_rows))


@pytest.mark.claim("area-light-certified", tolerance="1e-10 relative: Gauss-Kronrod's own")
@pytest.mark.parametrize("number", range(len(area_lights.POINTS)))
def test_the_reference_of_one_point(area_rows, number):
    row = area_rows["points"][number]
    phase = Isotropic() if row["g"] is None else HenyeyGreenstein(row["g"])
    medium = ReferenceMedium(np.full(3, row["sigma_t"]), np.ones(3), phase, None)
    # In the plane of ray and light; what the normal has across the plane does not matter.
    beside = np.sqrt(max(0.0, 1 - row["axial"] ** 2 - row["across"] ** 2))
    quarter = 0.5 * np.pi
    normal = np.array([beside, row["across"], row["axial"]])
    light = ReferenceLight(
        np.zeros(3), np.ones(3), normal, cutoff=quarter, beam=quarter, cosine=True
    )
    place, along, across = np.zeros((1, 3)), np.array([[0.0, 0, 1]]), np.array([[0.0, 1, 0]])
    origin = row["height"] * across[0] - row["foot"] * along[0]
    rays = Rays(origin, along, place, across, np.array([row["foot"]]), np.array([row["height"]]))
    low, high = (rays.distance(end) for end in cone_interval(rays, light, light.cutoff))
    lit = LitIntervals(
        np.array([0]), np.maximum(row["x0"], low), np.minimum(row["x1"], high), edge=0.0
    )
    stretches, profile = lit_stretches(light, rays, lit), profile_of(light, rays)
    alone = ReferenceScene(None, None, 1, 1, origin, along, medium, ())
    value, bound = HomogeneousField(alone).sums(rays, stretches, np.array([np.inf]), Terms(profile))
    expected = float(row["J"]) * row["sigma_t"] / (4 * np.pi)
    assert value[0] == pytest.approx(expected, rel=1e-10)
    assert abs(value[0, 0] - expected) <= bound[0, 0]


@pytest.mark.parametrize("number", range(len(area_lights.SPHERES)))
def test_the_closed_form_of_a_sphere(area_rows, number):
    row = dict(area_rows["spheres"][number])
    expected = float(row.pop("K"))
    value = sphere_airlight(row.pop("sigma_t"), row.pop("height"), row.pop("radius"), **row)
    assert value == pytest.approx(expected, rel=1e-12)
