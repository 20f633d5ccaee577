# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the tables of Biri and Billeter at a small size: rates, errors, and the
reason where there is neither.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.papers import billeter_tables, biri_tables
from airlight.validation.papers.billeter_tables import attempted, frame_within, sampled, table_scene


def test_a_small_table_of_biri(variant, monkeypatch):
    entries = {"two-pens": biri_tables.ENTRIES["two-pens"]}
    monkeypatch.setattr(biri_tables, "ENTRIES", entries)
    figures = biri_tables.biri_tables(scale=0.04, seconds=0.0)
    assert set(figures) == {"two-pens fps", "two-pens ours fps", "median error"}
    assert 0 < figures["median error"] < 0.2  # an 8-bit buffer and the vertices' Gamma


def test_sizes_are_whole_tiles():
    assert biri_tables._scaled((800, 600), 1.0) == (800, 600)
    assert biri_tables._scaled((800, 600), 0.051) == (40, 32)
    assert biri_tables._scaled((800, 600), 0.01) == (16, 16)


def test_images_of_billeter_have_their_errors_or_the_reason(variant, monkeypatch):
    chosen = {name: billeter_tables.IMAGES[name] for name in ("Fig. 6a", "Fig. 6b")}
    monkeypatch.setattr(billeter_tables, "IMAGES", chosen)
    monkeypatch.setattr(billeter_tables, "_SECONDS", 0.0)
    figures = billeter_tables._images((16, 12))
    assert 0 < figures["Fig. 6b error"] < figures["Fig. 6a error"] < 0.1
    assert figures["Fig. 6a fps"].value > 0
    monkeypatch.setattr(billeter_tables, "_LONGEST", 0.0)
    assert set(billeter_tables._images((16, 12)).values()) == {
        "not measured: a frame takes 0 s, more than the limit of 0 s"
    }


def test_one_pixel_in_a_stride_is_compared_from_the_middle_of_the_first_block():
    image = np.arange(7 * 10).reshape(7, 10)
    assert (sampled(image, 3) == [[11, 14, 17], [41, 44, 47]]).all()
    assert (sampled(image, 1) == image).all()


def test_the_colonnade_of_table_1_has_a_spot_in_place_of_its_lamp(variant):
    (light,) = read_scene(table_scene("colonnade", (8, 6))).lights
    assert np.degrees(np.arccos(float(np.array(light.cos_cutoff).ravel()[0]))) == pytest.approx(
        56.7, abs=1e-3
    )


def test_what_takes_too_long_or_fails_is_said(monkeypatch):
    monkeypatch.setattr(
        billeter_tables, "timed", lambda work: (work(), SimpleNamespace(seconds=31.0))
    )
    monkeypatch.setattr(billeter_tables, "render_frame", lambda renderer: renderer)
    with pytest.raises(TimeoutError, match="a frame takes 31 s, more than the limit of 30 s"):
        frame_within("frame")
    monkeypatch.setattr(
        billeter_tables, "timed", lambda work: (work(), SimpleNamespace(seconds=29.0))
    )
    assert frame_within("frame") == "frame"

    def fails(error):
        def work():
            raise error

        return work

    assert attempted(("a", "b"), fails(InputError("why"))) == {
        "a": "not measured: why",
        "b": "not measured: why",
    }
    assert attempted(("a",), fails(MemoryError())) == {"a": "not measured: out of memory"}
    assert attempted(("a",), lambda: {"a": 1.0}) == {"a": 1.0}
