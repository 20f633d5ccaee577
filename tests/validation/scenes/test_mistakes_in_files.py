# SPDX-License-Identifier: BSD-3-Clause
"""Files that people give in place of a scene, and mistakes in one, are refused in one
line that says what to do.
"""

import gzip
import re

import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.read import read_reference
from airlight.reference.storage.exr import Image, read_exr, write_exr
from airlight.validation.scenes.files.camera import clip_notes
from airlight.validation.scenes.files.media import mirrored_grids
from airlight.validation.scenes.loading import load_scene
from tests.helpers.bad_inputs import scene

REFLECTANCE = '<bsdf type="diffuse"><rgb name="reflectance" value="{}"/></bsdf>'
GRID = '<volume type="gridvolume" name="sigma_t"><string name="filename" value="{}"/></volume>'


def smoke(file):
    """Return a scene whose medium reads a grid from a file."""
    sigma_t = '<rgb name="sigma_t" value="0.2, 0.2, 0.2"/>'
    return scene().replace(sigma_t, GRID.format(file)).replace("homogeneous", "heterogeneous")


#: A file, or its text with a mistake, and words of what is said.
MISTAKES = {
    "empty": ("", "the file is empty; expected a Mitsuba XML file"),
    "blank": (" \n\n", "the file is empty"),
    "an image": (
        b"\x76\x2f\x31\x01\x02\x00\x00\x00",
        "the file is an EXR image.*airlight compare SCENE IMAGE",
    ),
    "binary glTF": (b"glTF\x02\x00\x00\x00", "the file is a glTF file"),
    "Blender": (b"BLENDER-v300", "Blender.*add-on for Mitsuba"),
    "compressed": (gzip.compress(scene().encode()), "a compressed file.*unpack it"),
    "JSON": ('{"asset": {"version": "2.0"}}', "the file is no XML, it begins with"),
    "another encoding": (
        scene().replace("ball", "K\u00fcgel").encode("latin-1"),
        "no UTF-8.*save it as UTF-8",
    ),
    "unclosed": (scene().replace("</scene>", ""), "expected well-formed XML"),
    "a comma in a number": (scene(fov="45,5"), '"45,5"; expected decimal points'),
    "commas in a colour": (scene(intensity="0,5 0,4 0,3"), "expected decimal points"),
    "commas in a vector": (scene(origin="0,5 -5,0 1,0"), "numbers have decimal points"),
    "a unit": (scene(radius="0.5 m"), "expected a number alone, without a unit"),
    "a property twice": (
        scene(extra='<ref name="medium" id="fog"/>').replace(
            '<float name="fov"', '<float name="fov" value="40"/><float name="fov"'
        ),
        "the property is given twice",
    ),
    "no number": (scene(scale=""), "value of <float> in line 3 is empty; expected a number"),
    "an unset parameter": (scene(radius="$r"), '<default name="r" value="..."/>'),
    "an infinite extinction": (
        scene(sigma_t="inf, 0.2, inf"),
        "sigma_t is inf, 0.2, inf; expected finite numbers",
    ),
    "a ball of any size": (
        scene(radius="1e30"),
        "'ball': to_world has 1e.30.*expected finite numbers of at most",
    ),
    "no version": (scene().replace(' version="3.0.0"', ""), 'expected <scene version="3.0.0">'),
    "an id twice": (
        scene(extra='<shape type="cube" id="ball"/>'),
        'duplicate ID: "ball".*expected ids that differ',
    ),
    "an unknown plugin": (
        scene(extra='<shape type="teapot"/>'),
        '"teapot" not found; expected a plugin of Mitsuba',
    ),
    "an unknown element": (
        scene(extra='<emiter type="point"/>'),
        "<emiter>; expected elements of Mitsuba's format",
    ),
    "a property misspelt": (
        scene().replace('"radius"', '"radios"'),
        '"radios".*check the spelling',
    ),
    "a reference to nothing": (scene(extra='<ref id="wood"/>'), 'object with id="wood" exists'),
    "a mesh that is missing": (
        scene(
            extra=(
                '<shape type="obj" id="rock"><string name="filename" '
                'value="meshes/rock.obj"/></shape>'
            )
        ),
        "shape 'rock' names the file meshes/rock.obj, which is not in .*copy it there",
    ),
    "a path of Windows": (
        scene(
            extra=(
                '<shape type="ply" id="rock"><string name="filename" value="C:\\rock.ply"/></shape>'
            )
        ),
        "'/' in place of backslashes",
    ),
    "an include that is missing": (
        scene(extra='<include filename="lamps.xml"/>'),
        '"lamps.xml" not found; expected it',
    ),
    "a grid that is missing": (
        smoke("smoke.vol"),
        "gridvolume of medium 'fog' names the file smoke.vol, which is not",
    ),
    "OpenVDB": (
        smoke("smoke.vdb"),
        "gridvolume of medium 'fog' names the file smoke.vdb, which is not in",
    ),
    "an array for a grid": (
        smoke("values.npy"),
        "values.npy, no grid of Mitsuba, which is not read",
    ),
    "an albedo above 1": (
        scene(albedo="1.2, 0.8, 0.7"),
        "medium 'fog' has albedo 1.2, 0.8, 0.7; expected values from 0",
    ),
    "one albedo above 1": (
        scene().replace(
            '<rgb name="albedo" value="0.9, 0.8, 0.7"/>', '<float name="albedo" value="1.5"/>'
        ),
        "medium 'fog': albedo has 1.5.*no more than arrives",
    ),
    "a reflectance of bytes": (
        scene(extra=f'<shape type="cube" id="box">{REFLECTANCE.format("255, 128, 64")}</shape>'),
        "diffuse of shape 'box' has reflectance 255, 128, 64;.*divide them by 255",
    ),
}


