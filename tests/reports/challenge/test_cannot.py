# SPDX-License-Identifier: BSD-3-Clause
"""Scenes that a method cannot have: they count as black images, are said wherever a number is, and
no entry hides an image or a reason.
"""

import hashlib
import json
import math
from dataclasses import replace

import numpy as np
import pytest

from airlight.errors import InputError
from airlight.reference.storage.exr import Image, write_exr
from airlight.reports.challenge.board import board_of, board_table, scenes_table
from airlight.reports.challenge.entry import check_whole, images_digest, read_entry
from airlight.reports.challenge.number import BLACK, FLOOR, scene_error
from airlight.reports.challenge.record import combined_score, read_score, score_text
from airlight.reports.commands.main import run
from tests.reports.challenge.test_board import score

NAMES = ("random-1", "certified-1", "engine-1")
WHY = "it has no height fog"


def test_a_black_image_has_the_error_one_in_every_scene():
    """The row of a scene without an image is that of a black one, without its stated error."""
    numbers = np.random.default_rng(3)
    for scale in (1e-6, 1.0, 1e5):
        values = scale * numbers.random(300)
        found = scene_error(values, 1e-4 * values, np.zeros(300))
        assert found.error == pytest.approx(BLACK.error, rel=1e-15)
        assert found.low < BLACK.low == BLACK.high < found.high


def entry(folder, words="", images=NAMES):
    folder.mkdir(exist_ok=True)
    (folder / "entry.toml").write_text(f'method = "x"\nseed = "7"\n{words}')
    for name in images:
        (folder / f"{name}.exr").write_bytes(name.encode())
    return folder


def test_an_entry_has_an_image_or_a_reason_for_every_scene(tmp_path):
    found = read_entry(entry(tmp_path / "e", f'[cannot]\nengine-1 = "{WHY}"', NAMES[:2]))
    assert found.cannot == {"engine-1": WHY}
    check_whole(found, NAMES)


@pytest.mark.parametrize(
    ("words", "images", "said"),
    [
        (f'[cannot]\nengine-1 = "{WHY}"', NAMES, "engine-1.exr, and entry.toml says"),
        (f'[cannot]\nengine-1 = "{WHY}"', NAMES[:1], "lacks 1 of 3 images: certified-1.exr;"),
        (f'[cannot]\nengine-9 = "{WHY}"', NAMES, "got cannot.engine-9, .*mean 'engine-1'"),
        ("".join(["[cannot]\n", *(f'{name} = "no"\n' for name in NAMES)]), (), "names all 3"),
        ('[cannot]\nengine-1 = " "', NAMES[:2], "cannot.engine-1: got ' ', expected the reason"),
        ("[cannot]\nengine-1 = 1", NAMES[:2], "cannot.engine-1: got 1, expected the reason"),
        ('cannot = "engine-1"', NAMES[:2], "cannot: got 'engine-1', expected a table"),
        ("[canot]\nengine-1 = 1", NAMES, "did you mean 'cannot'"),
    ],
)
def test_what_hides_an_image_or_a_reason_is_said_in_one_line(tmp_path, words, images, said):
    with pytest.raises(InputError, match=said) as error:
        check_whole(read_entry(entry(tmp_path / "e", words, images)), NAMES)
    assert "\n" not in str(error.value)


def test_a_scene_without_an_image_has_no_time(tmp_path):
    folder = entry(tmp_path / "e", f'[cannot]\nengine-1 = "{WHY}"', NAMES[:2])
    (folder / "times.json").write_text('{"engine-1": 1}')
    with pytest.raises(InputError, match=r"got engine-1, expected .* with an image"):
        check_whole(read_entry(folder), NAMES)


def test_the_digest_of_images_has_the_reasons_and_stays_for_whole_entries(tmp_path):
    folder = entry(tmp_path / "e")
    lines = "".join(
        f"{hashlib.sha256(name.encode()).hexdigest()}  {name}.exr\n" for name in sorted(NAMES)
    )
    whole = images_digest(folder, NAMES, {})
    assert whole == hashlib.sha256(lines.encode()).hexdigest()
    others = [{"engine-1": WHY}, {"engine-1": "another"}, {"random-1": WHY}]
    assert len({whole, *(images_digest(folder, NAMES, each) for each in others)}) == 4


