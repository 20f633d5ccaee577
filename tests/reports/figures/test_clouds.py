# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the figures of clouds are drawn from what the studies gave, twice to the same bytes."""

import numpy as np

import validation.papers.clouds as clouds
import validation.papers.slab as slab
from reports.figures import cloud_images, cloud_transport
from reports.figures.files import plot, read_data
from validation.scenes.loading import LoadedScene


def drawn_twice(module, folder):
    drawn = []
    for _ in range(2):
        plot(module, folder, column="single")
        drawn.append((folder / f"{module.NAME}.png").read_bytes())
    return drawn


def test_light_by_direction_is_drawn_from_the_study(monkeypatch, tmp_path):
    curves = [
        {"thickness": thickness, "depth": depth, "orders": orders, "angle": [2.5, 47.5, 92.5, 177.5]}
        | {way: [0.1, 0.2, 0.0, 0.3] for way in ("exact", "table", "fit")}
        for thickness, depth in ((100.0, 0.0), (100.0, 100.0), (1000.0, 0.0))
        for orders in ("2", "3-4", "31-inf")
    ]
    monkeypatch.setattr(slab, "transport_curves", lambda: curves)
    cloud_transport.compute(tmp_path)
    rows = read_data(tmp_path, "cloud-transport")
    assert len(rows) == 9 * 4
    assert [row["exact"] for row in rows[:4]] == ["0.1", "0.2", "0", "0.3"]
    first, second = drawn_twice(cloud_transport, tmp_path)
    assert first == second


def test_clouds_stand_above_the_truth_in_the_same_exposure(monkeypatch, tmp_path):
    def pair(loaded, samples, progress):
        assert loaded.name in ("stratocumulus", "cumulus", "ring", "two-lobes")
        return clouds.Pair(np.full((18, 24, 3), 0.5), np.full((18, 24, 3), 0.25), np.zeros((18, 24, 3)))

    monkeypatch.setattr(clouds, "pair_of", pair)
    monkeypatch.setattr(clouds, "shown", lambda name, size: LoadedScene(name, None, "", ""))
    cloud_images.compute(tmp_path, quick=True)
    rows = read_data(tmp_path, "cloud-images")
    assert [row["way"] for row in rows] == ["collectors"] * 4 + ["light paths"] * 4
    assert len({row["exposure"] for row in rows}) == 1
    first, second = drawn_twice(cloud_images, tmp_path)
    assert first == second
