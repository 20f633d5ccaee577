# SPDX-License-Identifier: BSD-3-Clause
"""`airlight reference`: what is kept, what is said of it, and what a stopped run leaves.

Random numbers stand in the place of the tracer, as everything here is about files;
`tests/reference` traces. The slow test at the end runs the command in a process of its own, with
the tracer.
"""

import json
import os
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

import airlight.validation.estimates.images
import airlight.validation.estimates.monte_carlo
from airlight.reference.monte_carlo.batches import single_batch
from airlight.reference.storage.cache import cache_folder, load_arrays
from airlight.reference.storage.exr import read_exr
from airlight.reports.commands import main as cli

ROOT = Path(__file__).resolve().parents[3]
SCENE = ["sphere-spot", "--size", "8x6"]

pytestmark = pytest.mark.usefixtures("own_cache")


@pytest.fixture
def traced(variant, monkeypatch):
    """Draw batches in the place of tracing them; a seed that is listed is where Ctrl-C comes."""
    stops = []

    def trace(reference, seed, samples, **options):
        if seed in stops:
            raise KeyboardInterrupt
        # The standard deviation of a pixel is its mean, so that the image is
        # known to 1/sqrt(144 batches).
        return single_batch(
            seed, samples, np.random.default_rng([seed, samples]).exponential(size=(2, 48, 3))
        )

    monkeypatch.setattr(airlight.validation.estimates.monte_carlo, "volpath_batch", trace)
    return stops


def run(output, *arguments, status=0, estimator="volpath"):
    assert (
        cli.run(["reference", *SCENE, "--estimator", estimator, "-o", str(output), *arguments])
        == status
    )


def summary(output, capfd, *arguments, **options):
    capfd.readouterr()
    run(output, "--json", *arguments, **options)
    return json.loads(capfd.readouterr().out)["result"]


@pytest.mark.claim("runs-go-on", tolerance="none: equal bytes")
def test_same_samples_and_seed_are_the_same_bytes(traced, tmp_path, monkeypatch, capfd):
    """From an empty cache, from a full one, and from one that holds more."""
    first = summary(tmp_path / "a.exr", capfd, "--samples", "64", "--seed", "3")
    second = summary(tmp_path / "b.exr", capfd, "--samples", "64", "--seed", "3")
    assert (first["how"]["cached"], second["how"]["cached"]) == (0, 32)
    attributes = read_exr(tmp_path / "a.exr").attributes
    expected = {
        "estimator": "volpath",
        "spp": 64,
        "batch_spp": 2,
        "batches": 32,
        "seed": 3,
        "seeds": "3-34",
    }
    assert {name: attributes[f"airlight:{name}"] for name in expected} == expected
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / "other"))
    run(tmp_path / "more.exr", "--samples", "72")
    run(tmp_path / "c.exr", "--samples", "64", "--seed", "3")
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "c.exr").read_bytes()
    assert (tmp_path / "a.exr").read_bytes() != (tmp_path / "more.exr").read_bytes()


@pytest.mark.claim("targets-of-a-run")
def test_target_error_is_reached_and_no_more(traced, tmp_path, capfd):
    # A channel has 48 pixels: its mean is known to 1/sqrt(48 batches), to 2 % from 52 batches on.
    reached = summary(tmp_path / "a.exr", capfd, "--error", "0.02")
    assert reached["how"]["reached"] is True
    error = reached["how"]["errors"]["pooled"]
    assert error <= 0.02
    assert reached["batches"] == 32 or error > 0.02 * (1 - 8 / reached["batches"]) ** 0.5 * 0.9
    again = summary(tmp_path / "b.exr", capfd, "--error", "0.02")
    assert again["how"]["cached"] == reached["batches"]
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


def test_an_error_that_is_not_known_is_said_so_in_text_and_json(
    traced, tmp_path, capfd, monkeypatch
):
    monkeypatch.setattr(
        airlight.validation.estimates.images, "near_light", lambda reference, distance: distance > 0
    )
    printed = summary(tmp_path / "a.exr", capfd, "--error", "0.02", status=1)
    errors = printed["how"]["errors"]
    assert (printed["relative_error"], errors["pooled"], errors["worst"]) == (None, None, None)
    run(tmp_path / "b.exr", "--error", "0.02", status=1)
    out = capfd.readouterr().out
    assert f"standard error unknown: {errors['unknown']}" in out
    assert "standard error 0" not in out


def test_quadrature_needs_no_budget(variant, tmp_path, capfd):
    printed = summary(tmp_path / "a.exr", capfd, estimator="quadrature")
    assert printed["pixel"] == "centre"
    assert read_exr(tmp_path / "a.exr").attributes["airlight:pixel"] == "centre"


@pytest.mark.claim("runs-go-on", "damaged-cache")
def test_a_stopped_run_goes_on_and_a_damaged_block_is_traced_again(traced, tmp_path, capfd):
    (tmp_path / "a.exr").write_text("an older file")
    traced.append(13)
    run(tmp_path / "a.exr", "--samples", "64", status=130)
    assert capfd.readouterr().out == ""
    assert (tmp_path / "a.exr").read_text() == "an older file"
    traced.clear()
    run(tmp_path / "a.exr", "--samples", "64")
    assert "13 of 32 batches from the cache" in capfd.readouterr().out
    path = next(cache_folder().glob("volpath-*/000008-000015.npz"))
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 16
    path.write_bytes(content)
    repaired = summary(tmp_path / "b.exr", capfd, "--samples", "64")
    assert (repaired["how"]["cached"], repaired["how"]["damaged"]) == (24, 1)
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


