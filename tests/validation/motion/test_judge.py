# SPDX-License-Identifier: BSD-3-Clause
"""Claim: frames of a scene that changes are judged by the reference of each; a file
that is wrong is refused.
"""

import json
import re

import numpy as np
import pytest

from airlight.errors import InputError
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.storage.exr import Image, write_exr
from airlight.validation.columns import plain
from airlight.validation.motion import judge
from airlight.validation.motion.judge import compare_frames
from airlight.validation.motion.measures import Sequence
from airlight.validation.motion.noise import compare_runs
from airlight.validation.scenes.loading import load_scene
from tests.helpers.scenes import scene_xml

SIZE = (32, 24)
FRAMES = 8


def written(folder, images, **about):
    for number, image in enumerate(images, 1):
        write_exr(
            folder / f"{number:04d}.exr",
            Image({"airlight": np.asarray(image, dtype=np.float32)}),
            finite=False,
        )
    file = folder / "frames.json"
    file.write_text(
        json.dumps({"schema": "airlight-frames/1", "first": 1, "frames": len(images)} | about)
    )
    return str(folder / "####.exr"), file


@pytest.fixture(scope="module")
def lights(variant):
    """Return the places of a light, and the references of their frames."""
    places = [[0.83 - 0.15 * n, 0.47, 1.57] for n in range(FRAMES)]
    scenes = [
        load_scene("open-fog", SIZE, {"light.position": tuple(place)}).scene for place in places
    ]
    return {"light.position": places}, [reference_image(scene).airlight for scene in scenes]


def test_the_fog_of_the_last_frame_is_late(lights, tmp_path):
    changes, references = lights
    late = [references[0], *references[:-1]]
    found = compare_frames("open-fog", *written(tmp_path, late, changes=changes, pixel="centre"))
    assert found.verdict.words == "the frames are late by 1 frame"
    assert found.shifts[1] < 1e-6 < found.shifts[0]
    assert found.measures.repeated == (1,)
    numbers = plain(found)["masks"]["all"]
    for name in ["relative_rmse", "flicker", "bias", "ghost"]:
        assert numbers[name].keys() == {"value", "error", "kind"}
    for name in ["gain", "persistence", "delay_margin", "lag", "time_constant"]:
        assert numbers["lag"][name].keys() == {"value", "error", "kind"}
    assert numbers["lag"]["delay"] == 1


def test_a_frame_without_a_finite_value_is_named(lights, tmp_path):
    changes, references = lights
    frames = [*references[:3], np.nan * references[3], *references[4:]]
    found = compare_frames("open-fog", *written(tmp_path, frames, changes=changes, pixel="centre"))
    assert found.failures == (
        f"{references[3].size} values are NaN or infinite, in frames 3 (0004.exr)",
    )
    # Its error against earlier references was 0.
    light = np.ones((2, 2, 3))
    images = [1.01 * light] * 3 + [np.nan * light] + [1.01 * light] * 4
    everywhere = np.ones((2, 2), dtype=bool)
    still = Sequence(8, images.__getitem__, lambda n: light, lambda n: everywhere)
    assert judge._shifts(still) == pytest.approx(dict.fromkeys(range(-2, 4), 0.01))
    files = written(
        tmp_path, [np.nan * each for each in references], changes=changes, pixel="centre"
    )
    with pytest.raises(InputError, match="no frame has a finite value"):
        compare_frames("open-fog", *files)


def test_a_margin_that_too_few_frames_tell_is_not_kept(lights, tmp_path):
    """The error of a bias of seven frames is not known: it counted as 0, and the bias
    of 0.4 % as within 0.5 %.
    """
    changes, references = {"light.position": lights[0]["light.position"][:7]}, lights[1][:7]
    frames = [1.004 * each for each in references]
    found = compare_frames(
        "open-fog", *written(tmp_path, frames, changes=changes, pixel="centre"), margin=0.005
    )
    assert "not shown to be within +-0.005: its error is unknown" in found.failures[0]
    exact = compare_frames(
        "open-fog", *written(tmp_path, references, changes=changes, pixel="centre"), margin=0.005
    )
    assert not exact.failures


def test_a_margin_below_the_error_of_the_reference_is_not_kept(lights, tmp_path, monkeypatch):
    """Frames within three errors of a reference are called exact, and kept any margin. The margin
    holds their RMSE and the error of the reference together.
    """
    changes, references = {"light.position": lights[0]["light.position"][:7]}, lights[1][:7]
    monkeypatch.setattr(judge, "relative_error", lambda known: 0.05)
    monkeypatch.setattr(judge, "off_by", lambda *reference, emitted: (0.05, 0.05))
    files = written(
        tmp_path, [1.004 * each for each in references], changes=changes, pixel="centre"
    )
    kept, *missed = (compare_frames("open-fog", *files, margin=each) for each in (0.2, 0.05, 0.001))
    assert not kept.failures
    for each in (kept, *missed):
        assert each.verdict.kind == "exact"
    for each, margin in zip(missed, (0.05, 0.001), strict=True):
        assert f"not shown to be within +-{margin}" in each.failures[0]


