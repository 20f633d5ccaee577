# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a worker that lives for several runs computes what a scene's file has now."""

from types import SimpleNamespace

import pytest

pytest.importorskip("distributed", reason="the extra `sweep` is not installed")

from airlight.reports.cluster import cells, references
from airlight.validation.scenes.changes import changeable
from airlight.validation.study.configuration import Configuration
from airlight.validation.study.study import Cell
from tests.helpers.scenes import scene_xml

SIGMA_T = (0.31, 0.62)


def sigma_t(scene):
    return changeable(scene)["medium.sigma_t"].value[0]


@pytest.fixture
def image(variant, tmp_path):
    """Return a function that writes the file of a cell with another extinction."""
    path = tmp_path / "fog.xml"

    def written(value):
        path.write_text(scene_xml(fog=f'<float name="sigma_t" value="{value}"/>'))
        return Cell(str(path), (8, 6), (), Configuration("reference"))

    return written


def test_the_reference_of_a_cell(image, monkeypatch):
    monkeypatch.setattr(cells, "cell_reference", lambda loaded: sigma_t(loaded.scene))
    assert [cells.reference_of(image(each)) for each in SIGMA_T] == pytest.approx(SIGMA_T)


def test_a_batch(image, monkeypatch):
    """As `tracing` sends it, and a worker does it."""
    monkeypatch.setattr(
        references, "batch_tracer", lambda scene, *_, **__: (None, lambda seed: sigma_t(scene))
    )
    monkeypatch.setattr(
        references,
        "_done",
        lambda _, groups: (
            (task.name, task.function(*task.arguments)) for group in groups for task in group.tasks
        ),
    )
    cluster = SimpleNamespace(scheduler_info=lambda n_workers: {"workers": {}})

    def traced(value):
        bring, _ = references.tracing(cluster, image(value), "volpath", samples=1)
        return next(iter(bring([1])))[0]

    assert [traced(each) for each in SIGMA_T] == pytest.approx(SIGMA_T)


def test_a_reference_of_another_file_is_not_kept(image, monkeypatch):
    """A worker of another machine may have an older file under the name."""
    kept, image_here = list[str](), image(SIGMA_T[0])
    monkeypatch.setattr(references, "is_kept", lambda key: False)
    monkeypatch.setattr(references, "keep", lambda inputs, *_: kept.append(inputs.key))

    def answer(key):
        monkeypatch.setattr(
            references, "_done", lambda *_: iter([("reference 0", (key, None, None))])
        )
        references.bring_references(None, [image_here])

    answer("quadrature-of-another-file")
    assert not kept
    content = references.scene_content(references.load_cell(image_here).scene)
    inputs = references.ReferenceInputs(content)
    assert inputs.key is not None
    answer(inputs.key)
    assert kept == [inputs.key]
