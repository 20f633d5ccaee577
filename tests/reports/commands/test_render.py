# SPDX-License-Identifier: BSD-3-Clause
"""`airlight render`: one frame, numbered frames, the plan; what is written is said, and
times are measured if asked.
"""

import json

import numpy as np
import pytest

import airlight
import airlight.validation.study.turns
from airlight.errors import InputError
from airlight.reference.storage.exr import read_exr
from airlight.reports.commands import main as cli
from airlight.validation.study.cost import TIMED

SMALL = ["--size", "8x6"]


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path_factory, monkeypatch):
    """A frame without a file writes a picture where one is."""
    monkeypatch.chdir(tmp_path_factory.mktemp("here"))


def run(*arguments, status=0):
    assert cli.run(["render", *arguments]) == status


def test_frames_are_numbered_files_that_differ_and_begin_as_the_scene_stands(
    variant, tmp_path, capfd
):
    output, preview = tmp_path / "fog.exr", tmp_path / "fog.png"
    run("open-fog", *SMALL, "-o", str(tmp_path / "still" / "one.exr"))
    capfd.readouterr()
    run("open-fog", *SMALL, "--frames", "3", "-o", str(output), "-o", str(preview), "--json")
    printed = json.loads(capfd.readouterr().out)["result"]
    names = [f"fog-000{number}.{kind}" for kind in ("exr", "png") for number in (1, 2, 3)]
    names += ["fog.json"]
    assert sorted(path.name for path in tmp_path.iterdir() if path.is_file()) == sorted(names)
    assert [path.rsplit("/", 1)[-1] for path in printed["files"]] == names
    assert printed["moves"] == ["light"]
    assert printed["frame_ms"] == pytest.approx(printed["move_ms"] + printed["render_ms"])
    images = [
        read_exr(tmp_path / f"fog-000{number}.exr").layers["airlight"] for number in (1, 2, 3)
    ]
    np.testing.assert_array_equal(
        images[0], read_exr(tmp_path / "still" / "one.exr").layers["airlight"]
    )
    assert not np.array_equal(images[0], images[1])
    assert not np.array_equal(images[1], images[2])


def test_frames_of_objects_that_turn_are_judged_by_the_file_that_was_written_beside_them(
    variant, tmp_path
):
    moves = ("--method", "shadow-planes", "--frames", "3", "--animate", "objects")
    run("sphere-spot", *SMALL, *moves, "-o", str(tmp_path / "a.exr"))
    found = airlight.compare(
        "sphere-spot", str(tmp_path / "a-####.exr"), sequence=tmp_path / "a.json"
    )
    assert found.compared.verdict.kind == "exact"


def test_one_frame_has_no_file_of_changes_and_none_of_a_longer_run_stays_beside_it(
    variant, tmp_path
):
    def render(frames):
        files = ("-o", str(tmp_path / "fog.exr"), "-o", str(tmp_path / "fog.png"))
        run("open-fog", *SMALL, "--frames", frames, *files)
        return sorted(path.name for path in tmp_path.iterdir())

    assert len(render("3")) == 3 + 3 + 1
    assert render("1") == ["fog-0001.exr", "fog-0001.png"]
    # Files of another program are not ours to remove.
    others = {"fog-0002.exr": b"v/1", "fog-0002.png": b"PNG", "fog.json": b"{}"}
    for name, content in others.items():
        (tmp_path / name).write_bytes(content)
    assert render("1") == sorted(["fog-0001.exr", "fog-0001.png", *others])
    assert {name: (tmp_path / name).read_bytes() for name in others} == others


def test_the_file_of_changes_has_those_of_the_scene_itself(variant, tmp_path):
    """Frames of a changed medium were judged by the reference of the medium as it was."""
    changed = ("--change", "medium.sigma_t=0.3", "--change", "light.intensity=2,3,4")
    moves = ("--frames", "2", "--animate", "colour")
    run("open-fog", *SMALL, *changed, *moves, "-o", str(tmp_path / "a.exr"))
    changes = json.loads((tmp_path / "a.json").read_text())["changes"]
    assert changes["medium.sigma_t"] == [[0.3], [0.3]]
    first, second = changes["light.intensity"]
    assert first == pytest.approx([2, 3, 4], rel=1e-6)
    assert first != second


def test_the_plan_says_what_the_scene_needs_and_renders_nothing(variant, capfd):
    run("open-fog", *SMALL, "--plan")
    text = capfd.readouterr().out
    run("open-fog", *SMALL, "--plan", "--json")
    data = json.loads(capfd.readouterr().out)["result"]
    assert data["plan"] == airlight.load_scene("open-fog").plan()
    assert (
        text.splitlines()
        == [f"{name}: {words}" for name, words in data["plan"].items()] + data["notes"]
    )
    assert "lights: 1 point\n" in text