@pytest.mark.claim("scenes-refused-by-name", tolerance="by name")
@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_in_a_file_is_one_line_that_says_what_to_do(variant, tmp_path, mistake):
    given, words = MISTAKES[mistake]
    path = tmp_path / "own.xml"
    path.write_bytes(given if isinstance(given, bytes) else given.encode())
    np.save(tmp_path / "values.npy", np.ones((2, 2, 2)))
    with pytest.raises(InputError, match=words) as refusal:
        load_scene(str(path))
    # the file, or a part by its name
    assert str(path) in str(refusal.value) or "'" in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_scene_without_a_camera_is_refused_by_both_readers(variant, tmp_path):
    sensor = re.compile("<sensor.*?</sensor>", re.DOTALL)
    (tmp_path / "own.xml").write_text(sensor.sub("", scene()))
    loaded = load_scene(str(tmp_path / "own.xml")).scene
    for read in (read_reference, read_scene):
        with pytest.raises(InputError, match="the scene has no camera"):
            read(loaded)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_marks_of_the_byte_order_are_read(variant, tmp_path, encoding):
    (tmp_path / "own.xml").write_text(scene(), encoding=encoding)
    assert [shape.id() for shape in load_scene(str(tmp_path / "own.xml")).scene.shapes()] == [
        "ball"
    ]


def test_an_extinction_above_1_goes_into_the_scale(variant, tmp_path):
    """Mitsuba takes it for a reflectance and refuses it; the medium is that with a scale."""
    images = []
    for name, sigma_t, scale in (
        ("above", "1.2, 1.6, 2.0", "0.5"),
        ("scaled", "0.6, 0.8, 1.0", "1"),
    ):
        (tmp_path / f"{name}.xml").write_text(scene(sigma_t=sigma_t, scale=scale))
        images.append(
            quadrature_image(
                read_reference(load_scene(str(tmp_path / f"{name}.xml")).scene), checks=0
            )
        )
    np.testing.assert_allclose(images[0].airlight, images[1].airlight, rtol=1e-6)


@pytest.mark.parametrize(
    ("scale", "noted"), [("-2, 1, 1", True), ("-2, -1, 1", False), ("2, 1, 1", False)]
)
def test_a_mirrored_grid_is_noted(variant, scale, noted):
    place = f'<transform name="to_world"><scale value="{scale}"/></transform></volume>'
    config = mi.parser.ParserConfig(mi.variant())
    state = mi.parser.parse_string(config, smoke("smoke.vol").replace("</volume>", place))
    mi.parser.transform_resolve(config, state)
    assert bool(mirrored_grids(state)) == noted


