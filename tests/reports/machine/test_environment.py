# SPDX-License-Identifier: BSD-3-Clause
"""Which libLLVM and variant are taken, what is said where something is missing, and what
`airlight doctor` shows.
"""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from airlight.realtime.child_process import EndedError
from airlight.reference.storage.build import build
from airlight.reference.storage.cache import store_arrays
from airlight.reports.commands.main import run
from airlight.reports.machine import doctor, environment, gpu, llvm
from airlight.reports.machine.environment import MissingError, missing_packages, prepare
from airlight.reports.machine.llvm import find_llvm

ROOT = Path(__file__).resolve().parents[3]
HEADER = Path(sys.executable).read_bytes()[:64]  # of a binary that suits this machine

linux = pytest.mark.skipif(
    sys.platform != "linux", reason="looks at ELF files and Linux' library names"
)


def _library(folder: Path, name: str, content: bytes = HEADER) -> Path:
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_bytes(content)
    return path


@pytest.fixture
def only(tmp_path, monkeypatch):
    """A folder that is the only one in which libLLVM is looked for; no user's settings, no GPU."""
    folder = tmp_path / "lib"
    folder.mkdir()
    for name in ("DRJIT_LIBLLVM_PATH", "AIRLIGHT_VARIANT", "AIRLIGHT_COMPILATION"):
        # so that it is as it was after the test, also where `prepare` sets it
        monkeypatch.setenv(name, "")
        monkeypatch.delenv(name)
    monkeypatch.setattr(llvm, "llvm_folders", lambda: [folder])
    monkeypatch.setattr(environment, "cuda_problem", lambda: "no GPU")
    return folder


@linux
class TestFindLlvm:
    """Candidates by file name alone."""

    def test_the_newest_that_works_first_and_each_once(self, only):
        for name in (
            "libLLVM-14.0.6.so",
            "libLLVM-16.so.1",
            "libLLVM.so.18.1",
            "libLLVM.so.20.1",
            "libLLVM.so.19.1",
        ):
            _library(only, name)
        (only / "libLLVM-19.so").symlink_to(only / "libLLVM.so.19.1")
        found = [(library.version, library.works) for library in find_llvm()]
        assert found == [
            ((20, 1), True),
            ((19, 1), True),
            ((18, 1), True),
            ((16, 0), False),
            ((14, 0), False),
        ]


@linux
class TestPrepare:
    """The check before the first kernel."""

    def test_the_users_setting_wins_if_it_works(self, only, tmp_path, monkeypatch):
        own = _library(tmp_path, "libLLVM-17.so.1")
        _library(only, "libLLVM.so.19.1")
        monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(own))
        assert prepare().llvm.path == str(own)

    def test_a_setting_that_does_not_work_is_named(self, only, tmp_path, monkeypatch):
        own = _library(tmp_path, "libLLVM-14.so.1")
        _library(only, "libLLVM.so.19.1")
        monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(own))
        with pytest.raises(
            MissingError, match=r"DRJIT_LIBLLVM_PATH names .*libLLVM-14.so.1.*unset it"
        ):
            prepare()
        assert "libllvm19" not in missing_packages()

    @pytest.mark.parametrize("names", [[], ["libLLVM-14.so.1", "libLLVM-15.so.1"]])
    def test_without_a_working_llvm(self, only, names):
        for name in names:
            _library(only, name)
        with pytest.raises(
            MissingError, match=r"17 or newer is needed.*apt-get install -y libllvm19"
        ) as caught:
            prepare()
        assert "\n" not in str(caught.value)
        assert "DRJIT_LIBLLVM_PATH" not in os.environ

    @pytest.mark.claim("variant")
    def test_cuda_is_chosen_where_it_works_and_does_without_llvm(self, only, monkeypatch):
        monkeypatch.setattr(environment, "cuda_problem", lambda: "")
        assert prepare() == environment.Prepared("cuda_ad_rgb", None)


class _Driver:
    """A CUDA driver that answers as a test wants, and 0 where it does not care."""

    def __init__(self, version=12040, capability=(9, 0), devices=1, init=0):
        self.version, self.capability, self.devices, self.init = version, capability, devices, init

    def __getattr__(self, name):
        return lambda *given: 0

    def cuInit(self, flags):
        return self.init

    def cuDriverGetVersion(self, out):
        out._obj.value = self.version
        return 0

    def cuDeviceGetCount(self, out):
        out._obj.value = self.devices
        return 0

    def cuDeviceGetName(self, out, size, device):
        out.value = b"A GPU"
        return 0

    def cuDeviceGetAttribute(self, out, attribute, device):
        out._obj.value = self.capability[attribute - 75]
        return 0