def test_a_configuration_is_rendered_as_its_words_are(variant):
    chosen = airlight.configuration("unshadowed", "exact")
    frame = airlight.render("open-fog", chosen, size=(8, 6))
    assert (frame.method, frame.kernel) == ("unshadowed", "exact")
    named = airlight.render("open-fog", "unshadowed", "exact", size=(8, 6))
    np.testing.assert_array_equal(frame.airlight, named.airlight)


@pytest.mark.claim("render-says-what-it-wrote")
def test_what_was_written_is_said_and_times_are_measured_only_if_asked(
    variant, tmp_path, capfd, monkeypatch
):
    timed = []
    real = airlight.validation.study.turns.time_alone
    monkeypatch.setattr(
        "airlight.validation.study.turns.time_alone", lambda *given: timed.append(1) or real(*given)
    )
    layers, picture = str(tmp_path / "fog.exr"), str(tmp_path / "fog.png")
    run("open-fog", *SMALL, "--samples", "4", "-o", layers, "-o", picture)
    printed = capfd.readouterr().out
    assert f"wrote {layers}: airlight, surface, their sum, depth, 8 x 6 pixels\n" in printed
    assert f"wrote {picture}: a picture, 8 x 6 pixels\n" in printed
    assert "4 rays a pixel: a picture" in printed
    made = read_exr(layers).attributes
    assert (made["airlight:pixel"], made["airlight:samples"]) == ("area", "4")
    assert not timed
    run("open-fog", *SMALL, "--timed", "--json")
    times = json.loads(capfd.readouterr().out)["result"]
    assert len(timed) == 1
    assert times["files"] == []
    measured = (
        "frame",
        "light_moved",
        "objects_moved",
        "light_moved_camera_cached",
        "colours_changed",
    )
    assert all(times["times"][name]["median_ms"] > 0 for name in measured)
    run("open-fog", *SMALL, "--timed")
    printed = capfd.readouterr().out
    assert len(timed) == 2
    assert "ms a frame" in printed
    assert "nothing written: -o NAME.png writes a picture, -o NAME.exr the layers\n" in printed


@pytest.mark.claim("flawed-meshes-warn")
def test_open_occluders_are_warned_of_where_planes_have_an_order_of_a_paper(variant, capfd):
    run("sphere-spot", *SMALL, "--method", "shadow-planes")
    assert "airlight: warning:" not in capfd.readouterr().err
    run("sphere-spot", *SMALL, "--method", "shadow-planes-2006")
    err = capfd.readouterr().err
    assert err.count("airlight: warning: shape 'floor' is open") == 1


def test_a_frame_of_one_ray_a_pixel_has_the_further_layers_of_its_method_and_pays_for_what_it_renders(
    monkeypatch,
):
    """A mean over rays has no layer of a method; frames that are only timed count as work."""
    asked = []

    def ready(chosen, frames, layers, progress):
        asked.append((frames, layers))
        raise InputError("enough")

    monkeypatch.setattr("airlight.reports.api.frames._ready", ready)
    for samples, timed in ((1, False), (4, False), (1, True)):
        with pytest.raises(InputError, match="enough"):
            airlight.render("open-fog", "unshadowed", samples=samples, timed=timed)
    assert asked == [(1, True), (4, False), (1 + TIMED, True)]


def test_a_frame_without_a_file_writes_a_picture_and_no_file_of_another_program(
    variant, tmp_path, monkeypatch, capsys
):
    from PIL import Image as Picture

    monkeypatch.chdir(tmp_path)
    for _ in range(2):  # its own picture is written again
        run("open-fog", *SMALL)
        assert "wrote open-fog.png: a picture, 8 x 6 pixels" in capsys.readouterr().out
    with Picture.open("open-fog.png") as made:
        assert made.size == (8, 6)
        assert made.text["Software"] == "airlight"
    run("random:7", *SMALL)
    assert (tmp_path / "random-7.png").exists()
    Picture.new("RGB", (2, 2)).save("sphere-spot.png")
    before = (tmp_path / "sphere-spot.png").read_bytes()
    run("sphere-spot", *SMALL, status=2)
    assert "airlight did not write it; name a file with -o" in capsys.readouterr().err
    assert (tmp_path / "sphere-spot.png").read_bytes() == before
    run("omni-box", *SMALL, "--json")
    assert not (tmp_path / "omni-box.png").exists()
