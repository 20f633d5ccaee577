# SPDX-License-Identifier: BSD-3-Clause
"""Scores of entries: who is best, which bytes come out twice, and what is refused."""

import json
from dataclasses import replace

import numpy as np
import pytest

from airlight.reference.storage.exr import Image, read_exr, write_exr
from airlight.reports.challenge import score
from airlight.reports.challenge.number import FLOOR
from airlight.reports.challenge.score import scene_reference
from airlight.reports.commands.main import run
from tests.helpers.challenge import drawn

NAMES = ("random-1", "certified-1", "engine-1")


def scored(folder, tmp_path, name="score.json"):
    assert run(["challenge", "score", str(folder), "-o", str(tmp_path / name)]) == 0
    return (tmp_path / name).read_bytes()


@pytest.mark.claim("challenge-bytes", tolerance="none: the bytes are equal")
def test_the_reference_is_best_and_scoring_twice_gives_the_same_bytes(perfect, tmp_path, capsys):
    entry = perfect("exact")
    first = scored(entry, tmp_path)
    assert scored(entry, tmp_path, "again.json") == first
    data = json.loads(first)
    assert data["number"] == FLOOR
    assert data["interval"] == [FLOOR, FLOOR]
    assert max(scene["error"] for scene in data["scenes"]) < 1e-6
    assert str(tmp_path) not in first.decode()
    assert "to cite: exact: 0.001" in capsys.readouterr().out


def test_twice_too_bright_has_the_error_one_in_every_scene(perfect, tmp_path):
    data = json.loads(scored(perfect("bright", 2.0), tmp_path))
    assert [scene["error"] for scene in data["scenes"]] == [1.0, 1.0, 1.0]
    assert [scene["bias"] for scene in data["scenes"]] == [1.0, 1.0, 1.0]
    assert data["number"] == 1.0


def test_a_changed_pixel_is_another_digest_and_another_number(perfect, tmp_path):
    entry = perfect("dim", 0.9)
    before = json.loads(scored(entry, tmp_path))
    path = entry / "random-1.exr"
    values = np.array(read_exr(path).layers["airlight"])
    values[12, 16] *= 5
    write_exr(path, Image({"airlight": values}))
    after = json.loads(scored(entry, tmp_path))
    assert before["digests"]["images"] != after["digests"]["images"]
    assert before["digests"]["scenes"] == after["digests"]["scenes"]
    assert after["number"] > before["number"]


@pytest.mark.claim("challenge-whole")
def test_an_entry_that_lacks_images_is_refused_by_their_names(perfect, capsys):
    entry = perfect("partial")
    (entry / "certified-1.exr").unlink()
    (entry / "engine-1.exr").unlink()
    assert run(["challenge", "score", str(entry)]) == 2
    said = capsys.readouterr().err
    assert "lacks 2 of 3 images: certified-1.exr, engine-1.exr" in said


@pytest.mark.claim("challenge-whole")
@pytest.mark.parametrize("name", ["random-1.xml", "engine-1.glb", "challenge.json"])
def test_changed_scenes_are_refused(perfect, capsys, name):
    entry = perfect("changed")
    assert run(["challenge", "new", "7", "-o", str(entry)]) == 0
    path = entry / name if name == "challenge.json" else entry / "scenes" / name
    if name == "challenge.json":
        data = json.loads(path.read_text())
        path.write_text(json.dumps(data | {"digest": "0" * 64}))
    else:
        path.write_bytes(path.read_bytes() + b" ")
    assert run(["challenge", "score", str(entry)]) == 2
    assert name in capsys.readouterr().err


def test_the_files_that_are_written_have_no_answer_and_are_accepted(perfect, capsys):
    entry = perfect("whole", seed="7")
    assert run(["challenge", "new", "7", "-o", str(entry)]) == 0
    names = {path.name for path in (entry / "scenes").iterdir()}
    assert {f"{name}.{end}" for name in NAMES for end in ("xml", "json", "glb")} <= names
    assert not any(name.endswith(".exr") for name in names)
    assert run(["challenge", "score", str(entry), "--json"]) == 0
    assert json.loads(capsys.readouterr().out.partition("\n{")[2].join(["{", ""]))["result"]
    assert run(["challenge", "new", "8", "-o", str(entry)]) == 2
    assert "holds the challenge 7" in capsys.readouterr().err


