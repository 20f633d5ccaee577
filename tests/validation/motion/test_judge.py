# SPDX-License-Identifier: BSD-3-Clause
"""Claim: frames of a scene that changes are judged by the reference of each; a file that is wrong is refused."""

import json
import re

import numpy as np
import pytest

from analytic.errors import InputError
from reference.storage.exr import Image, write_exr
from validation.estimates.quadrature import truth_image
from validation.motion.judge import compare_frames
from validation.scenes.loading import load_scene

SIZE = (32, 24)
FRAMES = 8


def written(folder, images, **about):
    for number, image in enumerate(images, 1):
        write_exr(folder / f"{number:04d}.exr", Image({"airlight": np.asarray(image, dtype=np.float32)}), finite=False)
    file = folder / "frames.json"
    file.write_text(json.dumps({"schema": "airlight-frames/1", "first": 1, "frames": len(images)} | about))
    return str(folder / "####.exr"), file


@pytest.fixture(scope="module")
def lights(variant):
    """Return the places of a light, and the references of their frames."""
    places = [[0.83 - 0.15 * n, 0.47, 1.57] for n in range(FRAMES)]
    scenes = [load_scene("open-fog", SIZE, {"light.position": tuple(place)}).scene for place in places]
    return {"light.position": places}, [truth_image(scene).airlight for scene in scenes]


def test_the_fog_of_the_last_frame_is_late(lights, tmp_path):
    changes, references = lights
    late = [references[0], *references[:-1]]
    found = compare_frames("open-fog", *written(tmp_path, late, changes=changes, pixel="centre"))
    assert found.verdict.words == "the frames are late by 1 frame"
    assert found.shifts[1] < 1e-6 < found.shifts[0]
    assert found.measures.repeated == (1,)
    numbers = found.to_json()
    for name in ["relative_rmse", "flicker", "gain", "persistence", "delay", "lag", "time_constant", "bias", "ghost"]:
        assert {name, f"{name}_se"} <= numbers.keys()


def test_exposure_is_taken_away(lights, tmp_path):
    changes, references = lights
    stops = [0.5 * n for n in range(FRAMES)]
    frames = [2**stop * image for stop, image in zip(stops, references, strict=True)]
    found = compare_frames("open-fog", *written(tmp_path, frames, changes=changes, pixel="centre", exposure=stops))
    assert found.verdict.kind == "exact"


def test_what_a_camera_uncovers_has_a_row_of_its_own(variant, tmp_path):
    size = (48, 36)
    origin = np.array(load_scene("sphere-spot", size).scene.sensors()[0].world_transform().matrix)[:3, 3].ravel()
    places = [[float(origin[0] + 0.12 * n), *map(float, origin[1:])] for n in range(4)]
    images = [
        truth_image(load_scene("sphere-spot", size, {"camera.origin": tuple(place)}).scene).airlight for place in places
    ]
    found = compare_frames("sphere-spot", *written(tmp_path, images, changes={"camera.origin": places}, pixel="centre"))
    assert {"all", "disoccluded", "rest"} <= found.masks.keys()
    parts = [found.masks[name].values for name in ("disoccluded", "rest")]
    assert sum(parts) == found.measures.values
    assert 0 < parts[0] < 0.5 * sum(parts)


@pytest.mark.parametrize(
    ("about", "words"),
    [
        ({"frames": 9}, "frame 8 has no file"),
        ({"first": 3}, "frame 6 has no file"),
        ({"changes": {"light.position": [[0, 0, 1]]}}, "light.position has 1 values, wanted one for each of 8"),
        ({"changes": {"light.place": [1] * FRAMES}}, "frame 0: --change: got 'light.place'"),
        ({"exposure": [1.0]}, "exposure has 1 values"),
        ({"exposure": "bright"}, "exposure: got 'bright', wanted a finite number"),
        ({"resets": [8]}, "resets has 8, wanted frames from 0 to 7"),
        ({"fps": 0}, "fps: got 0, wanted a number above 0"),
        ({"frame": 8}, "got 'frame'"),
        ({"objects": {"box": []}, "jitter": [[0, 0]]}, "jitter is not followed"),
        ({"schema": "airlight-frames/2"}, 'wanted an object with "schema"'),
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
    with pytest.raises(InputError, match=r"frame 5: .*0006.exr has 16 x 24 pixels, the first frame 32 x 24"):
        compare_frames("open-fog", pattern, file)
