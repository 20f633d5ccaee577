# SPDX-License-Identifier: BSD-3-Clause
"""Claim: results appear in their folder when they are whole, and an exception leaves it as it was."""

import errno
import os
import time
from pathlib import Path

import pytest

from airlight.errors import InputError
from airlight.reports.data.records import named_files
from airlight.reports.report.measure import images_before
from airlight.reports.report.staged import staged
from tests.helpers.page import small_report, write_report_files


def staging(folder):
    """Return a hidden folder for a report."""
    return staged(folder, images_before)


def content_names(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def content(folder):
    return {
        str(path.relative_to(folder)): path.read_text()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_files_appear_when_the_block_ends(tmp_path):
    (tmp_path / "report.html").write_text("old")
    (tmp_path / "mine.txt").write_text("mine")
    with staging(tmp_path) as hidden:
        (hidden / "fog").mkdir()
        (hidden / "fog" / "a.exr").write_text("image")
        (hidden / "report.html").write_text("new")
        assert (tmp_path / "report.html").read_text() == "old"
    assert content(tmp_path) == {"report.html": "new", "mine.txt": "mine", "fog/a.exr": "image"}
    assert hidden.exists() is False


@pytest.mark.claim("files-whole-or-not-at-all")
def test_two_reports_never_mix_in_one_folder(tmp_path):
    """The second of two at once is refused; a later one drops the images of the first,
    and keeps a user's file.
    """
    folder = write_report_files(tmp_path / "r")
    (folder / "mine.txt").write_text("mine")
    images = set(named_files(small_report()))
    there = set(content_names(folder))
    assert images < there
    with staging(folder) as hidden:
        with (
            pytest.raises(InputError, match=r"another run is writing into .*another folder"),
            staging(folder),
        ):
            pass
        (hidden / "report.json").write_text("{}")
        kept = min(images)
        (hidden / kept).parent.mkdir(parents=True, exist_ok=True)
        (hidden / kept).write_text("new")
    assert set(content_names(folder)) == {*there - images, "report.json", "mine.txt", kept}
    assert (folder / kept).read_text() == "new"


@pytest.mark.claim("files-whole-or-not-at-all")
@pytest.mark.parametrize("stop", [KeyboardInterrupt, ValueError])
def test_an_exception_leaves_everything_as_it_was(tmp_path, stop):
    (tmp_path / "report.html").write_text("old")

    def work():
        with staging(tmp_path) as hidden:
            (hidden / "report.html").write_text("half")
            raise stop

    with pytest.raises(stop):
        work()
    assert content(tmp_path) == {"report.html": "old"}
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


@pytest.mark.claim("files-whole-or-not-at-all")
def test_a_full_disk_names_the_folder_that_the_user_knows_and_other_faults_are_as_they_are(
    tmp_path,
):
    for number, name in ((errno.ENOSPC, str(tmp_path)), (errno.EACCES, "hidden.exr")):
        with pytest.raises(OSError, match=os.strerror(number)) as raised, staging(tmp_path):
            raise OSError(number, os.strerror(number), "hidden.exr")
        assert raised.value.filename == name
    assert list(tmp_path.iterdir()) == []


def test_remains_that_another_report_removes_first_are_no_fault(tmp_path, monkeypatch):
    monkeypatch.setattr(
        Path, "glob", lambda folder, words: iter([folder / ".airlight-report-gone"])
    )
    with staging(tmp_path) as hidden:
        (hidden / "report.json").write_text("{}")
    assert (tmp_path / "report.json").exists()


def test_the_remains_of_a_killed_run_go_after_a_day(tmp_path):
    for name, hours in (("old", 25), ("young", 23)):
        remains = tmp_path / f".airlight-report-{name}"
        remains.mkdir()
        (remains / "a.exr").write_text("half")
        os.utime(remains, times=(time.time() - 3600 * hours,) * 2)
    with staging(tmp_path):
        pass
    assert content_names(tmp_path) == [".airlight-report-young/a.exr"]
