# SPDX-License-Identifier: BSD-3-Clause
"""What a report from Python is given."""

import airlight
from tests.helpers.api import brighter
from tests.helpers.reports import checked, report_of


def test_report_hands_on_what_it_was_given(variant, tmp_path, monkeypatch):
    given = {}

    def write(folder, study, **options):
        given.update(options, folder=folder, study=study)
        return checked(report_of([], claims=[{"kind": "image", "text": "so", "good": None}]))

    monkeypatch.setattr("reports.report.measure.write_report", write)
    report = airlight.report("open-fog", method=["min-max", brighter], output=tmp_path / "out")
    assert report.folder == tmp_path / "out"
    assert report.claims == ("so",)
    assert given["study"].scenes == ("open-fog",)
    assert given["study"].name == "default"
    assert not given["apart"]  # a function runs here
    names = [configuration.method.rpartition(":")[2] for configuration in given["study"].configurations]
    assert names == ["min-max", "brighter"]