@pytest.mark.claim("challenge-whole")
def test_the_words_of_an_entry_are_its_seed(perfect, small, tmp_path, capsys):
    from airlight.reports.challenge.seed import seed_of_entry

    words = "named, commit abc"
    entry = perfect("named", seed=seed_of_entry(words), entry=words)
    data = json.loads(scored(entry, tmp_path))
    assert data["entry"]["entry"] == words
    # The same words with other spaces are the same entry, also beside challenge.json.
    text = (entry / "entry.toml").read_text()
    assert run(["challenge", "new", "--entry", words, "-o", str(entry)]) == 0
    (entry / "entry.toml").write_text(text.replace("named, commit", "named,  commit"))
    assert json.loads(scored(entry, tmp_path)) == data
    (entry / "entry.toml").write_text(text.replace("commit abc", "commit abd"))
    assert run(["challenge", "score", str(entry)]) == 2
    assert "has the seed" in capsys.readouterr().err


def test_a_scene_darker_than_the_error_of_its_reference_is_refused(perfect, monkeypatch, capsys):
    """Its error had no upper end: `inf` in a table, and a score that JSON has no number for."""

    def dark(folder, scene):
        reference, judged = scene_reference(folder, scene)
        return replace(reference, airlight_error=reference.airlight), judged

    monkeypatch.setattr(score, "scene_reference", dark)
    assert run(["challenge", "score", str(perfect("dark"))]) == 2
    said = capsys.readouterr().err
    assert "random-1 has no light beyond the error of its reference" in said


def test_times_stand_beside_the_errors_and_move_no_number(perfect, tmp_path):
    entry = perfect("timed", 1.1)
    before = json.loads(scored(entry, tmp_path))
    (entry / "times.json").write_text(json.dumps({"random-1": 0.25}))
    after = json.loads(scored(entry, tmp_path))
    assert [scene["seconds"] for scene in after["scenes"]] == [0.25, None, None]
    assert {**after, "scenes": None} == {**before, "scenes": None}


def faulty_image(entry):
    path = entry / "engine-1.exr"
    values = np.array(read_exr(path).layers["airlight"])
    values[3, 4, 1] = np.nan
    write_exr(path, Image({"airlight": values}), finite=False)


def small_image(entry):
    write_exr(entry / "engine-1.exr", Image({"airlight": np.ones((12, 16, 3), np.float32)}))


def without_layer(entry):
    write_exr(entry / "engine-1.exr", Image({"surface": np.ones((24, 32, 3), np.float32)}))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (faulty_image, "1 pixel is not finite, in column 4, row 3"),
        (small_image, "has 16 x 12 pixels; expected 32 x 24"),
        (without_layer, "has no layer 'airlight'"),
        (lambda entry: (entry / "times.json").write_text('{"hall": 1}'), "got hall"),
        (lambda entry: (entry / "times.json").write_text('{"random-1": "1"}'), "got '1'"),
        (lambda entry: (entry / "entry.toml").unlink(), "has no entry.toml"),
        (lambda entry: (entry / "entry.toml").write_text('method = "x"'), "no seed"),
        (lambda entry: (entry / "entry.toml").write_text('metod = "x"'), "did you mean 'method'"),
        (lambda entry: (entry / "entry.toml").write_text('seed = "7"'), "names no method"),
        (lambda entry: (entry / "challenge.json").write_text("{"), "not valid JSON"),
    ],
)
def test_what_cannot_be_scored_is_said_in_one_line(perfect, capsys, change, words):
    entry = perfect("faulty")
    change(entry)
    assert run(["challenge", "score", str(entry)]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("words", [["new"], ["new", "7", "--entry", "a b"], ["new", "a b"]])
def test_a_challenge_has_one_seed(words, capsys):
    assert run(["challenge", *words]) == 2
    assert "expected" in capsys.readouterr().err


def test_pixels_beside_lamps_and_edges_are_not_judged(small, tmp_path, monkeypatch):
    """With the whole of a pixel about its centre, every pixel that an edge crosses is left out, and
    with a hundred pixel widths about a lamp most of the image.
    """
    from airlight.reports.challenge import score

    scene = drawn("7")[0]
    reference, judged = score.scene_reference(tmp_path, scene)
    assert judged.mean() > 0.95
    monkeypatch.setattr(score, "_BESIDE", 1.0)
    _, fewer = score.scene_reference(tmp_path, scene)
    assert fewer.sum() < judged.sum()
    # A diagonal neighbour whose surface is half as far again is across an edge.
    ends = np.where(np.isfinite(reference.distance), reference.distance, 1e9)
    assert not (fewer[1:, 1:] & (ends[1:, 1:] > 1.5 * ends[:-1, :-1])).any()
    monkeypatch.setattr(score, "_LAMP", 100.0)
    assert score.scene_reference(tmp_path, scene)[1].sum() < 0.5 * judged.sum()
