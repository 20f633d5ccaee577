# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a digest changes with every change of a scene, and with nothing else."""

import os
import subprocess
import sys
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest

from airlight.reference.storage.scene_digest import build_scene, is_whole, scene_digest
from airlight.validation.scenes.loading import load_scene
from tests.helpers.scenes import spot, tiny_scene

ROOT = Path(__file__).resolve().parents[3]


def load(**changes):
    return mi.load_dict(tiny_scene(size=(5, 4), **changes))


def changed(name, **entries):
    """The scene with other values in one of its entries."""
    return load(**{name: tiny_scene()[name] | entries})


def rgb(*values):
    return {"type": "rgb", "value": list(values)}


SUN = {
    "type": "directional",
    "direction": [0, 0, -1],
    "irradiance": {"type": "rgb", "value": [1, 2, 3]},
}

CHANGES = {
    "extinction": lambda: changed("fog", sigma_t=0.3100001),
    "scale of the extinction": lambda: changed("fog", scale=1.1),
    "red albedo": lambda: changed("fog", albedo=rgb(0.91, 0.8, 0.7)),
    "Rayleigh phase function": lambda: changed("fog", phase={"type": "rayleigh"}),
    "HG phase function": lambda: changed("fog", phase={"type": "hg", "g": 0.3}),
    "light's position": lambda: changed("lamp", position=[0.9, 0.7, 1.91]),
    "spot": lambda: load(lamp=spot()),
    "spot's beam": lambda: load(lamp=spot(beam=17.0)),
    "radius": lambda: changed("ball", radius=0.411),
    "centre": lambda: changed("ball", center=[0.1, 0.1, 0.71]),
    "both sides": lambda: changed(
        "ball", bsdf={"type": "twosided", "bsdf": tiny_scene()["ball"]["bsdf"]}
    ),
    "turned inside out": lambda: changed("ball", flip_normals=True),
    "without the sphere": lambda: load(ball=None),
    "field of view": lambda: changed("sensor", fov=49.5),
    "near clip": lambda: changed("sensor", near_clip=1e-3),
    "centre of the image": lambda: changed("sensor", principal_point_offset_x=0.1),
    "extinction by channel": lambda: changed("fog", has_spectral_extinction=True),
    "lights unsampled": lambda: changed("fog", sample_emitters=False),
    "a table of the phase function": lambda: changed(
        "fog", phase={"type": "tabphase", "values": "1,2,3"}
    ),
    "another table": lambda: changed("fog", phase={"type": "tabphase", "values": "1,2,4"}),
    "light in the fog": lambda: changed("lamp", medium={"type": "ref", "id": "fog"}),
    "sun": lambda: load(lamp=SUN),
    "colour of the sun": lambda: load(lamp=SUN | {"irradiance": rgb(1, 2, 4)}),
    "sky": lambda: load(lamp={"type": "constant", "radiance": rgb(1, 2, 3)}),
    "colour of the sky": lambda: load(lamp={"type": "constant", "radiance": rgb(1, 2, 4)}),
    "area light": lambda: changed("ball", emitter={"type": "area", "radiance": rgb(1, 2, 3)}),
    "its colour": lambda: changed("ball", emitter={"type": "area", "radiance": rgb(1, 2, 4)}),
    "disk": lambda: load(ball={"type": "disk"}),
    "cube": lambda: load(ball={"type": "cube"}),
    "cube inside out": lambda: load(ball={"type": "cube", "flip_normals": True}),
    "metal": lambda: changed("ball", bsdf={"type": "conductor"}),
    "another metal": lambda: changed("ball", bsdf={"type": "conductor", "material": "Au"}),
    "another medium inside": lambda: changed("ball", interior={"type": "homogeneous"}),
    "size": lambda: changed("sensor", film=tiny_scene(size=(6, 4))["sensor"]["film"]),
    "nothing": load,
}


def test_every_change_of_a_scene_changes_its_digest(variant):
    """A key that does not change would answer with the reference of another scene."""
    digests = {name: scene_digest(make()) for name, make in CHANGES.items()}
    assert len(set(digests.values())) == len(CHANGES)
    assert digests["nothing"] == scene_digest(load())


PIXELS = np.linspace(0.1, 0.9, 12, dtype=np.float32).reshape(2, 2, 3)


def textured(**properties):
    texture = {"type": "bitmap", "bitmap": mi.Bitmap(PIXELS), "raw": True} | properties
    return {"ball": tiny_scene()["ball"] | {"bsdf": {"type": "diffuse", "reflectance": texture}}}


