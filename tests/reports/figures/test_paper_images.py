# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the pictures of the papers are drawn from our scenes, and show what their captions say."""

import numpy as np
import pytest

from reference.storage.exr import layer, read_exr
from reports.figures import paper_images
from reports.figures.files import read_data

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(variant, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pictures")
    paper_images.compute(folder, quick=True)
    return folder


def pixels(folder, row):
    return np.asarray(layer(read_exr(folder / row["file"]), "total", folder / row["file"]))


def test_fog_adds_light_and_shadows_take_some_away(folder):
    rows = read_data(folder, "paper-images")
    assert [row["kind"] for row in rows] == ["light"] * 4 + ["side"] * 2
    plain, scattered, shadowed, two, *_ = (pixels(folder, row).mean() for row in rows)
    assert scattered > 1.2 * shadowed  # shafts of shadow
    assert shadowed != plain
    assert two > 0
    assert len({row["exposure"] for row in rows[:3]}) == 1


def test_quads_are_small_at_edges_and_as_many_by_both_filters(folder):
    ours, plain = (pixels(folder, row)[..., 0] for row in read_data(folder, "paper-images")[4:])
    assert ours.min() == plain.min() == 1
    assert ours.max() >= 8
    assert not np.array_equal(ours, plain)
