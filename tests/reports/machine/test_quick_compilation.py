# SPDX-License-Identifier: BSD-3-Clause
"""Kernels that compile quickly give the same images, in processes whose
standard error is kept clean.
"""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from airlight.reports.machine.environment import prepare
from airlight.reports.machine.quick_compilation import CACHE_VARIABLE, VARIABLE

RENDER = """
import hashlib, os
from airlight.reports.machine.environment import activate
activate("llvm_ad_rgb")
import numpy as np
import airlight
scene = airlight.load_scene("sphere-spot", size=(24, 18))
for method in ("shadow-planes", "light-volumes"):
    image = np.asarray(airlight.render(scene, method=method).airlight)
    print(hashlib.sha256(image.tobytes()).hexdigest())
os.write(2, b"one line\\n")
"""


def run(script: str, folder: Path, *, quick: bool) -> subprocess.CompletedProcess[str]:
    """Run a script in a process with a kernel cache of its own."""
    plain = {
        name: value for name, value in os.environ.items() if name not in (VARIABLE, CACHE_VARIABLE)
    }
    asked = {VARIABLE: "quick"} if quick else {}
    command = [sys.executable, "-c", script]
    given = plain | asked | {CACHE_VARIABLE: str(folder)}
    return subprocess.run(command, env=given, capture_output=True, text=True, timeout=300)


def kernels(folder: Path) -> dict[str, str]:
    """By name, which says what is compiled, a digest of how that was compiled."""
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.glob("*.bin")
    }


@pytest.fixture(scope="module")
def rendered(
    variant, tmp_path_factory
) -> dict[str, tuple[subprocess.CompletedProcess[str], dict[str, str]]]:
    """By how its kernels are compiled, a process that rendered, and its kernels."""
    if variant != "llvm_ad_rgb":
        pytest.skip("LLVM compiles the kernels of processors alone")
    folder = tmp_path_factory.mktemp("kernels")
    results = {}
    for name in ("full", "quick"):
        own, quick = folder / f"of-{name}", name != "full"
        result = run(RENDER, own, quick=quick)
        assert result.returncode == 0, result.stderr
        results[name] = result, kernels(own / "quick" if quick else own)
    return results


@pytest.mark.slow
@pytest.mark.claim("quick-kernels")
def test_images_are_the_same_bit_for_bit_and_the_kernels_are_not(rendered):
    images, compiled = zip(*((result.stdout, kept) for result, kept in rendered.values()))
    assert len(set(images)) == 1
    assert images[0].count("\n") == 2
    full, quick = compiled
    common = full.keys() & quick.keys()
    assert len(common) >= 10
    assert sum(full[name] != quick[name] for name in common) > 0.9 * len(common)


@pytest.mark.slow
def test_llvm_says_nothing_and_others_do(rendered):
    assert {result.stderr for result, _ in rendered.values()} == {"one line\n"}


def test_a_process_that_has_imported_dr_jit_stays_as_it_is(variant, monkeypatch):
    """Its kernels would mix with those of others in one folder."""
    monkeypatch.setenv(VARIABLE, "quick")
    monkeypatch.delenv(CACHE_VARIABLE, raising=False)
    prepare("llvm_ad_rgb")
    assert CACHE_VARIABLE not in os.environ
