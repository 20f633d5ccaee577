# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the stages of collectors for clouds are timed by themselves, and searches that go on converge in few steps."""

import json

import pytest

from analytic.errors import InputError
from realtime.clouds.light_maps.pyramid import maps_memory
from realtime.scene.read_scene import read_scene
from reports.commands.main import run
from reports.tables.cloud_stages import cloud_stages_tables
from tests.helpers.clouds import loaded
from tests.helpers.transport_formula import use_formula
from validation.configurations.timing import Timing
from validation.frames import cloud_stages as study
from validation.frames.cloud_stages import CloudStages, Convergence, StageTime, cloud_stages

FOUND = CloudStages(
    0.67,
    (
        StageTime("light maps and MIP, after the light moved", 8.0, None, Timing(7.1, 6.9, 7.3, 40), 13.2),
        StageTime("frame, as published", 4000.0, 31000.0, Timing(910.0, 900.0, 930.0, 5), 1790.0),
    ),
    {"light maps": 11184800, "collectors": 61440000},
    (
        Convergence("cold", 10, 0.012, {"2": 0.007, "31-inf": 0.001}),
        Convergence("previous", 3, 0.011, {"2": 0.006, "31-inf": 0.0}),
    ),
)


@pytest.mark.slow
@pytest.mark.claim("collector-stages")
def test_stages_of_a_ring(variant, monkeypatch):
    import mitsuba as mi

    use_formula(monkeypatch)
    done = []
    found = cloud_stages(
        read_scene(loaded()), {"map": 64, "steps": 8}, seconds=0.0, progress=lambda *now: done.append(now)
    )
    assert [count for count, _, _ in done] == list(range(len(done)))
    assert 0.1 < found.cloud < 0.9
    assert [stage.name for stage in found.stages][:2] == [
        "light maps and MIP, after the light moved",
        "order 1 and opacity, 8 steps",
    ]
    assert len(found.stages) == 7
    for stage in found.stages:
        assert 0 < stage.time.low_ms <= stage.time.median_ms <= stage.time.high_ms
        assert stage.processor_ms > 0
    assert found.memory["light maps"] >= maps_memory(mi.Float, 64)
    assert found.memory["collectors"] == 8 * 4 * 4 * 16 * 12  # sets, numbers, bytes, pixels
    cold, *warm = found.convergence
    assert (cold.start, cold.iterations, len(cold.by_set)) == ("cold", 10, 8)
    assert [search.iterations for search in warm] == [1, 2, 3]
    for search in found.convergence:
        assert all(0 <= share <= search.any_set <= 1 for share in search.by_set.values())
    assert warm[2].any_set <= warm[0].any_set + 0.02


@pytest.mark.parametrize("options", [["--json"], []])
def test_stages_are_printed(variant, monkeypatch, capfd, options):
    asked = []

    def stages(scene, parameters, *, progress):
        asked.append((scene.camera.width, parameters))
        return FOUND

    monkeypatch.setattr(study, "cloud_stages", stages)
    assert run(["bench", "two-lobes", "--stages", "--size", "32x24", "--set", "steps=8", *options]) == 0
    printed = capfd.readouterr().out
    assert asked == [(32, {"steps": 8})]
    if options:
        (record,) = json.loads(printed)["stages"]
        assert record["stages"][0]["time"]["median_ms"] == 7.1
        assert record["convergence"][1]["by_set"]["2"] == 0.006
        times, searches = cloud_stages_tables(record)
        assert (len(times.rows), len(searches.rows)) == (2, 2)
    else:
        assert "as published" in printed
        assert "order 31-inf" in printed


def test_scenes_without_clouds_are_refused(variant, capfd):
    assert run(["bench", "open-fog", "--stages", "--size", "16x12"]) == 2
    assert "--stages: the scene has no clouds" in capfd.readouterr().err
    with pytest.raises(InputError, match="stratocumulus"):
        cloud_stages(read_scene(loaded_fog()), {})


def loaded_fog():
    from validation.scenes.loading import load_scene

    return load_scene("open-fog", (16, 12)).scene