def smoky(**properties):
    grid = {
        "type": "gridvolume",
        "grid": mi.VolumeGrid(np.linspace(0, 1, 24, dtype=np.float32).reshape(2, 3, 4)),
    }
    phase = {"type": "hg", "g": 0.3}
    return {
        "fog": {
            "type": "heterogeneous",
            "id": "fog",
            "sigma_t": grid | properties,
            "albedo": 0.9,
            "phase": phase,
        }
    }


HIDDEN = [
    {},
    {"filter_type": "nearest"},
    {"wrap_mode": "clamp"},
    {"wrap_mode": "mirror"},
]


@pytest.mark.parametrize("parts", [textured, smoky])
def test_filters_and_borders_count_though_no_built_object_tells_them(variant, parts):
    """Images of two scenes that differ by them alone were taken for each other."""
    scenes = [build_scene(tiny_scene(size=(5, 4), **parts(**properties))) for properties in HIDDEN]
    assert len({scene_digest(scene) for scene in scenes}) == len(HIDDEN)
    assert scene_digest(build_scene(tiny_scene(size=(5, 4), **parts()))) == scene_digest(scenes[0])
    changed = mi.traverse(scenes[0])
    changed["lamp.position"] = [0.0, 0.0, 1.0]
    changed.update()
    assert scene_digest(scenes[0]) not in {scene_digest(scene) for scene in scenes[1:]}


@pytest.mark.parametrize("parts", [textured, smoky])
def test_a_scene_that_nobody_can_tell_from_another_has_no_digest(variant, parts):
    scene = load(**parts())
    assert not is_whole(scene)
    assert scene_digest(scene) is None


def test_a_dictionary_with_an_object_that_was_built_before_has_a_digest_if_mitsuba_tells_all_of_it(
    variant,
):
    built = [mi.load_dict(part["ball"]) for part in (textured(), textured(filter_type="nearest"))]
    assert [scene_digest(build_scene(tiny_scene(size=(5, 4), ball=ball))) for ball in built] == [
        None,
        None,
    ]
    plain = [mi.load_dict(tiny_scene()["ball"] | {"radius": radius}) for radius in (0.4, 0.5)]
    digests = [
        scene_digest(build_scene(tiny_scene(size=(5, 4), ball=ball, **smoky()))) for ball in plain
    ]
    assert None not in digests
    assert digests[0] != digests[1]


FILE = """<scene version="3.0.0">
    <medium type="homogeneous" id="fog"><float name="sigma_t" value="0.31"/></medium>
    <emitter type="point"><rgb name="intensity" value="5, 4, 3"/></emitter>
    <sensor type="perspective"><ref name="medium" id="fog"/></sensor>
    <shape type="sphere"><bsdf type="diffuse">
        <texture type="bitmap" name="reflectance"><string name="filename" value="a.exr"/>{}</texture></bsdf></shape>
</scene>"""


def test_a_scene_file_counts_with_its_words_and_with_the_files_that_it_names(variant, tmp_path):
    def digest(words="", pixels=PIXELS):
        mi.Bitmap(pixels).write(str(tmp_path / "a.exr"))
        (tmp_path / "scene.xml").write_text(FILE.format(words))
        return scene_digest(load_scene(str(tmp_path / "scene.xml"), (5, 4)).scene)

    nearest = '<string name="filter_type" value="nearest"/>'
    assert None not in (digests := [digest(), digest(nearest), digest(pixels=PIXELS[::-1].copy())])
    assert len(set(digests)) == 3
    assert digest() == digests[0]


UNNAMED = """<scene version="3.0.0">
    <medium type="homogeneous" id="fog"><float name="sigma_t" value="0.31"/></medium>
    <emitter type="point"><rgb name="intensity" value="5, 4, 3"/></emitter>
    <sensor type="perspective"><ref name="medium" id="fog"/></sensor>
    <shape type="sphere"><bsdf type="conductor"/></shape>
    <shape type="sphere"><bsdf type="twosided"><bsdf type="diffuse"/></bsdf></shape>
</scene>"""


def test_digest_is_the_same_at_every_load_and_in_another_process(variant):
    """Names by address, hash seeds and set order must not enter."""
    first = mi.load_string(UNNAMED)
    # so that the next scene lies elsewhere in memory
    keep = [mi.load_dict({"type": "sphere"}) for _ in range(7)]
    second = mi.load_string(UNNAMED)
    assert len(keep) == 7
    assert scene_digest(first) == scene_digest(second)
    script = (
        "import sys, mitsuba as mi; mi.set_variant(sys.argv[1])\n"
        "from airlight.reference.storage.scene_digest import scene_digest\n"
        "print(scene_digest(mi.load_string(sys.argv[2])))"
    )
    environment = os.environ | {"PYTHONHASHSEED": "4711", "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", script, variant, UNNAMED]
    process = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert process.stdout.split()[-1] == scene_digest(first)