@pytest.mark.claim("merge")
def test_merged_files_of_two_machines(traced, tmp_path, monkeypatch, capfd):
    """Each with a cache of its own; together they are what one machine finds with all the seeds."""
    for name, seed in (("a", "0"), ("b", "32")):
        monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / name))
        run(tmp_path / f"{name}.exr", "--samples", "64", "--seed", seed)
    capfd.readouterr()
    files = [word for name in "ab" for word in ("--merge", str(tmp_path / f"{name}.exr"))]
    assert cli.run(["reference", SCENE[0], *files, "-o", str(tmp_path / "m.exr"), "--json"]) == 0
    summed = json.loads(capfd.readouterr().out)["result"]
    assert (summed["seeds"], summed["batches"], summed["spp"]) == ("0-63", 64, 128)
    run(tmp_path / "whole.exr", "--samples", "127")  # 64 batches of 2 as well
    merged, whole = read_exr(tmp_path / "m.exr"), read_exr(tmp_path / "whole.exr")
    assert merged.attributes["airlight:seeds"] == whole.attributes["airlight:seeds"]
    for name, layer in whole.layers.items():
        # float32 means, and errors that come from differences of them: relative 6e-8 of the image
        np.testing.assert_allclose(merged.layers[name], layer, rtol=1e-5, atol=1e-6 * layer.max())
    assert (
        cli.run(["reference", SCENE[0], *files[:2], *files[:2], "-o", str(tmp_path / "no.exr")])
        == 2
    )
    assert "share the seeds 0-31" in capfd.readouterr().err
    assert cli.run(["reference", "open-fog", *files, "-o", str(tmp_path / "no.exr")]) == 2
    assert (
        "merge: the files are of the scene sphere-spot, got open-fog; name that one"
        in capfd.readouterr().err
    )
    assert not (tmp_path / "no.exr").exists()


class Workers:
    """A stub of a cluster: this process does the tasks of its two
    workers; `sent` are their names.
    """

    def __init__(self):
        self.sent = []

    @contextmanager
    def connected(self, place, **how):
        assert place == 2
        yield self

    def scheduler_info(self, **how):
        return {"workers": {"one": {}, "two": {}}}

    def run_groups(self, cluster, groups, *, made):
        from airlight.reports.cluster.run import _outcome

        assert cluster is self
        for task in (task for group in groups for task in group.tasks):
            self.sent.append(task.name)
            yield _outcome(task)


@pytest.mark.claim("references-from-clusters", tolerance="none: byte for byte")
@pytest.mark.parametrize(
    ("estimator", "words", "sent"),
    [
        ("quadrature", [], ["reference 0"]),
        ("volpath", ["--samples", "64", "--seed", "3"], [f"batch {seed}" for seed in range(3, 35)]),
        # as many as that takes, in waves of 8 for each worker
        ("volpath", ["--error", "0.02"], None),
    ],
)
def test_workers_compute_what_the_cache_lacks_and_the_file_is_the_same(
    traced, tmp_path, monkeypatch, estimator, words, sent
):
    """`tests/reports/commands/test_sweep.py` has the processes."""
    pytest.importorskip("distributed", reason="the extra `sweep` is not installed")
    workers = Workers()
    monkeypatch.setattr("airlight.reports.cluster.connect.connected", workers.connected)
    monkeypatch.setattr("airlight.reports.cluster.references.run_groups", workers.run_groups)
    # which takes long
    monkeypatch.setattr("airlight.reports.cluster.references.facts", lambda: None)
    run(tmp_path / "here.exr", *words, estimator=estimator)
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / "other"))
    for name in ("there", "again"):
        run(tmp_path / f"{name}.exr", *words, "--cluster", "local:2", estimator=estimator)
        assert (tmp_path / f"{name}.exr").read_bytes() == (tmp_path / "here.exr").read_bytes()
    assert len(workers.sent) == len(set(workers.sent))  # the second time nothing is lacking
    assert workers.sent == sent if sent else len(workers.sent) % 16 == 0


@pytest.mark.claim("runs-go-on")
@pytest.mark.slow
def test_a_run_that_is_killed_loses_nothing(variant, tmp_path, capfd, own_cache):
    """The real tracer in a process, killed when the cache has three of its batches."""
    (tmp_path / "a.exr").write_text("an older file")
    command = [
        "reference",
        *SCENE,
        "--estimator",
        "volpath",
        "-o",
        str(tmp_path / "a.exr"),
        "--samples",
        "400000",
    ]
    code = f"import sys\nfrom airlight.reports.commands.main import run\nsys.exit(run({command!r}))"
    process = subprocess.Popen(
        [sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": str(ROOT)}, cwd=ROOT
    )
    while len(list(own_cache.glob("volpath-*/0*.npz"))) < 3 and process.poll() is None:
        time.sleep(0.05)
    process.kill()
    assert process.wait() == -9
    assert (tmp_path / "a.exr").read_text() == "an older file"
    # Every file that has its final name is whole.
    names = [
        str(path.relative_to(own_cache).with_suffix(""))
        for path in own_cache.glob("volpath-*/0*.npz")
    ]
    assert len(names) >= 3
    assert all(load_arrays(name) is not None for name in names)
    resumed = summary(tmp_path / "b.exr", capfd, "--samples", "2048")
    assert resumed["how"]["cached"] >= 3
    assert resumed["how"]["damaged"] == 0