def test_frames_of_a_scene_that_names_its_equation_are_judged_by_it(variant, tmp_path):
    """Frames were judged by physics without a word, runs by the equation without its name."""
    named = '<default name="airlight-model" value="light-path=off"/>'
    scene = tmp_path / "own.xml"
    scene.write_text(re.sub("(<scene[^>]*>)", rf"\1{named}", scene_xml(), count=1))
    loaded = load_scene(str(scene), (16, 12))
    image = reference_image(loaded.scene, model=loaded.model).airlight
    pattern, about = written(tmp_path, [image, image], pixel="centre", scene="hall")
    frames = compare_frames(str(scene), pattern, about)
    assert frames.verdict.kind == "exact"
    assert "is of the scene hall" in frames.notes[1]
    random = np.random.default_rng(5)
    written(tmp_path, [image + 1e-3 * image.mean() * random.normal(size=image.shape) for _ in "ab"])
    runs = compare_runs(str(scene), pattern, pixel="centre")
    assert abs(runs.noise.bias.value) < 0.01
    for found in (frames, runs):
        assert found.notes[0].startswith("judged by the equation of light-path=off")


def test_exposure_is_taken_away(lights, tmp_path):
    changes, references = lights
    stops = [0.5 * n for n in range(FRAMES)]
    frames = [2**stop * image for stop, image in zip(stops, references, strict=True)]
    found = compare_frames(
        "open-fog", *written(tmp_path, frames, changes=changes, pixel="centre", exposure=stops)
    )
    assert found.verdict.kind == "exact"


def test_jittered_frames_are_those_between_the_pixels(variant, tmp_path):
    """Every second pixel of an image of twice the size passes a quarter of a
    pixel beside the centres.
    """
    size, quarters = (16, 12), [(-0.25, -0.25), (0.25, -0.25), (-0.25, 0.25), (0.25, 0.25)]
    fine = reference_image(load_scene("sphere-spot", (32, 24)).scene).airlight
    frames = [fine[int(down > 0) :: 2, int(right > 0) :: 2] for right, down in 2 * quarters]
    assert frames[0].shape == (*size[::-1], 3)
    kinds = {}
    for sign in (1, -1):
        jitter = [[sign * right, sign * down] for right, down in 2 * quarters]
        found = compare_frames(
            "sphere-spot", *written(tmp_path, frames, jitter=jitter, pixel="centre")
        )
        kinds[sign] = found.verdict.kind
        assert "disoccluded" not in found.masks
    assert kinds[1] == "exact"
    assert kinds[-1] != "exact"


def test_what_a_camera_uncovers_has_a_row_of_its_own(variant, tmp_path):
    size = (48, 36)
    origin = np.array(load_scene("sphere-spot", size).scene.sensors()[0].world_transform().matrix)[
        :3, 3
    ].ravel()
    places = [[float(origin[0] + 0.12 * n), *map(float, origin[1:])] for n in range(4)]
    images = [
        reference_image(
            load_scene("sphere-spot", size, {"camera.origin": tuple(place)}).scene
        ).airlight
        for place in places
    ]
    found = compare_frames(
        "sphere-spot", *written(tmp_path, images, changes={"camera.origin": places}, pixel="centre")
    )
    assert {"all", "disoccluded", "rest"} <= found.masks.keys()
    parts = [found.masks[name].values for name in ("disoccluded", "rest")]
    assert sum(parts) == found.measures.values
    assert 0 < parts[0] < 0.5 * sum(parts)


SCENE = """<scene version="3.0.0"><integrator type="volpath"/>
<medium type="homogeneous" id="fog"><rgb name="sigma_t" value="0.2"/></medium>
<sensor type="perspective"><float name="fov" value="60"/><ref id="fog" name="medium"/>
 <transform name="to_world"><lookat origin="0, -5, 1" target="0, 0, 1" up="0, 0, 1"/></transform>
 <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="24"/></film></sensor>
<emitter type="point"><point name="position" x="0.3" y="0.5" z="2.6"/><rgb name="intensity" value="9"/></emitter>
<shape type="sphere" id="ball"><float name="radius" value="0.4"/><transform name="to_world">%s
 <translate z="1.5"/></transform></shape>
<shape type="rectangle" id="wall"><transform name="to_world"><scale value="3"/><rotate x="1" angle="90"/>
 <translate y="3" z="1"/>%s</transform></shape></scene>"""


