# SPDX-License-Identifier: BSD-3-Clause
"""Faults that real engines had, in images of a renderer in NumPy that shares no code with the hypotheses."""

import importlib
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from reference.scene.read import read_truth
from reference.storage.exr import Image
from validation.engine.diagnose import diagnose_image
from validation.engine.prediction import SceneLight
from validation.scenes.loading import load_scene

TOOLS = Path(__file__).resolve().parents[3] / "docs/tools"
sys.path.insert(0, str(TOOLS))
numpy_faults = importlib.import_module("numpy_faults")
sys.path.remove(str(TOOLS))
SIZE = (64, 48)


@pytest.fixture(scope="module")
def scenes(variant, tmp_path_factory):
    """By what is right, the scene that the renderer shows, and its light, which all images share."""

    def scene(engine):
        path = tmp_path_factory.mktemp("engine") / "scene.xml"
        path.write_text(numpy_faults.scene_xml(engine))
        loaded = load_scene(str(path), SIZE)
        return loaded, SceneLight(read_truth(loaded.scene))

    return {engine: scene(engine) for engine in (numpy_faults.RIGHT, numpy_faults.LAYERED)}


def named(scenes, number, noise=0.01):
    engine, planted, _, given = numpy_faults.CASES[number]
    loaded, light = scenes[engine]
    image = numpy_faults.rendered(replace(engine, **given), area=False, noise=noise, seed=number)
    return planted, diagnose_image(Image({"total": image}), loaded, light=light)


@pytest.mark.slow
@pytest.mark.claim("diagnosis-engines")
@pytest.mark.parametrize("number", range(len(numpy_faults.CASES)))
def test_what_is_set_wrong_in_an_engine_is_named_or_placed(scenes, number):
    planted, said = named(scenes, number)
    assert said.first == planted, [row.words for row in said.ranked]
    assert said.place == "" or planted == "unexplained"


@pytest.mark.claim("diagnosis-engines")
def test_the_fog_alone_is_too_bright(scenes):
    planted, said = named(scenes, 2)
    assert said.first == planted == "fog-factor"
    assert said.ranked[0].parameter == pytest.approx(8.3, rel=1e-2)
    assert said.rest.startswith("noise")
    assert "which is noise" in "\n".join(said.lines)