def test_saying_so_gains_nothing_over_a_black_image(perfect, tmp_path, capsys):
    said, black = perfect("said"), perfect("black")
    (said / "engine-1.exr").unlink()
    with (said / "entry.toml").open("a") as stream:
        stream.write(f'[cannot]\nengine-1 = "{WHY}"\n')
    write_exr(black / "engine-1.exr", Image({"airlight": np.zeros((24, 32, 3), np.float32)}))
    data = []
    for folder in (said, black):
        assert run(["challenge", "score", str(folder), "-o", str(tmp_path / "s.json")]) == 0
        data.append(json.loads((tmp_path / "s.json").read_text()))
    assert data[0]["number"] == data[1]["number"] == pytest.approx(math.cbrt(FLOOR**2))
    rows = [each["scenes"][2] for each in data]
    assert rows[0] == rows[1] | {"interval": [1.0, 1.0], "cannot": WHY}
    # Text says the reason in place of the error, and the sentence to cite how many scenes it had.
    out = capsys.readouterr().out
    assert f"engine-1: {WHY}" in out
    assert out.count("(random 0.001, certified 0.001, engine cannot;") == 1
    assert "to cite: said: 0.01" in out
    assert "with 2 of 3 scenes, the others as black images" in out
    assert out.count("the others as black images") == 1


def without(method, kind):
    """Return a score whose method has no image of a kind."""
    whole = score(method, 0.1)
    scenes = tuple(
        replace(each, error=1.0, interval=(1.0, 1.0), bias=-1.0, seconds=None, cannot=WHY)
        if each.kind == kind
        else each
        for each in whole.scenes
    )
    number, kinds = combined_score(scenes, whole.digests.scenes)
    ends = (number.low, number.high)
    return replace(whole, scenes=scenes, number=number.number, interval=ends, kinds=kinds)


def test_a_board_says_cannot_and_how_many_scenes_an_entry_has(tmp_path):
    (board,) = board_of([without("part", "engine"), score("whole", 0.3)])
    rows = {row.values["method"]: row.values for row in board_table(board).rows}
    assert [rows[name]["had"] for name in ("part", "whole")] == ["16 of 24", "24 of 24"]
    assert rows["part"]["engine"] == "cannot"
    assert rows["part"]["random"] == pytest.approx(0.1, rel=0.01)
    errors = {row.values["scene"]: row.values for row in scenes_table(board).rows}
    at = [row.score.entry.method for row in board.rows].index("part")
    assert errors["engine-3"][f"entry-{at}"] == "cannot"
    # The page has the reason once, with the scenes.
    (tmp_path / "part.json").write_text(score_text(without("part", "engine")))
    assert run(["challenge", "board", str(tmp_path), "-o", str(tmp_path / "board.html")]) == 0
    page = (tmp_path / "board.html").read_text()
    assert page.count(WHY) == 1
    assert "engine-7, engine-8: it has no height fog." in page


def test_a_score_of_before_is_read_and_a_reason_with_an_error_is_refused(tmp_path):
    file = tmp_path / "a.json"
    whole = score("a", 0.1)
    data = json.loads(score_text(whole))
    for each in data["scenes"]:
        del each["cannot"]
    file.write_text(json.dumps(data))
    assert read_score(file) == whole
    data["scenes"][3]["cannot"] = WHY
    file.write_text(json.dumps(data))
    with pytest.raises(InputError, match=r"random-4 has no image and the error .* expected 1"):
        read_score(file)


def test_a_score_with_the_words_of_another_entry_is_refused(tmp_path):
    """The board says that the seed follows from the words."""
    file = tmp_path / "a.json"
    data = json.loads(score_text(score("a", 0.1)))
    data["entry"]["entry"] = "another method, commit abc"
    file.write_text(json.dumps(data))
    with pytest.raises(InputError, match="has the seed"):
        read_score(file)
