# SPDX-License-Identifier: BSD-3-Clause
"""Claim: what is kept is found again until its arguments or the code that computes it change, and no longer."""

import inspect
import math
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from analytic.clock import Spent
from reference.monte_carlo.volpath import volpath_batch
from reference.storage import kept as module
from reference.storage.cache import cache_folder
from reference.storage.kept import (
    add_spent,
    code_digest,
    fresh_results,
    fresh_since,
    kept,
    key_of,
    load,
    source_digest,
    stopwatch_from_nothing,
    store,
)
from reports.machine.driver_check import error_of_device
from tests.helpers.scenes import tiny_scene
from validation.estimates.quadrature import reference_image
from validation.kernels.rays import _reference
from validation.study.run import run
from validation.study.scene import check_reference

pytestmark = pytest.mark.usefixtures("own_cache")


@dataclass(frozen=True)
class Inner:
    pair: tuple[int, float]
    array: NDArray[np.float32] | None = None


@dataclass(frozen=True)
class Value:
    a: NDArray[np.float64]
    words: list[str]
    parts: dict[str, Inner]
    number: float


@kept("page")
def page(name, value=1.0, *, calls=None) -> Value:
    if calls is not None:
        calls.append(name)
    array = np.full((2, 1), 0.1, np.float32)
    return Value(np.full(3, value), ["a"], {"x": Inner((1, 0.1 * 3)), "y": Inner((2, 2.0), array)}, math.nan)


@pytest.mark.claim("report-kept")
def test_what_was_computed_is_found_again_and_fresh_results_are_not_older_than_the_run():
    calls: list[str] = []
    first, second = (page.result("a", calls=calls) for _ in range(2))
    assert (len(calls), first.loaded, second.loaded) == (1, False, True)
    assert (first.spent, first.made) == (second.spent, second.made)
    for value in (first.value, second.value):
        np.testing.assert_array_equal(value.a, np.ones(3))
        assert (value.words, value.parts["x"], value.parts["y"].pair) == (["a"], Inner((1, 0.1 * 3)), (2, 2.0))
        assert (value.parts["y"].array.dtype, value.parts["y"].array.shape) == (np.float32, (2, 1))
        assert math.isnan(value.number)
    key = page.key("a")
    with fresh_results(time.time()):
        assert (page.is_kept("a"), load(key)) == (False, None)
        assert not page.result("a", calls=calls).loaded
        assert page.result("a", calls=calls).loaded  # computed in this run
        # Another process of the run does the same.
        code = f"from reference.storage.kept import *\nprint(is_kept('{key}'), fresh_since())"
        ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=_with_root())
        assert ran.stdout.split() == ["True", repr(fresh_since())]
    assert fresh_since() is None
    assert page.result("a", calls=calls).made > first.made
    assert len(calls) == 2


def test_what_decides_a_value_is_in_its_key_and_what_does_not_is_not():
    assert page.key("a") == page.key("a", 1.0) == page.key(name="a", value=1.0) == page.key("a", calls=[])
    assert len({page.key("a"), page.key("b"), page.key("a", 2.0)}) == 3


def test_what_is_not_worth_it_is_not_kept():
    @kept("page", worth=lambda row: row["status"] == "done")
    def row(status) -> dict[str, str]:
        return {"status": status}

    assert [row.result(status).value["status"] for status in ("done", "refused")] == ["done", "refused"]
    assert (row.is_kept("done"), row.is_kept("refused")) == (True, False)


def test_another_process_may_have_computed_a_value_and_parts_of_it_go_once_it_is_there():
    store(f"{page.key('a')}/part", {"a": 1}, Spent(1.0, 1.0))
    page.keep(page("b"), Spent(100.0, 50.0), "a")
    assert (page.result("a").loaded, page.result("a").seconds) == (True, 100.0)
    assert load(f"{page.key('a')}/part") is None


def _with_root():
    return os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[3])}


def test_times_are_those_of_computing_and_never_of_loading():
    """The time of a result includes the original times of the cached results that it uses."""
    store("reference-a", {"a": 1}, Spent(100.0, 150.0))

    @kept("method")
    def from_the_reference() -> int:
        load("reference-a")
        add_spent(Spent(1000.0, 0.0))  # in another process
        return 2

    made = from_the_reference.result()
    assert made.spent.seconds == pytest.approx(1100.0, abs=5.0)
    assert made.spent.processor == pytest.approx(150.0, abs=5.0)
    spent = stopwatch_from_nothing()
    assert from_the_reference.result().spent == made.spent
    assert spent().seconds == pytest.approx(made.spent.seconds, abs=5.0)


@dataclass(frozen=True)
class Settings:
    nodes: int
    name: str = "x"


def test_a_key_has_every_argument_in_it(tmp_path):
    (tmp_path / "x").write_text("1")
    (tmp_path / "y").write_text("1")
    keys = [
        key_of("page", kept, **arguments)
        for arguments in (
            {"a": 1},
            {"a": 2},
            {"b": 1},
            {"a": "1"},
            {"a": 1, "b": None},
            {"a": Settings(1)},
            {"a": Settings(2)},
            {"a": np.zeros(3)},
            {"a": np.zeros((3, 1))},
            {"a": np.zeros(3, np.float32)},
            {"a": {"x": (1, 2.5)}},
            {"a": tmp_path / "x"},
            {"a": tmp_path / "y"},
        )
    ]
    assert len(set(keys)) == len(keys)
    assert key_of("page", kept, a=1) != key_of("row", kept, a=1) != key_of("row", a=1)
    assert key_of("page", kept, a=1, b=(2,)) == key_of("page", kept, b=(2,), a=1)
    before = key_of("page", kept, a=tmp_path / "x")
    (tmp_path / "x").write_text("2")
    assert key_of("page", kept, a=tmp_path / "x") != before  # the content of a file, not its name alone


