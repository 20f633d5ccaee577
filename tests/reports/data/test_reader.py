# SPDX-License-Identifier: BSD-3-Clause
import json
from pathlib import Path

import numpy as np
import pytest

from analytic.errors import InputError
from reference.storage.exr import Image, write_exr
from reports.data.reader import load_report, read_report, schema
from reports.plotting.pictures import write_png
from tests.helpers.reports import entry, report_of, scene, settings

ROOT = Path(__file__).parents[3]


def small_report():
    """The content of a report of one scene and one method."""
    methods = [entry("unshadowed (exact)", knows_shadows=False, files={"exr": "fog/unshadowed-exact.exr"})]
    claim = {"kind": "reference", "text": "It is so.", "good": True}
    fog = scene("fog", methods, size=[4, 3], timed=[4, 3], agreement={})
    return report_of([fog], settings=settings(image=[4, 3], timed=[4, 3]), claims=[claim])


@pytest.fixture
def folder(tmp_path):
    """A whole small report but for its page."""
    data = small_report()
    (tmp_path / "old" / "fog").mkdir(parents=True)
    light = np.full((3, 4, 3), 0.5, dtype=np.float32)
    for name in ("fog/reference.exr", "fog/unshadowed-exact.exr"):
        write_exr(tmp_path / "old" / name, Image({"airlight": light, "surface": 0 * light}, light[..., 0]))
    for name in ("reference.png", "reference-airlight.png"):
        write_png(tmp_path / "old" / "fog" / name, np.zeros((3, 4, 3), dtype=np.uint8))
    (tmp_path / "old" / "report.json").write_text(json.dumps(data))
    return tmp_path / "old"


def changed(folder, change):
    data = small_report()
    change(data)
    (folder / "report.json").write_text(json.dumps(data))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "is not valid JSON"),
        ("[]", "has no schema, wanted 'airlight-report/2'"),
        ('{"schema": "airlight-report/1"}', "the schema 'airlight-report/1', wanted 'airlight-report/2'; make the"),
        (
            '{"schema": "airlight-report/2"}',
            "does not keep to airlight-report/2: report: Object missing required field `created`; make",
        ),
    ],
)
def test_what_is_no_report_is_refused(folder, text, message):
    (folder / "report.json").write_text(text)
    with pytest.raises(InputError, match=message):
        load_report(folder)


def test_a_damaged_report_is_refused_with_the_place(folder):
    changed(folder, lambda data: data["scenes"][0]["methods"][0]["times"].pop("frame"))
    with pytest.raises(InputError, match=r"report\.scenes\[0\]\.methods\[0\]\.times: .* missing .* `frame`; make the"):
        load_report(folder)
    changed(folder, lambda data: data["scenes"][0]["methods"][0].update(kind="magic"))
    with pytest.raises(InputError, match=r"methods\[0\]\.kind: Invalid enum value 'magic'"):
        load_report(folder)


@pytest.mark.parametrize("number", ["NaN", "-Infinity", "1e999"])
def test_a_number_that_is_not_finite_is_refused_with_its_place(folder, number):
    text = json.dumps(small_report()).replace('"exposure": 1.0', f'"exposure": {number}')
    (folder / "report.json").write_text(text)
    with pytest.raises(InputError, match=r"report\.scenes\[0\]\.exposure: Expected `float`, got `str`"):
        read_report(folder)


def test_the_schema_has_every_record_with_its_meaning():
    made = schema()
    assert made["$defs"]["Scene"]["properties"]["purpose"]["description"] == "what it is for"
    assert "frame" in made["$defs"]["FrameTimes"]["required"]
    assert "stability" in made["$defs"]["Report"]["required"]


def test_the_reports_of_today_are_read():
    """`replicate` compares with this one, which an earlier version wrote."""
    assert read_report(ROOT / "docs" / "data" / "replicate.json").scenes[0].name == "colonnade"


def test_a_missing_file_is_named(folder, tmp_path):
    (folder / "fog" / "unshadowed-exact.exr").unlink()
    with pytest.raises(InputError, match=r"names fog/unshadowed-exact\.exr, which is not beside it"):
        load_report(folder)
    with pytest.raises(InputError, match=r"cannot read .*nowhere.*No such file"):
        load_report(tmp_path / "nowhere")


@pytest.mark.parametrize("name", ["../outside.exr", "/etc/hostname", "fog/../../outside.exr", "C:outside.exr"])
def test_files_elsewhere_are_refused(folder, name):
    """A report is copied with its files: none may lie, or be written, outside of its folder."""
    (folder.parent / "outside.exr").write_text("x")
    changed(folder, lambda data: data["scenes"][0]["methods"][0]["files"].update(exr=name))
    with pytest.raises(InputError, match=r"names .*, which is not in its folder"):
        load_report(folder)
