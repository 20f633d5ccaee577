# SPDX-License-Identifier: BSD-3-Clause

import pytest

from reports.report.measure import staged


def content(folder):
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*") if path.is_file()}


def test_files_appear_when_the_block_ends(tmp_path):
    (tmp_path / "report.html").write_text("old")
    (tmp_path / "mine.txt").write_text("mine")
    with staged(tmp_path) as hidden:
        (hidden / "fog").mkdir()
        (hidden / "fog" / "a.exr").write_text("image")
        (hidden / "report.html").write_text("new")
        assert (tmp_path / "report.html").read_text() == "old"
    assert content(tmp_path) == {"report.html": "new", "mine.txt": "mine", "fog/a.exr": "image"}
    assert hidden.exists() is False


@pytest.mark.claim("files-whole-or-not-at-all")
@pytest.mark.parametrize("stop", [KeyboardInterrupt, ValueError])
def test_an_exception_leaves_everything_as_it_was(tmp_path, stop):
    (tmp_path / "report.html").write_text("old")

    def work():
        with staged(tmp_path) as hidden:
            (hidden / "report.html").write_text("half")
            raise stop

    with pytest.raises(stop):
        work()
    assert content(tmp_path) == {"report.html": "old"}
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
