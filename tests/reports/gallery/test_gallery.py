# SPDX-License-Identifier: BSD-3-Clause
"""The pictures of README and documentation: all there, small, made by the recipes of today, of scenes as they are."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from analytic.errors import InputError
from reports.commands import main as cli
from reports.docs.data import baseline_revision
from reports.gallery.make import LARGEST, SCHEMA, _coded, chosen_pictures, tutorial_digest
from reports.gallery.recipes import pictures

ROOT = Path(__file__).resolve().parents[3]
FOLDER = ROOT / "docs/gallery"


@pytest.fixture(scope="module")
def kept():
    content = json.loads((FOLDER / "gallery.json").read_text(encoding="utf-8"))
    assert content["schema"] == SCHEMA
    return content["pictures"]


def stale(kept):
    """Return a line for each picture that is not as its recipe, or older than the baseline of a scene that it shows."""
    told = []
    recipes = {picture.name: picture for picture in pictures()}
    for name in recipes.keys() | kept.keys():
        if name not in kept or name not in recipes:
            told.append(f"{name}: {'never made' if name in recipes else 'no such picture any more'}")
            continue
        entry, recipe = kept[name], recipes[name]
        if (entry["file"], entry["command"]) != (recipe.file, recipe.command):
            told.append(f"{name}: made by another recipe")
        if entry["digest"] not in (None, tutorial_digest()):
            told.append(f"{name}: made of another scene of the tutorial")
        for scene, revision in entry["baselines"].items():
            now = baseline_revision(scene)
            if revision != now:
                told.append(f"{name}: made with revision {revision} of the baseline of {scene}, now it is {now}")
    return told


@pytest.mark.claim("gallery-is-fresh")
def test_no_picture_is_older_than_what_it_shows(variant, kept):
    told = stale(kept)
    assert not told, "\n".join([*told, "run `airlight gallery -o docs/gallery`"])


def test_a_page_of_no_report_is_one_line(variant, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.run(["gallery", "-o", "pictures", "report-page"]) == 2
    assert "airlight-report/report.json" in " ".join(capsys.readouterr().err.split())


def test_stale_pictures_are_told(variant, kept, monkeypatch):
    name = "scene-hall"
    old = kept[name] | {"baselines": {"hall": -1}}
    assert any("scene-hall: made with revision -1" in line for line in stale(kept | {name: old}))
    assert "scene-hall: made by another recipe" in stale(kept | {name: kept[name] | {"command": "airlight"}})
    assert "scene-hall: never made" in stale({key: value for key, value in kept.items() if key != name})
    assert "lost: no such picture any more" in stale(kept | {"lost": old})
    other = kept["tutorial-gate"] | {"digest": "00"}
    assert "tutorial-gate: made of another scene of the tutorial" in stale(kept | {"tutorial-gate": other})


def test_the_folder_holds_the_pictures_and_nothing_else(kept):
    files = {entry["file"] for entry in kept.values()}
    assert {path.name for path in FOLDER.iterdir()} == files | {"gallery.json"}
    for name in files:
        assert (FOLDER / name).stat().st_size <= LARGEST, name
        with Image.open(FOLDER / name) as image:
            assert image.width >= 480


def test_every_command_of_the_gallery_is_one(variant, kept, capsys):
    """Its options are known, and its scene, method and settings: the plan of the scene can be printed."""
    assert cli.run(["gallery", "--help"]) == 0
    known = re.findall(r"--[a-z]+", capsys.readouterr().out)
    assert "--output" in known
    assert cli.run(["render", "--help"]) == 0
    known = re.findall(r"--[a-z]+", capsys.readouterr().out)
    for entry in kept.values():
        program, command, what, *rest = shlex.split(entry["command"])
        assert (program, command in ("render", "gallery")) == ("airlight", True)
        assert all(word in known for word in rest if word.startswith("--")), entry["command"]
        if command == "gallery":
            assert [picture.name for picture in chosen_pictures([what])] == [what]


def test_pictures_are_chosen_by_their_name_a_scene_or_a_method(variant):
    assert [picture.name for picture in chosen_pictures(["scene-hall"])] == ["scene-hall"]
    assert [picture.name for picture in chosen_pictures(["windows"])] == ["scene-windows"]
    of_method = ["method-min-max", "method-min-max-error", "method-min-max-sketch"]
    assert [picture.name for picture in chosen_pictures(["min-max"])] == of_method
    everything = [picture.name for picture in pictures()]
    assert [picture.name for picture in chosen_pictures([])] == [name for name in everything if name != "report-page"]
    with pytest.raises(InputError, match=r"gallery: got 'scene-hal', .*did you mean 'scene-hall'"):
        chosen_pictures(["scene-hal"])


def test_files_are_small_whatever_they_show():
    noise = np.random.default_rng(3).integers(0, 256, (480, 640, 3), dtype=np.uint8)
    assert len(_coded(noise, "a.jpg")) < 2 * LARGEST  # noise is the worst there is, at the lowest quality
    assert len(_coded(noise // 16 * 16, "a.png")) <= 2 * LARGEST
    assert len(_coded(np.full((480, 640, 3), 200, np.uint8), "a.png")) < 3000


def test_the_command_makes_a_picture_and_its_entry(variant, tmp_path, capsys):
    assert cli.run(["gallery", "-o", str(tmp_path / "out"), "method-unshadowed-sketch"]) == 0
    printed = capsys.readouterr().out.split()
    assert printed == [str(tmp_path / "out" / name) for name in ("method-unshadowed-sketch.png", "gallery.json")]
    entry = json.loads((tmp_path / "out/gallery.json").read_text())["pictures"]["method-unshadowed-sketch"]
    assert entry["command"] == "airlight gallery method-unshadowed-sketch"
    with Image.open(tmp_path / "out/method-unshadowed-sketch.png") as image:
        assert image.size == (640, 480)
        assert len(image.convert("RGB").getcolors(1 << 20)) > 30
    assert cli.run(["gallery", "-o", str(tmp_path / "out"), "nothing-like-it"]) == cli.WRONG_INPUT
