# SPDX-License-Identifier: BSD-3-Clause
"""Results of the Python API: frozen, arrays for NumPy, HTML and PNG for a notebook; from made-up numbers, no scene."""

import dataclasses

import numpy as np
import pytest
from PIL import Image as Picture

from analytic.errors import InputError
from reference.storage.exr import Image, read_exr
from reports.api.compare import compare
from reports.api.results import Reference, Rendering, sealed
from reports.studies.methods import MethodsStudy
from validation.study.row import Row


def layered(scale=1.0, dtype=np.float32, **more):
    ramp = scale * np.linspace(0.1, 1.0, 4 * 6 * 3, dtype=dtype).reshape(4, 6, 3)
    layers = {"airlight": ramp, "surface": np.full((4, 6, 3), 0.25, dtype)} | more
    return Image(layers, np.full((4, 6), 2.0, dtype), {"airlight:scene": "made-up"})


def rendering(scale=1.0, dtype=np.float32, **fields):
    made = {"kernel": None, "parameters": {"steps": 3}, "precision": "single", "plan": {}, "label": "slow (steps=3)"}
    image = sealed(layered(scale, dtype))
    return Rendering(scene="<made & up>", image=image, method="slow", **(made | fields))


def reference(**more):
    image = sealed(layered(dtype=np.float64, **more))
    return Reference(scene="<made & up>", image=image, estimator="quadrature", relative_error=1e-9)


RESULTS = {"rendering": rendering, "reference": reference, "comparison": lambda: compare(reference(), rendering(1.01))}


@pytest.mark.claim("results-are-frozen")
@pytest.mark.parametrize("name", RESULTS)
def test_results_are_frozen_and_so_are_their_arrays(name):
    result = RESULTS[name]()
    for field in dataclasses.fields(result):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(result, field.name, None)
    with pytest.raises(ValueError, match="read-only"):
        np.asarray(result)[0] = 0
    own = np.array(result)
    own[0] = 0  # one's own


@pytest.mark.parametrize("show", [Reference.text, Reference._repr_html_], ids=["terminal", "notebook"])
def test_a_quadrature_of_an_area_light_says_where_its_standard_errors_come_from(show):
    """Its header has a number of batches, but no samples a pixel and no seeds: it traced nothing."""
    image = layered(dtype=np.float64, airlight_se=np.full((4, 6, 3), 1e-3))
    image.attributes["airlight:batches"] = 8
    shown = show(Reference(scene="panel", image=sealed(image), estimator="quadrature", relative_error=3e-3))
    assert "standard errors from 8 independent sets of light samples" in shown
    assert "seeds" not in shown


@pytest.mark.claim("results-are-frozen")
def test_numpy_takes_a_result_as_its_total():
    frame = rendering()
    np.testing.assert_array_equal(np.asarray(frame), frame.airlight + frame.surface)
    assert np.shares_memory(np.asarray(frame), frame.total)
    assert not np.shares_memory(np.array(frame), frame.total)
    assert np.asarray(frame, dtype=np.float64).dtype == np.float64
    assert float(np.mean(frame)) == pytest.approx(0.55 + 0.25, rel=1e-6)  # the mean of a ramp is its middle
    with pytest.raises(ValueError, match="copy"):
        np.array(frame, dtype=np.float64, copy=False)


@pytest.mark.claim("image-files")
def test_save_writes_exr_and_png_and_refuses_others(tmp_path):
    frame = rendering()
    read = read_exr(frame.save(tmp_path / "frame.exr"))
    np.testing.assert_array_equal(read.layers["airlight"], frame.airlight)
    assert any(key.startswith("airlight:version:") for key in read.attributes)
    with Picture.open(frame.save(tmp_path / "frame.png")) as shown:
        assert shown.size == (6, 4)
    with pytest.raises(InputError, match=r"\.exr .* or \.png"):
        frame.save(tmp_path / "frame.jpg")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["frame.exr", "frame.png"]


@pytest.mark.claim("image-files")
def test_the_picture_that_users_look_at_first_has_all_light_the_right_way_up(tmp_path):
    """16 x 12 pixels against a picture by hand: Reinhard's curve on airlight and surface, encoded as sRGB."""
    random = np.random.default_rng(7)
    airlight, surface = (random.uniform(0.0, top, (12, 16, 3)).astype(np.float32) for top in (0.3, 1.0))
    image = Image({"airlight": airlight, "surface": surface}, np.ones((12, 16), np.float32), {})
    fields = {"kernel": None, "parameters": {}, "precision": "single", "plan": {}, "label": "m", "method": "m"}
    frame = Rendering(scene="golden", image=sealed(image), **fields)
    with Picture.open(frame.save(tmp_path / "frame.png")) as shown:
        pixels = np.asarray(shown.convert("RGB")).astype(int)
    total = airlight.astype(np.float64) + surface
    exposure = 0.3 / total.mean()
    white = max(1.0, exposure * np.percentile(total, 99.9))
    x = exposure * total
    linear = np.clip(x * (1 + x / white**2) / (1 + x), 0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    assert np.abs(pixels - 255 * encoded).max() <= 0.6  # half a step of 8 bits, and float32


def test_rows_are_records_and_columns_by_their_paths():
    rows = [Row("fog", label, "m", None, "{}", 8, 6, "refused", reason="no <lights>") for label in "ab"]
    benched = MethodsStudy(name="methods", data={}, rows=tuple(rows))
    assert benched.fastest(0.5) is None
    assert len(benched) == 2
    assert benched[1].label == "b"
    assert benched.columns()["label"] == ["a", "b"]
    assert benched.columns()["times.frame.median_ms"] == [None, None]
