# SPDX-License-Identifier: BSD-3-Clause
"""`airlight reference` and `airlight merge`: budgets, interruptions, full disks, damaged caches."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reference.storage.cache import cache_folder, load_arrays
from reference.storage.exr import read_exr
from reports.commands import main as cli

ROOT = Path(__file__).resolve().parents[3]
SCENE = ["sphere-spot", "--size", "8x6"]

pytestmark = pytest.mark.usefixtures("own_cache")


def run(output, *arguments, status=0, estimator="volpath"):
    assert cli.run(["reference", *SCENE, "--estimator", estimator, "-o", str(output), *arguments]) == status


def summary(output, capfd, *arguments, **options):
    capfd.readouterr()
    run(output, "--json", *arguments, **options)
    return json.loads(capfd.readouterr().out)


@pytest.mark.claim("runs-go-on", tolerance="none: equal bytes")
def test_same_samples_and_seed_are_the_same_bytes(variant, tmp_path, monkeypatch, capfd):
    """From an empty cache, from a full one, and from one that holds more."""
    first = summary(tmp_path / "a.exr", capfd, "--spp", "64", "--seed", "3")
    second = summary(tmp_path / "b.exr", capfd, "--spp", "64", "--seed", "3")
    assert (first["cached"], second["cached"]) == (0, 32)
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / "other"))
    run(tmp_path / "more.exr", "--spp", "72")
    run(tmp_path / "c.exr", "--spp", "64", "--seed", "3")
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "c.exr").read_bytes()
    assert (tmp_path / "a.exr").read_bytes() != (tmp_path / "more.exr").read_bytes()


def test_header_and_words_name_the_batches(variant, tmp_path, capfd):
    run(tmp_path / "a.exr", "--spp", "64", "--seed", "5")
    text = capfd.readouterr().out
    assert "64 samples a pixel in 32 batches, seeds 5-36" in text
    assert "from the cache" not in text
    attributes = read_exr(tmp_path / "a.exr").attributes
    expected = {"estimator": "volpath", "spp": 64, "batch_spp": 2, "batches": 32, "seed": 5, "seeds": "5-36"}
    assert {name: attributes[f"airlight:{name}"] for name in expected} == expected
    assert len(str(attributes["airlight:scene_digest"])) == 64
    run(tmp_path / "a.exr", "--spp", "80", "--seed", "5")
    assert "32 of 40 batches from the cache" in capfd.readouterr().out


@pytest.mark.claim("targets-of-a-run")
def test_target_error_is_reached_and_no_more(variant, tmp_path, capfd):
    reached = summary(tmp_path / "a.exr", capfd, "--target-error", "0.03")
    assert reached["reached"] is True
    assert reached["pooled_error"] <= 0.03
    assert reached["batches"] >= 32
    # It would not have been reached eight batches earlier, but for the least number of batches.
    assert reached["batches"] == 32 or reached["pooled_error"] > 0.03 * (1 - 8 / reached["batches"]) ** 0.5 * 0.9
    again = summary(tmp_path / "b.exr", capfd, "--target-error", "0.03")
    assert again["cached"] == reached["batches"]
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


@pytest.mark.slow
def test_worst_pixel_asks_for_more_than_the_image(variant, tmp_path, capfd):
    printed = summary(tmp_path / "a.exr", capfd, "--target-error", "0.25", "--target", "worst")
    assert printed["pooled_error"] < 0.1 < printed["worst_error"] <= 0.25


@pytest.mark.slow
def test_time_budget_is_kept(variant, tmp_path, capfd):
    run(tmp_path / "warm.exr", "--spp", "64")  # the kernels are compiled by now
    start = time.monotonic()
    first = summary(tmp_path / "a.exr", capfd, "--time-budget", "2")
    assert first["batches"] >= 2
    # Loading the scene comes on top, and the machine may be busy.
    assert time.monotonic() - start < 8
    more = summary(tmp_path / "a.exr", capfd, "--time-budget", "1")
    assert more["cached"] == first["batches"]
    assert more["batches"] >= first["batches"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--spp", "128", "--time-budget", "3"], "--spp and --time-budget exclude each other"),
        (["--target-error", "0.1", "--time-budget", "3"], "--target-error and --time-budget exclude each other"),
        (["--target-error", "0"], "--target-error: got 0, wanted a positive number"),
        (["--time-budget", "-2"], "--time-budget: got -2, wanted a positive number"),
        (["--pixel", "area"], "volpath traces pixel centres"),
        (["--spp", "63"], "64"),
        (["--seed", "1048570"], "seed: got 1048570 for 32 batches"),
        (["--estimator", "quadrature", "--spp", "128"], "--spp is for an estimator that samples"),
        (["--estimator", "path"], "'path'"),
    ],
)
def test_mistakes_are_one_line(variant, tmp_path, capfd, arguments, words):
    run(tmp_path / "a.exr", *arguments, status=2)
    captured = capfd.readouterr()
    assert words in captured.err
    assert captured.err.count("\n") == 1
    assert not (tmp_path / "a.exr").exists()


def test_quadrature_needs_no_budget(variant, tmp_path, capfd):
    printed = summary(tmp_path / "a.exr", capfd, estimator="quadrature")
    assert printed["pixel"] == "centre"
    assert read_exr(tmp_path / "a.exr").attributes["airlight:pixel"] == "centre"


@pytest.mark.claim("single-scatter-agrees", tolerance="four to six standard errors")
@pytest.mark.parametrize("estimator", ["single-scatter"])
def test_single_scatter_agrees_with_the_quadrature(variant, tmp_path, capfd, estimator):
    exact = summary(tmp_path / "q.exr", capfd, estimator="quadrature")["means"]
    sampled = summary(tmp_path / "s.exr", capfd, "--spp", "256", estimator=estimator)
    # The largest over channels and layers, at six standard errors; 1e-5 for the surface's float32.
    tolerance = 6 * sampled["pooled_error"] + 1e-5
    for layer in ("airlight", "surface"):
        np.testing.assert_allclose(sampled["means"][layer], exact[layer], rtol=tolerance)


@pytest.mark.claim("runs-go-on")
def test_interrupted_run_leaves_the_file_and_says_what_is_kept(variant, tmp_path, capfd, monkeypatch):
    import validation.estimates.monte_carlo

    (tmp_path / "a.exr").write_text("an older file")
    trace = validation.estimates.monte_carlo.volpath_batch

    def interrupted(truth, seed, samples, **options):
        if seed == 5:
            raise KeyboardInterrupt
        return trace(truth, seed, samples, **options)

    monkeypatch.setattr(validation.estimates.monte_carlo, "volpath_batch", interrupted)
    run(tmp_path / "a.exr", "--spp", "64", status=130)
    captured = capfd.readouterr()
    # Before it, on a busy machine, lines of progress.
    assert captured.err.splitlines()[-1] == "interrupted: 5 finished batches are kept; run again to go on"
    assert captured.out == ""
    assert (tmp_path / "a.exr").read_text() == "an older file"
    monkeypatch.setattr(validation.estimates.monte_carlo, "volpath_batch", trace)
    run(tmp_path / "a.exr", "--spp", "64")
    assert "5 of 32 batches from the cache" in capfd.readouterr().out


@pytest.mark.claim("damaged-cache")
def test_damaged_cache_is_said_and_mended(variant, tmp_path, capfd):
    run(tmp_path / "a.exr", "--spp", "64")
    path = next(cache_folder().glob("volpath-*/000008-000015.npz"))
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 16
    path.write_bytes(content)
    run(tmp_path / "b.exr", "--spp", "64")
    text = capfd.readouterr().out
    assert "24 of 32 batches from the cache" in text
    assert "1 damaged file of the cache traced again" in text
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


@pytest.mark.claim("merge")
def test_merged_files_of_two_machines(variant, tmp_path, monkeypatch, capfd):
    """Each with a cache of its own; together they are what one machine finds with all the seeds."""
    for name, seed in (("a", "0"), ("b", "32")):
        monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / name))
        run(tmp_path / f"{name}.exr", "--spp", "64", "--seed", seed)
    capfd.readouterr()
    files = [str(tmp_path / f"{name}.exr") for name in "ab"]
    assert cli.run(["merge", *files, "-o", str(tmp_path / "m.exr"), "--json"]) == 0
    summed = json.loads(capfd.readouterr().out)
    assert (summed["seeds"], summed["batches"], summed["spp"]) == ("0-63", 64, 128)
    run(tmp_path / "whole.exr", "--spp", "127")  # 64 batches of 2 as well
    merged, whole = read_exr(tmp_path / "m.exr"), read_exr(tmp_path / "whole.exr")
    assert merged.attributes["airlight:seeds"] == whole.attributes["airlight:seeds"]
    for name, layer in whole.layers.items():
        # float32 means, and errors that come from differences of them: relative 6e-8 of the image
        np.testing.assert_allclose(merged.layers[name], layer, rtol=1e-5, atol=1e-6 * layer.max())
    assert cli.run(["merge", files[0], files[0], "-o", str(tmp_path / "no.exr")]) == 2
    assert "share the seeds 0-31" in capfd.readouterr().err
    assert not (tmp_path / "no.exr").exists()


def start(output, *arguments, before=""):
    """Run the command in a process of its own; `before` is Python to run in it first."""
    command = ["reference", *SCENE, "--estimator", "volpath", "-o", str(output), *arguments]
    code = f"import sys\n{before}\nfrom reports.commands.main import run\nsys.exit(run({command!r}))"
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen([sys.executable, "-c", code], env=environment, cwd=ROOT, text=True, **pipes)


def wait_for_batches(process, cache, number):
    for _ in range(1200):
        if len(list(cache.glob("volpath-*/0*.npz"))) >= number or process.poll() is not None:
            return
        time.sleep(0.05)
    pytest.fail("no batches after a minute")


@pytest.mark.claim("runs-go-on")
@pytest.mark.slow
@pytest.mark.parametrize("sign", [signal.SIGKILL, signal.SIGINT])
def test_a_run_that_is_stopped_from_outside_loses_nothing(variant, tmp_path, capfd, own_cache, sign):
    (tmp_path / "a.exr").write_text("an older file")
    process = start(tmp_path / "a.exr", "--spp", "400000")
    wait_for_batches(process, own_cache, 3)
    process.send_signal(sign)
    out, err = process.communicate(timeout=60)
    assert out == ""
    if sign is signal.SIGINT:
        assert process.returncode == 130
        assert err.startswith("interrupted: ")
        assert err.count("\n") == 1
        assert not list(tmp_path.rglob(".*"))  # and nothing half-written
    else:
        assert process.returncode == -signal.SIGKILL
    assert (tmp_path / "a.exr").read_text() == "an older file"
    # Every file that has its final name is whole.
    names = [str(path.relative_to(own_cache).with_suffix("")) for path in own_cache.glob("volpath-*/0*.npz")]
    assert len(names) >= 3
    assert all(load_arrays(name) is not None for name in names)
    resumed = summary(tmp_path / "b.exr", capfd, "--spp", "2048")
    assert resumed["cached"] >= 3
    assert resumed["damaged"] == 0


@pytest.mark.slow
def test_a_full_disk_is_one_line(variant, tmp_path, own_cache):
    """A limit on the size of a file stands for the disk: the blocks of eight batches do not fit, single ones do."""
    # Once without the limit, so that Dr.Jit need not write the kernels of a fresh machine, which do not fit either.
    out, err = start(tmp_path / "a.exr", "--spp", "64").communicate(timeout=120)
    shutil.rmtree(own_cache)
    (tmp_path / "a.exr").unlink()
    before = "import resource, signal\nsignal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
    before += "resource.setrlimit(resource.RLIMIT_FSIZE, (6000, 6000))"
    process = start(tmp_path / "a.exr", "--spp", "64", before=before)
    out, err = process.communicate(timeout=120)
    assert (process.returncode, out) == (2, "")
    assert err.count("\n") == 1
    assert f"{own_cache}: File too large; 8 finished batches are kept; make room" in err
    assert sorted(path.stem for path in own_cache.glob("volpath-*/*")) == [f"{seed:06d}" for seed in range(8)]
    assert not (tmp_path / "a.exr").exists()
    assert not list(tmp_path.rglob(".*"))
