# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a result is found again for the same inputs and the same code, and for no others."""

import math
import os
import subprocess
import sys
import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields, is_dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from numpy.typing import NDArray

from airlight.analytic.clock import Spent
from airlight.reference.quadrature.reference import ReferenceInputs
from airlight.reference.scene.model import Model
from airlight.reference.storage import store as module
from airlight.reference.storage.cache import cache_folder
from airlight.reference.storage.scene_digest import scene_content
from airlight.reference.storage.store import (
    Content,
    Inputs,
    add_spent,
    counted,
    fresh_results,
    fresh_since,
    is_kept,
    keep,
    load,
    store,
    stored,
)
from airlight.reports.machine.driver_check import DriverInputs
from airlight.reports.report.others import PaperInputs, ScalingInputs, StabilityInputs
from airlight.validation.estimates.monte_carlo import (
    CloudPathInputs,
    SingleScatterInputs,
    VolpathInputs,
)
from airlight.validation.kernels.rays import RayInputs, table
from airlight.validation.study.configuration import Configuration
from airlight.validation.study.keys import CellReference, RowInputs
from airlight.validation.study.reference import SampledInputs
from airlight.validation.study.scene_images import ImageInputs
from airlight.validation.study.scene_rows import CellInputs, FlipInputs, TimesInputs
from airlight.validation.study.study import Cell, Checks, Measure, standard_study
from airlight.validation.study.study_scene import CheckInputs, MultipleInputs
from airlight.validation.timing import Timing
from tests.helpers.scenes import tiny_scene

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


@dataclass(frozen=True)
class Page(Inputs):
    kind = "page"
    name: Any
    value: float = 1.0


def page(inputs: Page, calls: list[str]):
    def compute() -> Value:
        calls.append(inputs.name)
        array = np.full((2, 1), 0.1, np.float32)
        parts = {"x": Inner((1, 0.1 * 3)), "y": Inner((2, 2.0), array)}
        return Value(np.full(3, inputs.value), ["a"], parts, math.nan)

    return stored(inputs, compute, Value)


@pytest.mark.claim("report-kept")
def test_what_was_computed_is_found_again_and_fresh_results_are_not_older_than_the_run():
    calls: list[str] = []
    inputs = Page("a")
    first, second = (page(inputs, calls) for _ in range(2))
    assert (len(calls), first.loaded, second.loaded) == (1, False, True)
    assert (first.spent, first.made) == (second.spent, second.made)
    for value in (first.value, second.value):
        np.testing.assert_array_equal(value.a, np.ones(3))
        assert (value.words, value.parts["x"], value.parts["y"].pair) == (
            ["a"],
            Inner((1, 0.1 * 3)),
            (2, 2.0),
        )
        assert (value.parts["y"].array.dtype, value.parts["y"].array.shape) == (np.float32, (2, 1))
        assert math.isnan(value.number)
    with fresh_results(time.time()):
        assert (is_kept(inputs.key), load(inputs.key)) == (False, None)
        assert not page(inputs, calls).loaded
        assert page(inputs, calls).loaded  # computed in this run
        # Another process of the run does the same.
        code = f"from airlight.reference.storage.store import *\nprint(is_kept('{inputs.key}'), fresh_since())"
        environment = os.environ | {"PYTHONPATH": str(Path(__file__).resolve().parents[3])}
        ran = subprocess.run(
            [sys.executable, "-c", code],
            capture_output=True,
            text=True,
            check=True,
            env=environment,
        )
        assert ran.stdout.split() == ["True", repr(fresh_since())]
    assert fresh_since() is None
    assert page(inputs, calls).made > first.made
    assert len(calls) == 2


def test_what_is_not_worth_it_is_not_cached():
    for status in ("done", "refused"):
        result = stored(
            Page(status), lambda status=status: status, str, lambda value: value == "done"
        )
        assert result.value == status
    assert (is_kept(Page("done").key), is_kept(Page("refused").key)) == (True, False)


def test_another_process_may_have_computed_a_value_and_parts_of_it_go_once_it_is_there():
    inputs = Page("a")
    store(f"{inputs.key}/part", {"a": 1}, Spent(1.0, 1.0))
    keep(inputs, "b", Spent(100.0, 50.0), str)
    again = stored(inputs, lambda: "c", str)
    assert (again.value, again.loaded, again.seconds) == ("b", True, 100.0)
    assert load(f"{inputs.key}/part") is None


