# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a report whose references and checks a cluster computed says what it says without one."""

import json

import pytest

pytest.importorskip("distributed", reason="the extra `sweep` is not installed")

from airlight.reports.cluster.connect import connected
from airlight.reports.data.records import report_text
from airlight.reports.report.measure import write_report
from airlight.validation.study.configuration import configuration
from airlight.validation.study.study import Checks, Measure, Study

#: Entries that depend on the clock, the memory or the cache: a cluster leaves the references.
TIMES = {
    "created",
    "seconds",
    "parts",
    "measured",
    "stages",
    "times",
    "environment",
    "claims",
    "memory",
    "cost",
}
TIMES |= {"cached", "computed"}


def without_times(data):
    """Return a report without what the clock says, also names that end so."""
    if isinstance(data, dict):
        kept = {
            name: entry
            for name, entry in data.items()
            if name not in TIMES and not name.endswith(("_ms", "fps"))
        }
        return {name: without_times(entry) for name, entry in kept.items()}
    return [without_times(entry) for entry in data] if isinstance(data, list) else data


@pytest.mark.slow
@pytest.mark.claim("reports-from-clusters", tolerance="none: the same numbers, except for times")
def test_a_report_from_a_cluster_says_the_same(tmp_path, monkeypatch, variant):
    # No patience, which a busy machine would try; margins that some dozen batches decide.
    checks = Checks(
        (16, 12), {"single-scatter": 0.02, "volpath": 0.2}, {"single-scatter": 32, "volpath": 8}, 64
    )
    measure = Measure("stages", 0.01, every_metric=False)
    chosen = (configuration("shadow-planes"), configuration("ray-march"))
    study = Study(
        "small",
        ("sphere-spot",),
        sizes=((32, 24),),
        configurations=chosen,
        measure=measure,
        checks=checks,
    )

    def report(name, cluster):
        monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / f"cache-{name}"))
        folder = tmp_path / name
        data = write_report(folder, study, cluster=cluster)
        images = {
            path.relative_to(folder): path.read_bytes() for path in folder.rglob("reference.exr")
        }
        return without_times(json.loads(report_text(data))), images

    alone, images = report("alone", None)
    with connected(2) as cluster:
        together, others = report("together", cluster)
    assert together["scenes"][0]["agreement"] == alone["scenes"][0]["agreement"]
    assert together == alone
    assert len(images) == 1
    assert others == images
