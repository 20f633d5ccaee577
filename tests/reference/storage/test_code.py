# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the digest of code changes with every line and every number that a result may
depend on, and no longer.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from airlight.reference.quadrature.reference import ReferenceInputs
from airlight.reference.storage import code as module
from airlight.reference.storage.code import code_digest, source_digest
from airlight.reports.machine.driver_check import DriverInputs
from airlight.validation.estimates.monte_carlo import VolpathInputs
from airlight.validation.kernels.rays import RayInputs
from airlight.validation.study.study_scene import CheckInputs

ROOT = str(Path(__file__).resolve().parents[3])

CODE = '''
"""Doc."""
import os, helper as h  # neighbours
from inner import part

def f(x):
    """Doc."""
    from late import g
    return h.double(x) + g(x)
'''


@pytest.fixture
def folder(tmp_path):
    files = {
        "mine.py": CODE,
        "helper.py": "from deep import two\n\ndef double(x):\n    return two * x\n",
        "deep.py": "two = 2\n",
        "late.py": "def g(x):\n    return x\n",
        "inner/__init__.py": "",
        "inner/part.py": "from .beside import one\n",
        "inner/beside.py": "one = 1\n",
        "unrelated.py": "zero = 0\n",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    return tmp_path


def test_a_users_file_counts_with_the_modules_beside_it_that_it_imports(folder):
    digests = [code_digest([folder / "mine.py"])]

    def write(name, text):
        (folder / name).write_text(text)
        digests.append(code_digest([folder / "mine.py"]))

    for name in ("helper.py", "deep.py", "late.py", "inner/part.py", "inner/beside.py"):
        write(name, (folder / name).read_text() + "\nthree = 3\n")
    assert len(set(digests)) == 6
    write("unrelated.py", "zero = 1\n")
    write("deep.py", "# A comment.\n\n\n" + (folder / "deep.py").read_text())
    write("mine.py", (folder / "mine.py").read_text().replace("Doc.", "Other words."))
    assert digests[-3:] == [digests[5]] * 3
    write("mine.py", "no Python")
    assert digests[-1] != digests[-2]


def test_data_that_a_users_file_names_count_with_it(folder):
    (folder / "mine.py").write_text(
        "from pathlib import Path\nTABLE = Path(__file__).with_name('table.csv')\n"
    )
    digests = []
    for name, text in (("table.csv", "1"), ("other.csv", "1"), ("table.csv", "2")):
        (folder / name).write_text(text)
        digests.append(code_digest([folder / "mine.py"]))
    assert digests[0] == digests[1] != digests[2]


@pytest.mark.parametrize("words", ["'tables/a.csv'", "'tables', 'a.csv'"])
def test_data_in_a_folder_that_a_users_file_names_count_with_it(folder, words):
    """Rows stood as they were when a table in a folder of the user's had changed."""
    (folder / "mine.py").write_text(
        f"from pathlib import Path\nTABLE = Path(__file__).parent.joinpath({words})\n"
        f"LONG = '{'long ' * 99}'\n"
    )
    (folder / "tables").mkdir()
    digests = []
    for name, text in (("a.csv", "1"), ("b.csv", "1"), ("a.csv", "2")):
        (folder / "tables" / name).write_text(text)
        digests.append(code_digest([folder / "mine.py"]))
    assert digests[0] == digests[1] != digests[2]


def test_code_is_the_same_wherever_it_lies_and_in_every_process(folder, tmp_path_factory):
    other = tmp_path_factory.mktemp("other")
    for path in folder.rglob("*.py"):
        (other / path.relative_to(folder)).parent.mkdir(exist_ok=True)
        (other / path.relative_to(folder)).write_text(path.read_text())
    code = (
        "import sys\nfrom pathlib import Path\n"
        "from airlight.reference.storage.code import code_digest, source_digest\n"
    )
    code += (
        "print(code_digest([Path(sys.argv[1])]), source_digest('airlight.reference.storage.store'))"
    )
    command = [sys.executable, "-c", code, str(other / "mine.py")]
    ran = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONPATH": ROOT, "PYTHONHASHSEED": "7"},
    )
    assert ran.stdout.split() == [
        code_digest([folder / "mine.py"]),
        source_digest("airlight.reference.storage.store"),
    ]


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("airlight.validation.papers.shadow_planes", "validation/scenes/fog.toml"),
        ("airlight.validation.papers.shadow_planes", "validation/papers/claims.toml"),
        ("airlight.validation.study.growth", "validation/study/studies/methods.toml"),
        ("airlight.validation.kernels.stability", "validation/certified/airlight_integral.csv"),
        ("airlight.validation.study.run", "realtime/numerics/blue_noise.npy"),
    ],
)
def test_the_data_that_code_reads_count_with_it(monkeypatch, name, file):
    """Figures of papers stood as they were when the fog of a scene was changed."""
    path, source = module._ROOT / file, module._source
    before = source_digest(name)
    monkeypatch.setattr(module, "_source", lambda each: source(each) + b"#" * (each == path))
    source_digest.cache_clear()
    after = source_digest(name)
    source_digest.cache_clear()
    assert after != before


#: Modules that compute by the kind of their results, and one on whose numbers each depends.
COMPUTED = {
    "quadrature": (ReferenceInputs.__module__, "airlight.reference.quadrature.intervals"),
    "volpath": (VolpathInputs.modules[0], "airlight.reference.scene.read"),
    "kernel-rays": (RayInputs.__module__, "airlight.analytic.panels"),
    "row": ("airlight.validation.study.run", "airlight.realtime.methods.ray_march"),
    "scene-checks": (CheckInputs.__module__, "airlight.validation.statistics.comparison"),
    "shader-driver": (DriverInputs.__module__, "airlight.realtime.export.text"),
}


def closure(name):
    """The names of all modules whose code is in the digest of a module."""
    modules, waiting = set(), [module._modules()[name]]
    while waiting:
        path = waiting.pop()
        if path not in modules:
            modules.add(path)
            waiting += module._imported(path, module._compiled(path, path.stat().st_mtime_ns)[1])
    parts = (path.relative_to(module._ROOT).with_suffix("").parts for path in modules)
    return {".".join(("airlight", *names)) for names in parts}


@pytest.mark.claim("report-kept")
def test_results_hang_on_the_code_that_computes_them_and_not_on_claims_of_papers():
    for kind, (name, needed) in COMPUTED.items():
        names = closure(name)
        assert needed in names, kind
        apart = (
            "airlight.validation.papers",
            "airlight.reports.commands",
            "airlight.reports.papers",
            "airlight.reports.tables",
        )
        assert not [each for each in names if each.startswith(apart)], kind


@pytest.mark.claim("report-kept")
@pytest.mark.parametrize("kind", ["quadrature", "row"])
def test_a_change_of_the_code_throws_results_away_and_a_comment_does_not(monkeypatch, kind):
    name, needed = COMPUTED[kind]
    file = module._ROOT.joinpath(*needed.split(".")[1:]).with_suffix(".py")
    compiled, source = module._compiled, module._source
    before = source_digest(name)

    def digest_with(change):
        monkeypatch.setattr(
            module, "_source", lambda path: source(path) + change if path == file else source(path)
        )
        monkeypatch.setattr(
            module,
            "_compiled",
            lambda path, at: (compiled.__wrapped__ if path == file else compiled)(path, at),
        )
        source_digest.cache_clear()
        digest = source_digest(name)
        source_digest.cache_clear()
        return digest

    assert digest_with(b"\n# A comment.\n") == before
    assert digest_with(b"\n_MORE = 1e-3\n") != before