def test_clip_planes_are_noted_where_they_cut_mitsubas_own_image(variant, tmp_path):
    """By their distance and the optical depth before it; what every scene
    has by default is no note.
    """

    def notes(*planes, **changes):
        words = "".join(f'<float name="{name}" value="{value}"/>' for name, value in planes)
        text = scene(**changes).replace('<float name="fov"', words + '<float name="fov"')
        (tmp_path / "own.xml").write_text(text)
        return clip_notes(load_scene(str(tmp_path / "own.xml")).scene)

    assert not notes()
    (both,) = notes(("near_clip", 3), ("far_clip", 4))
    assert (
        "near_clip, 3 m (an optical depth of 0.6); and what is beyond far_clip, 4 m (an optical "
        "depth of 0.8)" in both
    )
    assert both.endswith("by --model ends=planes:3:4")
    assert notes(("near_clip", 3))[0].endswith("by --model ends=planes:3:inf")
    assert notes(("far_clip", 4))[0].endswith("by --model ends=planes:0:4")
    # fog of 10 optical depths: beyond it little is left, not 0
    assert "near_clip" not in notes(("far_clip", 50))[0]
    assert not notes(("far_clip", 100))  # 20 optical depths
    # In vacuum nothing is lost before the nearest shape, which begins 5 m away.
    ball = '<bsdf type="null"/><ref name="interior" id="fog"/>'
    clear = {"origin": "-0.6, -5, 0.5", "target": "-0.6, 1, 0.5", "extra": ""}
    text = (
        scene(**clear)
        .replace('<ref name="medium" id="fog"/>', "")
        .replace("</shape>", ball + "</shape>")
    )
    for near, noted in ((4.9, False), (5.3, True)):
        plane = f'<float name="near_clip" value="{near}"/>'
        (tmp_path / "own.xml").write_text(
            text.replace('<float name="fov"', plane + '<float name="fov"')
        )
        assert bool(clip_notes(load_scene(str(tmp_path / "own.xml")).scene)) == noted


def test_a_far_plane_behind_a_grid_cuts_nothing(variant, tmp_path):
    """A grid ends at its box, and is no fog without end."""
    mi.VolumeGrid(np.full((2, 2, 2, 1), 0.3, np.float32)).write(str(tmp_path / "smoke.vol"))
    for plane, noted in (("", False), ('<float name="far_clip" value="0.5"/>', True)):
        text = smoke("smoke.vol").replace('<float name="fov"', plane + '<float name="fov"')
        (tmp_path / "own.xml").write_text(text)
        assert bool(clip_notes(load_scene(str(tmp_path / "own.xml")).scene)) == noted


IMAGES = {
    "screen.exr": (b"\x89PNG\r\n\x1a\n", "not an EXR file but PNG; .*save linear radiance as EXR"),
    "sky.hdr": (b"#?RADIANCE\n", "not an EXR file but Radiance HDR; convert it"),
    "array.npy": (b"\x93NUMPY\x01\x00", r"an array of NumPy; .*numpy\.load"),
    "empty.exr": (b"", "not an EXR file; expected linear radiance as EXR"),
}


@pytest.mark.parametrize("name", IMAGES)
def test_images_of_other_kinds_are_refused_with_what_to_do(tmp_path, name):
    (tmp_path / name).write_bytes(IMAGES[name][0])
    with pytest.raises(InputError, match=IMAGES[name][1]):
        read_exr(tmp_path / name)


def test_an_image_that_ends_in_the_middle_is_broken(tmp_path):
    write_exr(tmp_path / "whole.exr", Image({"airlight": np.ones((24, 32, 3))}))
    data = (tmp_path / "whole.exr").read_bytes()
    (tmp_path / "half.exr").write_bytes(data[: len(data) * 6 // 10])
    with pytest.raises(InputError, match=r"half\.exr is a broken EXR file.*copy it again"):
        read_exr(tmp_path / "half.exr")