def test_times_are_those_of_computing_and_never_of_loading():
    """The time of a result includes the original times of the cached results that it uses,
    and of no other thread's.
    """
    store("reference-a", {"a": 1}, Spent(100.0, 150.0))

    def from_the_reference() -> int:
        load("reference-a")
        add_spent(Spent(1000.0, 0.0))  # in another process
        with ThreadPoolExecutor(1) as pool:
            pool.submit(stored, Page("other"), lambda: load("reference-a") is None, bool).result()
        return 2

    made = stored(Page("m"), from_the_reference, int)
    assert made.spent.seconds == pytest.approx(1100.0, abs=5.0)
    assert made.spent.processor == pytest.approx(150.0, abs=5.0)
    with counted() as outer, counted() as inner:
        assert stored(Page("m"), from_the_reference, int).spent == made.spent
    for ledger in (inner, outer):
        assert ledger.spent().seconds == pytest.approx(made.spent.seconds, abs=5.0)


# --- keys -----------------------------------------------------------------------------------------

CHOSEN = Configuration("ray-march", None, (("steps", 4), ("map", 64)))
REFERENCE = ReferenceInputs(Content("a"), 32, 1.0, "centre", 16)
CELL = Cell(
    "hall a", (32, 24), ("medium.sigma_t=0.1",), CHOSEN, Measure(timed_size=(8, 6)), ("map", 64.0)
)
MACHINE = {"host": "a"}
#: by term, words that are not those of the physical equation
TERMS = {
    "light-path": "off",
    "camera-path": "0.5",
    "law": "softened:1",
    "range": "quartic:8",
    "spot": "cosine-smooth",
    "phase": "none",
    "depth": "axis",
    "ends": "planes:0:60",
    "fade": "48:60",
    "source": "constant:1",
    "cap": "0.5",
    "lobe": "8",
    "ambient": "1",
    "lit": "0.01",
    "lamps": "2",
    "suns": "8",
    "surface.light-path": "off",
    "surface.camera-path": "off",
    "surface.law": "softened:1",
    "surface.factor": "2",
}
BATCHES = (Content("a"), 16, 2, ("1", "2-3"), np.ones((2, 3), np.int64))


def every_inputs(tmp_path) -> list[Inputs]:
    """An example of each kind of inputs."""
    (tmp_path / "a.exr").write_text("1")
    timing = Timing(1.0, 0.9, 1.1, 5)
    rays = table(
        np.array(["hg"]),
        np.ones(1),
        foot=np.ones(1),
        height=np.ones(1),
        x0=np.zeros(1),
        x1=np.ones(1),
        sigma_t=np.ones(1),
        tags=np.array(["near"]),
    )
    code = (Content("a"),)
    reference = CellReference("hall a", (32, 24), ("medium.sigma_t=0.1",))
    return [
        REFERENCE,
        SampledInputs(Content("a")),
        *(kind(*BATCHES) for kind in (SingleScatterInputs, VolpathInputs, CloudPathInputs)),
        RayInputs(rays),
        DriverInputs("llvmpipe"),
        RowInputs(
            reference, CHOSEN, code, CELL.measure, "ab", (("mitsuba", "3.9.1"),), "llvm_ad_rgb"
        ),
        CheckInputs(Content("a"), Checks(patience=1.0), 16),
        MultipleInputs(Content("a"), 8, 4),
        CellInputs(REFERENCE, CELL, code, MACHINE),
        TimesInputs((CELL,), (code,), MACHINE),
        FlipInputs(np.ones((2, 3, 3)), np.ones((2, 3, 3)), "1"),
        ImageInputs(
            REFERENCE, "hall a", (32, 24), "mine", tmp_path / "a.exr", (timing, "card"), Model()
        ),
        StabilityInputs(100, {"mine.py:k": code}, MACHINE),
        ScalingInputs("map", standard_study("scaling"), MACHINE),
        PaperInputs("maps", "ab", MACHINE),
    ]


def changed(value: Any) -> list[Any]:
    """Return other values in the place of one: one for each number, word and array in it."""
    if isinstance(value, Content):
        return [Content(f"{value.digest} another")]
    if isinstance(value, Model):
        assert len(TERMS) == len(fields(value)) - 1  # all but the name
        source = {"source": TERMS["source"]}
        return [
            Model.of({term: words} | (source if term in ("cap", "lobe") else {}))
            for term, words in TERMS.items()
        ]
    if is_dataclass(value):
        names = [each.name for each in fields(value)]
        return [
            replace(value, **{name: other})
            for name in names
            for other in changed(getattr(value, name))
        ]
    if isinstance(value, bool):
        return [not value]
    if isinstance(value, int | float | str):
        return [value + type(value)(1)]
    if isinstance(value, np.ndarray):
        words = np.char.add(value, "a") if value.dtype.kind in "US" else value + 1
        return [words, value[:0], value.reshape(-1, 1)]
    if isinstance(value, Mapping):
        others = [{**value, name: other} for name in value for other in changed(value[name])]
        return [*others, {f"{name} another": each for name, each in value.items()} | {"and": 1}]
    if isinstance(value, tuple):
        inside = [
            (*value[:at], other, *value[at + 1 :])
            for at in range(len(value))
            for other in changed(value[at])
        ]
        return [*inside, (*value, 1)]
    if isinstance(value, Path):
        other, renamed = value.with_name("b" + value.name), value.parent / "other" / value.name
        other.write_text(value.read_text())
        renamed.parent.mkdir(exist_ok=True)
        renamed.write_text("2")
        return [other, renamed]
    assert value is None, value
    return [1]