@pytest.mark.parametrize("value", [{"a"}, frozenset("a"), object(), print, b"a", {1: "a"}, np.array([object()]), int])
def test_what_has_no_content_for_a_key_is_refused_and_not_spelt(value):
    with pytest.raises(TypeError, match="cannot be part of a key"):
        key_of("page", kept, a=(1, {"b": value}))


def test_a_value_of_a_scene_that_has_no_digest_is_computed_and_not_kept(variant):
    texture = {"type": "bitmap", "bitmap": mi.Bitmap(np.ones((2, 2, 3), np.float32))}
    scene = mi.load_dict(tiny_scene(ball={"type": "sphere", "bsdf": {"type": "diffuse", "reflectance": texture}}))
    calls: list[str] = []
    results = [page.result(scene, calls=calls) for _ in range(2)]
    assert (page.key(scene), page.is_kept(scene), len(calls)) == (None, False, 2)
    assert not any(result.loaded for result in results)
    assert not list(cache_folder().glob("*"))


# --- source code -----------------------------------------------------------------------------------------------------

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


def test_code_is_the_same_wherever_it_lies_and_in_every_process(folder, tmp_path_factory):
    other = tmp_path_factory.mktemp("other")
    for path in folder.rglob("*.py"):
        (other / path.relative_to(folder)).parent.mkdir(exist_ok=True)
        (other / path.relative_to(folder)).write_text(path.read_text())
    code = "import sys\nfrom pathlib import Path\nfrom reference.storage.kept import *\n"
    code += "print(code_digest([Path(sys.argv[1])]), source_digest(key_of))"
    command = [sys.executable, "-c", code, str(other / "mine.py")]
    ran = subprocess.run(
        command, capture_output=True, text=True, check=True, env=_with_root() | {"PYTHONHASHSEED": "7"}
    )
    assert ran.stdout.split() == [code_digest([folder / "mine.py"]), source_digest(key_of)]


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("validation.papers.shadow_planes", "validation/scenes/fog.toml"),
        ("validation.papers.shadow_planes", "validation/papers/claims.toml"),
        ("validation.study.growth", "validation/study/studies/methods.toml"),
        ("validation.kernels.stability", "validation/certified/airlight_integral.csv"),
        ("validation.study.run", "realtime/numerics/blue_noise.npy"),
    ],
)
def test_the_data_that_code_reads_count_with_it(monkeypatch, name, file):
    """Figures of papers stood as they were when the fog of a scene was changed."""
    path, source = module._ROOT / file, module._source
    before = source_digest(name)
    monkeypatch.setattr(module, "_source", lambda each: source(each) + b"#" * (each == path))
    module._digest_of.cache_clear()
    after = source_digest(name)
    module._digest_of.cache_clear()
    assert after != before


#: Cached functions by kind, and a module on whose numbers each depends.
COMPUTED = {
    "quadrature": (reference_image, "reference.quadrature.segments"),
    "volpath": (volpath_batch, "reference.scene.read"),
    "kernel-rays": (_reference, "analytic.panels"),
    "row": (run, "realtime.methods.ray_march"),
    "scene-checks": (check_reference, "validation.statistics.comparison"),
    "shader-driver": (error_of_device, "realtime.export.text"),
}


def closure(function):
    """The names of all modules whose code is in the digest of a function."""
    seen, waiting = set(), [Path(inspect.getfile(inspect.unwrap(function)))]
    while waiting:
        path = waiting.pop().resolve()
        if path not in seen:
            seen.add(path)
            waiting += module._imported(path, module._compiled(path, path.stat().st_mtime_ns)[1])
    return {".".join(path.relative_to(module._ROOT).with_suffix("").parts) for path in seen}


@pytest.mark.claim("report-kept")
def test_what_is_kept_hangs_on_the_code_that_computes_it_and_not_on_claims_of_papers():
    for kind, (function, needed) in COMPUTED.items():
        names = closure(function)
        assert needed in names, kind
        apart = ("validation.papers", "reports.commands", "reports.papers", "reports.tables")
        assert not [name for name in names if name.startswith(apart)], kind


@pytest.mark.claim("report-kept")
@pytest.mark.parametrize("kind", ["quadrature", "row"])
def test_a_change_of_the_code_throws_results_away_and_a_comment_does_not(monkeypatch, kind):
    function, needed = COMPUTED[kind]
    file = module._ROOT.joinpath(*needed.split(".")).with_suffix(".py")
    compiled, source = module._compiled, module._source
    before = key_of(kind, function)

    def key_with(change):
        monkeypatch.setattr(module, "_source", lambda path: source(path) + change if path == file else source(path))
        monkeypatch.setattr(
            module,
            "_compiled",
            lambda path, at: (compiled.__wrapped__ if path == file else compiled)(path, at),
        )
        module._digest_of.cache_clear()
        key = key_of(kind, partial(function))
        module._digest_of.cache_clear()
        return key

    assert key_with(b"\n# A comment.\n") == before
    assert key_with(b"\n_MORE = 1e-3\n") != before
