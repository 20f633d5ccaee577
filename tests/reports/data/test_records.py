# SPDX-License-Identifier: BSD-3-Clause
"""A report is read again as a whole, or refused with the place of what is wrong."""

import json
from pathlib import Path

import pytest

from airlight.errors import InputError
from airlight.reports.data.records import load_report, read_report
from airlight.validation.study.study import standard_study
from tests.helpers.page import report_data, write_report_files

ROOT = Path(__file__).parents[3]


@pytest.fixture
def folder(tmp_path):
    """A whole small report except for its page."""
    return write_report_files(tmp_path / "old")


def changed(folder, change):
    data = report_data()
    change(data)
    (folder / "report.json").write_text(json.dumps(data))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "is not valid JSON"),
        ("[]", "has no schema, expected 'airlight-report/5'"),
        (
            '{"schema": "airlight-report/3"}',
            "the schema 'airlight-report/3', expected 'airlight-report/5'; make the",
        ),
        (
            '{"schema": "airlight-report/5"}',
            "does not keep to airlight-report/5: report: Object missing required field `created`; "
            "make",
        ),
    ],
)
def test_what_is_no_report_is_refused(folder, text, message):
    (folder / "report.json").write_text(text)
    with pytest.raises(InputError, match=message):
        load_report(folder)


def test_a_damaged_report_is_refused_with_the_place(folder):
    changed(folder, lambda data: data["scenes"][0]["methods"][0]["times"].pop("frame"))
    with pytest.raises(
        InputError,
        match=r"report\.scenes\[0\]\.methods\[0\]\.times: .* missing .* `frame`; make the",
    ):
        load_report(folder)
    changed(folder, lambda data: data["scenes"][0]["methods"][0].update(width="wide"))
    with pytest.raises(InputError, match=r"methods\[0\]\.width: Expected `int`, got `str`"):
        load_report(folder)


@pytest.mark.parametrize("number", ["NaN", "-Infinity", "1e999"])
def test_a_number_that_is_not_finite_is_refused_with_its_place(folder, number):
    text = json.dumps(report_data()).replace('"exposure": 2.5', f'"exposure": {number}')
    (folder / "report.json").write_text(text)
    with pytest.raises(
        InputError, match=r"report\.scenes\[0\]\.exposure: Expected `float`, got `str`"
    ):
        read_report(folder)


def test_the_kept_report_can_be_compared():
    """`replicate` compares the quick report with this one: errors are
    compared at one size alone.
    """
    (scene,) = read_report(ROOT / "docs" / "data" / "replicate.json").scenes
    assert scene.name == "colonnade"
    assert tuple(scene.size) in standard_study("quick").sizes
    assert 0 < scene.reference.relative_error < 1e-9
    assert 0 < scene.reference.surface_error < 1e-4


def test_a_missing_file_is_named(folder, tmp_path):
    (folder / "s" / "good.exr").unlink()
    with pytest.raises(InputError, match=r"names s/good\.exr, which is not beside it"):
        load_report(folder)
    with pytest.raises(InputError, match=r"cannot read .*nowhere.*No such file"):
        load_report(tmp_path / "nowhere")


@pytest.mark.parametrize(
    "name", ["../outside.exr", "/etc/hostname", "s/../../outside.exr", "C:outside.exr"]
)
def test_files_elsewhere_are_refused(folder, name):
    """A report is copied with its files: none may lie, or be written, outside of its folder."""
    (folder.parent / "outside.exr").write_text("x")
    changed(folder, lambda data: data["scenes"][0]["methods"][0]["files"].update(exr=name))
    with pytest.raises(InputError, match=r"names .*, which is not in its folder"):
        load_report(folder)