@pytest.mark.claim("report-kept")
def test_every_field_of_every_kind_of_inputs_is_in_its_key(tmp_path):
    """Rows stood beside a reference of more light samples, and figures of
    papers beside other scenes.
    """
    examples = every_inputs(tmp_path)
    assert {type(each) for each in examples} == subclasses(Inputs) - {Page}
    for inputs in examples:
        others = changed(inputs)
        keys = [each.key for each in (inputs, *others)]
        assert None not in keys
        assert len(set(keys)) == len(keys) > len(fields(inputs)), type(inputs).__name__
        assert replace(inputs).key == keys[0]


def subclasses(kind: type) -> set[type]:
    """All kinds of inputs that name a kind of file, and so are cached."""
    below = {each for child in kind.__subclasses__() for each in subclasses(child)}
    return below | ({kind} if "kind" in vars(kind) else set())


def test_a_model_counts_by_its_terms_and_not_by_its_name():
    named = Model(law="softened:1", name="engine 1.0")
    plain = replace(named, name="")
    assert replace(REFERENCE, model=named).key == replace(REFERENCE, model=plain).key
    inputs = SingleScatterInputs(*BATCHES)
    assert replace(inputs, model=replace(Model(), name="engine")).key == inputs.key


def test_the_code_of_inputs_within_inputs_counts(monkeypatch, tmp_path):
    """A row hangs on the code that computes its reference."""
    row = next(each for each in every_inputs(tmp_path) if isinstance(each, CellInputs))
    before, digest = row.key, module.source_digest
    monkeypatch.setattr(
        module, "source_digest", lambda *names: digest(*names) + "x" * ("quadrature" in names[0])
    )
    assert replace(row).key != before


class Kind(Enum):
    ONE = 1
    TWO = 2


def test_a_key_tells_types_apart_and_files_by_their_content(tmp_path):
    (tmp_path / "x").write_text("1")
    (tmp_path / "y").write_text("1")
    values = [
        1,
        2,
        1.5,
        True,
        "1",
        None,
        (1,),
        ("1",),
        {"x": (1, 2.5)},
        Kind.ONE,
        Kind.TWO,
        Inner((1, 2.0)),
    ]
    values += [
        np.zeros(3),
        np.zeros((3, 1)),
        np.zeros(3, np.float32),
        np.float32(1),
        tmp_path / "x",
        tmp_path / "y",
    ]
    keys = [Page(value).key for value in values]
    assert len(set(keys)) == len(keys)
    assert Page({"a": 1, "b": 2}).key == Page({"b": 2, "a": 1}).key
    (tmp_path / "x").write_text("2")
    assert Page(tmp_path / "x").key not in keys


@pytest.mark.parametrize(
    "value",
    [
        {"a"},
        frozenset("a"),
        [1],
        object(),
        print,
        b"a",
        {1: "a"},
        np.array([object()]),
        int,
        mi,
        1j,
    ],
)
def test_what_has_no_content_for_a_key_is_refused_and_not_spelt(value):
    with pytest.raises(TypeError, match="cannot be part of a key"):
        _ = Page((1, {"b": value})).key


def test_a_result_of_a_scene_that_has_no_digest_is_computed_and_not_cached(variant):
    texture = {"type": "bitmap", "bitmap": mi.Bitmap(np.ones((2, 2, 3), np.float32))}
    scene = mi.load_dict(
        tiny_scene(ball={"type": "sphere", "bsdf": {"type": "diffuse", "reflectance": texture}})
    )
    inputs, calls = SampledInputs(scene_content(scene)), list[int]()

    def compute() -> int:
        calls.append(1)
        return len(calls)

    results = [stored(inputs, compute, int) for _ in range(2)]
    assert [(each.value, each.loaded) for each in results] == [(1, False), (2, False)]
    # nor what hangs on it
    assert CellInputs(replace(REFERENCE, scene=inputs.scene), CELL, (), MACHINE).key is None
    assert not list(cache_folder().glob("*"))