def test_objects_that_move_are_where_a_scene_file_has_them(variant, tmp_path):
    ball, wall, images = [], [], []
    for n in range(3):
        x, scale, angle = 0.3 * n, 1 + 0.2 * n, 0.1 * n
        moved = SCENE % (
            f'<scale value="{scale}"/><translate x="{x}"/>',
            f'<rotate z="1" angle="{np.degrees(angle)}"/>',
        )
        (tmp_path / "moved.xml").write_text(moved)
        images.append(reference_image(load_scene(str(tmp_path / "moved.xml")).scene).airlight)
        ball.append(
            [[scale, 0, 0, x], [0, scale, 0, 0], [0, 0, scale, 1.5 - 1.5 * scale], [0, 0, 0, 1]]
        )
        cos, sin = np.cos(angle), np.sin(angle)
        wall.append([[cos, -sin, 0, 0], [sin, cos, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    (tmp_path / "scene.xml").write_text(SCENE % ("", ""))
    scene = str(tmp_path / "scene.xml")
    found = compare_frames(
        scene, *written(tmp_path, images, objects={"ball": ball, "wall": wall}, pixel="centre")
    )
    assert found.verdict.kind == "exact"
    assert found.measures.reference_change > 0.01
    # The ball leaves half of where it stood.
    assert 0 < found.masks["disoccluded"].values < 0.3 * found.measures.values


@pytest.mark.parametrize(
    ("about", "words"),
    [
        ({"frames": 9}, "frame 8 has no file"),
        ({"first": 3}, "frame 6 has no file"),
        (
            {"changes": {"light.position": [[0, 0, 1]]}},
            "light.position has 1 values, expected one for each of 8",
        ),
        ({"changes": {"light.place": [1] * FRAMES}}, "frame 0: --change: got 'light.place'"),
        ({"exposure": [1.0]}, "exposure has 1 values"),
        ({"exposure": "bright"}, "exposure: got 'bright', expected a number from"),
        ({"exposure": 5000}, "exposure: got 5000, expected a number from -100 to 100"),
        ({"resets": [8]}, "resets has 8, expected frames from 0 to 7"),
        ({"resets": []}, "8 frames without resets: the first 16 only start the filter"),
        ({"fps": 0}, "fps: got 0, expected a number from 1e-06"),
        ({"frame": 8}, "got 'frame'"),
        ({"jitter": [[0, 0]]}, "jitter has 1 values"),
        (
            {"jitter": [[0, 0, 0]] * FRAMES},
            "jitter[0]: got [0, 0, 0], expected right and down [pixels]",
        ),
        (
            {"jitter": [[0, 3]] * FRAMES},
            "jitter[0]: got [0, 3], expected right and down [pixels], each at most 1",
        ),
        (
            {"objects": {"ground": [np.eye(4).tolist()]}},
            "ground has 1 values, expected one for each of 8",
        ),
        ({"objects": {"ground": [np.eye(3).tolist()] * FRAMES}}, "objects.ground[0]: got [[1.0"),
        (
            {"objects": {"ground": [np.diag([1, 1, 2, 1]).tolist()] * FRAMES}},
            "not a rotation times a scale",
        ),
        (
            {"objects": {"grund": [np.eye(4).tolist()] * FRAMES}},
            "frame 0: objects: got 'grund', the scene has no shapes",
        ),
        ({"schema": "airlight-frames/2"}, 'expected an object with "schema"'),
    ],
)
def test_what_is_wrong_with_the_file_is_said(lights, tmp_path, about, words):
    pattern, file = written(tmp_path, lights[1], **about)
    with pytest.raises(InputError, match=re.escape(words)):
        compare_frames("open-fog", pattern, file)


def test_frames_of_two_sizes_are_refused_by_number(lights, tmp_path):
    changes, references = lights
    images = [*references[:5], references[5][:, :16], *references[6:]]
    pattern, file = written(tmp_path, images, changes=changes)
    with pytest.raises(
        InputError, match=r"frame 5: .*0006.exr has 16 x 24 pixels, the first frame 32 x 24"
    ):
        compare_frames("open-fog", pattern, file)


def test_frames_of_a_scene_at_rest_share_a_reference_and_grow_old(variant, tmp_path, monkeypatch):
    """A camera that moves once: what it uncovers stays recent for some frames, though
    nothing changes in them.
    """
    size, asked = (16, 12), []
    monkeypatch.setattr(
        judge,
        "reference_image",
        lambda *args, **how: asked.append(1) or reference_image(*args, **how),
    )
    monkeypatch.setattr(judge, "_RECENT", 2)
    origin = np.array(load_scene("sphere-spot", size).scene.sensors()[0].world_transform().matrix)[
        :3, 3
    ].ravel()
    here, there = ([float(origin[0] + shift), *map(float, origin[1:])] for shift in (0.0, 0.4))
    scenes = [
        load_scene("sphere-spot", size, {"camera.origin": tuple(at)}).scene for at in (here, there)
    ]
    images = [reference_image(scene).airlight for scene in scenes]
    uncovered = []
    for rest in (1, 3):
        frames = [images[0], *rest * [images[1]]]
        changes = {"camera.origin": [here, *rest * [there]]}
        asked.clear()
        found = compare_frames(
            "sphere-spot", *written(tmp_path, frames, changes=changes, pixel="centre")
        )
        assert len(asked) == 2
        assert found.verdict.kind == "exact"
        uncovered.append(found.masks["disoccluded"].values)
    assert uncovered[0] > 0
    assert uncovered[1] == 3 * uncovered[0]  # in the frame itself and the two after it
