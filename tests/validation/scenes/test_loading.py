# SPDX-License-Identifier: BSD-3-Clause
"""Scenes are loaded at any size; a file or number of which no finite image can
come is refused by name.
"""

import re

import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.loading import load_scene, resize
from tests.helpers.bad_inputs import cloud, scene
from tests.helpers.scenes import scene_xml

SMALL = scene_xml(size=(16, 12), fov=41.7)


@pytest.fixture
def small_file(tmp_path):
    path = tmp_path / "my fog.xml"
    path.write_text(SMALL)
    return path


def refused(text):
    return pytest.raises(InputError, match=re.escape(text))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('<scene version="3.0.0"><shape type="sphere"></scene>', "line 1"),
        ("", "the file is empty"),
        ('<scene version="3.0.0"><shape type="spher"/></scene>', '"spher" not found'),
        (
            '<scene version="3.0.0"><shape type="ply"><string name="filename" '
            'value="gone.ply"/></shape></scene>',
            "gone.ply",
        ),
        ('<bsdf type="diffuse" version="3.0.0"/>', "a whole <scene>"),
    ],
    ids=["malformed", "empty", "unknown plugin", "missing mesh", "no scene"],
)
def test_broken_file_is_refused_by_name_and_reason_in_one_line(variant, tmp_path, text, said):
    path = tmp_path / "broken.xml"
    path.write_text(text)
    with refused(said) as caught:
        load_scene(str(path))
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("size", [(0, 0), (0, 5), (5, 0), (16385, 5), (-1, 5)])
def test_size_that_no_image_has_is_refused(variant, size):
    with refused(f"got {size[0]}x{size[1]}"):
        load_scene("open-fog", size)


FOV = '<float name="fov" value="41.7"/>'
LENSES = [
    FOV,
    *(f'{FOV}<string name="fov_axis" value="{axis}"/>' for axis in ("y", "smaller", "larger")),
    '<string name="focal_length" value="60mm"/>',  # an angle along the diagonal
]


@pytest.mark.parametrize(
    ("size", "lens"),
    [
        *((size, FOV) for size in ((16, 12), (1, 1))),
        *((size, lens) for size in ((31, 12), (9, 40)) for lens in LENSES),
    ],
)
def test_resized_scene_has_the_rays_of_one_built_at_that_size(variant, small_file, size, lens):
    """For Mitsuba's own rays and for both readers."""
    expected = mi.load_string(scene_xml(size=size, fov=41.7).replace(FOV, lens))
    small_file.write_text(SMALL.replace(FOV, lens))
    loaded = load_scene(str(small_file))
    resize(loaded.scene, size, loaded.lens)  # as a study does to its scene
    np.testing.assert_array_equal(
        read_reference(loaded.scene).direction, read_reference(expected).direction
    )
    resized = load_scene(str(small_file), size).scene
    np.testing.assert_array_equal(
        read_reference(resized).direction, read_reference(expected).direction
    )
    resized_camera, expected_camera = read_scene(resized).camera, read_scene(expected).camera
    assert (resized_camera.width, resized_camera.height) == size
    np.testing.assert_array_equal(np.array(resized_camera.origin), np.array(expected_camera.origin))
    np.testing.assert_array_equal(np.array(resized_camera.axes), np.array(expected_camera.axes))
    for place in [(0.13, 0.29), (0.71, 0.93)]:
        rays = [
            s.sensors()[0].sample_ray(0.0, 0.5, mi.Point2f(*place), mi.Point2f(0.5))[0]
            for s in (resized, expected)
        ]
        # The projections are derived by the same code in float32.
        np.testing.assert_allclose(np.array(rays[0].d), np.array(rays[1].d), rtol=0, atol=1e-6)
        np.testing.assert_allclose(np.array(rays[0].o), np.array(rays[1].o), rtol=0, atol=1e-6)


@pytest.mark.parametrize("side", ["width", "height"])
@pytest.mark.parametrize("length", [0, 16385, 100_000_000])
def test_a_film_that_no_image_has_is_refused_by_its_file(variant, small_file, side, length):
    text, count = re.subn(rf'name="{side}" value="\d+"', f'name="{side}" value="{length}"', SMALL)
    assert count == 1
    small_file.write_text(text)
    with refused(f"scene {small_file}: the camera's film has "):
        load_scene(str(small_file))
    assert load_scene(str(small_file), (8, 6)).scene.sensors()[0].film().size()[0] == 8


def load(tmp_path, text):
    path = tmp_path / "scene.xml"
    path.write_text(text)
    return load_scene(str(path)).scene


def test_the_python_interface_checks_scenes_that_are_built(variant):
    import airlight

    built = mi.load_string(scene(position="0, nan, 0"))
    with pytest.raises(InputError, match="light 'lamp': position has nan"):
        airlight.load_scene(built)


def test_overlapping_media_are_named(variant, tmp_path):
    """Without an id they were called ''."""
    with pytest.raises(InputError, match=r"shapes 'sphere-\d' and 'sphere-\d'"):
        load(tmp_path, scene(extra=cloud(name="") + cloud(name="")))


def test_deep_elements_are_refused(variant, tmp_path):
    """Mitsuba's reader calls itself for each and ended the process."""
    deep = "<scene version='3.0.0'>" + "<shape>" * 20000 + "</shape>" * 20000 + "</scene>"
    with pytest.raises(InputError, match="nested 20001 deep; expected at most 200"):
        load(tmp_path, deep)


def test_no_opaque_shape_without_a_name_is_lost_beside_bounded_media(variant):
    """A dictionary with one key for all of them kept the last alone."""
    text = scene(extra='<shape type="rectangle"/><shape type="cube"/>' + cloud())
    read = read_scene(mi.load_string(text))
    assert len(read.geometry.shapes()) == 3
    assert np.isfinite(np.array(read.geometry.bbox().max)).all()
