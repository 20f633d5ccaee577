# SPDX-License-Identifier: BSD-3-Clause
"""`airlight render`: one frame, numbered frames, and the plan."""

import json

import numpy as np
import pytest

from reference.storage.exr import read_exr
from reports.commands import main as cli
from reports.interchange.frames import numbered

SMALL = ["--size", "8x6"]


def run(*arguments, status=0):
    assert cli.run(["render", *arguments]) == status


def test_numbers_have_four_digits_or_more(tmp_path):
    assert numbered(tmp_path / "a.b.exr", 7, 100).name == "a.b-0007.exr"
    assert numbered(tmp_path / "a.exr", 7, 20_000).name == "a-00007.exr"


def test_frames_are_numbered_files_that_differ(variant, tmp_path, capfd):
    output, preview = tmp_path / "fog.exr", tmp_path / "fog.png"
    run("open-fog", *SMALL, "--frames", "3", "-o", str(output), "--preview", str(preview), "--json")
    printed = json.loads(capfd.readouterr().out)
    names = [f"fog-000{number}.{kind}" for kind in ("exr", "png") for number in (1, 2, 3)]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    assert [path.rsplit("/", 1)[-1] for path in printed["files"]] == names
    assert printed["moves"] == ["light"]
    assert printed["frame_ms"] == pytest.approx(printed["move_ms"] + printed["render_ms"])
    images = [read_exr(tmp_path / f"fog-000{number}.exr").layers["airlight"] for number in (1, 2, 3)]
    assert not np.array_equal(images[0], images[1])
    assert not np.array_equal(images[1], images[2])


def test_first_frame_is_the_scene_as_it_stands(variant, tmp_path):
    run("sphere-spot", *SMALL, "--method", "shadow-planes", "-o", str(tmp_path / "one.exr"))
    run("sphere-spot", *SMALL, "--method", "shadow-planes", "--frames", "2", "-o", str(tmp_path / "many.exr"))
    single, first = (read_exr(tmp_path / name).layers for name in ("one.exr", "many-0001.exr"))
    np.testing.assert_array_equal(single["airlight"], first["airlight"])


def test_several_rays_a_pixel_are_a_picture_and_the_output_says_so(variant, tmp_path, capfd):
    exr, png = tmp_path / "a.exr", tmp_path / "a.png"
    run("sphere-spot", *SMALL, "--method", "shadow-planes", "--samples", "4", "-o", str(exr), "--preview", str(png))
    printed = capfd.readouterr().out
    assert "4 rays a pixel: for looking at; a method's error is judged at pixel centres" in printed
    assert "picture: tone curve x (1 + x/" in printed
    made = read_exr(exr).attributes
    assert (made["airlight:pixel"], made["airlight:samples"]) == ("area", "4")
    run("sphere-spot", *SMALL, "--method", "shadow-planes", "-o", str(exr))
    assert "airlight:samples" not in read_exr(exr).attributes
    assert "rays a pixel" not in capfd.readouterr().out


def test_ctrl_c_keeps_the_finished_frames_and_says_so(variant, tmp_path, capfd, monkeypatch):
    import reports.interchange.frames

    write, calls = reports.interchange.frames.write_frame, []

    def interrupted(*args, **kwargs):
        calls.append(1)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return write(*args, **kwargs)

    monkeypatch.setattr(reports.interchange.frames, "write_frame", interrupted)
    run("open-fog", *SMALL, "--frames", "5", "-o", str(tmp_path / "fog.exr"), status=cli.INTERRUPTED)
    assert "2 of 5 frames are finished and kept" in capfd.readouterr().err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fog-0001.exr", "fog-0002.exr"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--frames", "3"], "--frames: got no place for the files"),
        (["--samples", "3"], "--samples: got no place for the picture"),
        (["--samples", "3", "--frames", "3", "-o", "x.exr"], "--samples: got --frames too"),
        (["--animate", "light"], "--animate: got no number of frames"),
        (
            ["--method", "unshadowed", "--method", "ray-march"],
            "--method: got unshadowed and ray-march, wanted one of them",
        ),
        (["--method", "min-max", "--kernel", "exact", "--kernel", "taylor"], "--kernel: got exact and taylor, wanted"),
        (["--frames", "3", "--animate", "lamp", "-o", "x.exr"], "--animate: got 'lamp'"),
        (["--frames", "3", "--animate", "objects", "-o", "x.exr"], "no closed mesh that could turn"),
    ],
)
def test_mistakes_are_told_before_a_file_is_written(variant, tmp_path, monkeypatch, capfd, arguments, message):
    monkeypatch.chdir(tmp_path)
    run("open-fog", *SMALL, *arguments, status=cli.WRONG_INPUT)
    assert message in capfd.readouterr().err
    assert not list(tmp_path.iterdir())


def test_plan_counts_casters_and_warns_of_open_ones(variant, capfd):
    run("two-pens", *SMALL, "--method", "shadow-planes", "--plan", "--json")
    out, err = capfd.readouterr()
    words = json.loads(out)["plan"]
    assert words["casters"] == "3 shapes, 34549 triangles in 4 parts, 2 closed"
    assert "silhouette edges" in words["planes"]
    assert err.count("is open") == 2


@pytest.mark.claim("flawed-meshes-warn")
def test_render_warns_of_open_casters_once_each(variant, capfd):
    run("sphere-spot", *SMALL, "--method", "shadow-planes", "--json")
    out, err = capfd.readouterr()
    assert err.count("airlight: warning: shape 'floor' is open") == 1
    times = json.loads(out)
    assert times["light_moved_ms"] > 0
    assert times["objects_moved_ms"] > 0
    assert times["light_moved_camera_kept_ms"] > 0
    assert times["colours_changed_ms"] > 0


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        (["render", "open-fog", "-o", "frame.png"], "--output: got 'frame.png', wanted a name that ends in .exr"),
        (
            ["render", "open-fog", "--preview", "frame.exr"],
            "--preview: got 'frame.exr', wanted a name that ends in .png",
        ),
        (["reference", "open-fog", "-o", "truth"], "--output: got 'truth', wanted a name that ends in .exr"),
    ],
)
def test_a_file_whose_name_says_another_kind_is_refused(capsys, arguments, wanted):
    assert cli.run(arguments) == cli.WRONG_INPUT
    assert wanted in capsys.readouterr().err


@pytest.mark.claim("render-says-what-it-wrote")
def test_what_was_written_is_said(variant, tmp_path, capfd):
    layers, picture = str(tmp_path / "fog.exr"), str(tmp_path / "fog.png")
    run("open-fog", *SMALL, "-o", layers, "--preview", picture)
    printed = capfd.readouterr().out
    assert f"wrote {layers}: airlight, surface, their sum, depth, 8 x 6 pixels\n" in printed
    assert f"wrote {picture}: a picture, 8 x 6 pixels\n" in printed
    run("open-fog", *SMALL, "-o", layers, "--json")
    assert json.loads(capfd.readouterr().out)["files"] == [layers]
    run("open-fog", *SMALL)
    assert (
        "nothing written: --preview NAME.png writes a picture, --output NAME.exr the layers\n" in capfd.readouterr().out
    )
    run("open-fog", *SMALL, "-o", layers, "--preview", picture, "--frames", "2")
    printed = capfd.readouterr().out
    for path in (layers, picture):
        first, last = (str(numbered(tmp_path / path, number, 2)) for number in (1, 2))
        assert f"wrote {first} to {last}: 2 files, 8 x 6 pixels\n" in printed