@pytest.mark.parametrize(
    ("driver", "works", "word"),
    [
        (_Driver(), True, "A GPU, compute capability 9.0, CUDA 12.4"),
        (_Driver(version=12010), False, "driver too old: CUDA 12.1"),
        (_Driver(capability=(7, 0)), False, "7.5 or newer"),
        (_Driver(devices=0), False, "no device"),
        (_Driver(init=100), False, "no device"),
    ],
)
def test_cuda_by_what_the_driver_says(driver, works, word, monkeypatch):
    monkeypatch.setattr(gpu, "_load", lambda name, variable: driver)
    status = gpu.cuda_status()
    assert status.works == works
    assert word in status.reason


def test_times_of_kernels_that_were_compiled_quickly_are_not_those_of_the_machine(monkeypatch):
    keys = []
    for value in ("full", "quick"):
        monkeypatch.setenv("AIRLIGHT_COMPILATION", value)
        keys.append(environment.machine())
    assert keys[1] == keys[0] | {"compilation": "quick"}


@pytest.fixture(scope="module")
def diagnosis(variant):
    """Return the diagnosis of this machine, made once."""
    return doctor.diagnose()


def test_this_machine_works(diagnosis, variant):
    assert diagnosis.works
    assert diagnosis.problem is None
    assert diagnosis.variant == variant
    # 15 000 roundings of float32, as Mitsuba 3.9 has it; a later rule would be of
    # the same order or smaller
    assert 0 < diagnosis.kernel.epsilon < 2e-3


def test_a_missing_library_is_shown_with_what_to_do(monkeypatch, capsys):
    def missing():
        raise MissingError("no libLLVM found: install it")

    monkeypatch.setattr(doctor, "prepare", missing)
    monkeypatch.setattr(doctor, "find_llvm", lambda: [])
    assert run(["doctor", "--json"]) == 3
    printed = json.loads(capsys.readouterr().out)["result"]
    assert (printed["works"], printed["problem"]) == (False, "no libLLVM found: install it")
    assert {"what": "LLVM", "works": False, "details": "none found"} in printed["checks"]
    assert run(["doctor"]) == 3
    assert "Not ready: no libLLVM found: install it" in capsys.readouterr().out


def test_a_kernel_that_crashes_is_shown_and_crashes_nothing(monkeypatch):
    monkeypatch.setattr(doctor, "probe", os.abort)
    with pytest.raises(
        EndedError, match="test kernel in llvm_ad_rgb: ended its process, killed by SIGABRT"
    ):
        doctor.try_kernel("llvm_ad_rgb")


@pytest.fixture
def filled(own_cache):
    for kind in ("quadrature", "report-reference", "report-method"):
        for number in range(2):
            store_arrays(f"{kind}-{number:032x}", {"a": np.zeros(2000)})
    return own_cache


@pytest.mark.claim("build-named")
def test_doctor_names_the_commit_and_the_digest(monkeypatch):
    monkeypatch.setattr(doctor, "prepare", lambda: environment.Prepared("llvm_ad_rgb", None))
    monkeypatch.setattr(
        doctor, "try_kernel", lambda variant: doctor.Kernel(variant, 2, None, 8.94e-4)
    )
    (check,) = (check for check in doctor.diagnose().checks if check.what == "airlight")
    assert (check.works, check.details) == (True, build().words)


def test_the_cache_is_shown_and_cleared(filled, monkeypatch):
    monkeypatch.setattr(
        doctor, "diagnose", lambda: doctor.Machine(True, None, "llvm_ad_rgb", None, ())
    )
    monkeypatch.setenv("AIRLIGHT_CACHE_SIZE", "1GiB")
    size = sum(path.stat().st_size for path in filled.rglob("*.npz"))
    shown = doctor.doctor().cache
    assert (shown.folder, shown.limit, shown.bytes) == (str(filled), 2**30, size)
    assert {kind: of.files for kind, of in shown.kinds.items()} == {
        "quadrature": 2,
        "report-method": 2,
        "report-reference": 2,
    }
    cleared = doctor.doctor(clear_cache=True)
    assert (cleared.cache.removed, cleared.cache.freed, cleared.cache.files) == (6, size, 0)
    assert not list(filled.rglob("*.npz"))
    assert (cleared.passed, cleared.status) == (True, 0)
    left = replace(cleared, cache=replace(cleared.cache, files=1))
    assert (left.passed, left.status) == (False, 1)
    broken = replace(cleared, machine=doctor.Machine(False, "no libLLVM", None, None, ()))
    assert (broken.passed, broken.status) == (False, 3)


@linux
def test_files_of_mitsuba_are_read_on_one_core(tmp_path):
    """With one thread Mitsuba waits for ever: a scene with a texture never came
    on a machine of one core.
    """
    code = (
        "import os; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\n"
        "from airlight.reports.machine.environment import activate\n"
        "activate()\n"
        "import mitsuba as mi, numpy as np\n"
        "mi.Bitmap(np.ones((3, 4, 3), np.float32)).write('one.exr')\n"
        "print(*mi.Bitmap('one.exr').size())"
    )
    world = os.environ | {"PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", code]
    ran = subprocess.run(
        command, cwd=tmp_path, env=world, capture_output=True, text=True, timeout=120
    )
    assert ran.stdout.split() == ["4", "3"], ran.stderr
