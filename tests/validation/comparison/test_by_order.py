# SPDX-License-Identifier: BSD-3-Clause
"""Claim: images of clouds are compared order by order, in the layers that both have."""

import numpy as np
import pytest

from analytic.errors import InputError
from reference.storage.exr import Image, write_exr
from validation.comparison.images import compare_files


def written(path, layers):
    random = np.random.default_rng(3)
    noise = {name: 1 + 0.01 * random.random((4, 5, 3)) for name in layers}
    values = {name: noise[name] * size for name, size in layers.items()}
    write_exr(path, Image(values, np.full((4, 5), np.inf), {}))
    return path


def test_layers_that_both_have_are_compared_in_their_order(tmp_path):
    truth = written(
        tmp_path / "a.exr", {"airlight": 2.0, "airlight_31_inf": 1.0, "airlight_3_4": 0.5, "airlight_1": 0.3}
    )
    mine = written(
        tmp_path / "b.exr", {"airlight": 2.0, "airlight_31_inf": 1.5, "airlight_3_4": 0.4, "airlight_2": 9.0}
    )
    compared = compare_files(truth, mine, by_order=True)
    assert [each.layer for each in compared.orders] == ["airlight_3_4", "airlight_31_inf"]
    data = compared.to_json()
    assert [entry["layer"] for entry in data["orders"]] == ["airlight_3_4", "airlight_31_inf"]
    # EXR files hold float32, and the noise of both files is drawn in the order of their layers.
    assert data["orders"][1]["relative_bias"] == pytest.approx(0.5, abs=0.02)
    assert "airlight_31_inf" in compared.summary()
    assert "orders" not in compare_files(truth, mine).to_json()


def test_files_without_orders_in_common_are_refused(tmp_path):
    truth = written(tmp_path / "a.exr", {"airlight": 2.0, "airlight_1": 1.0})
    mine = written(tmp_path / "b.exr", {"airlight": 2.0, "airlight_2": 1.0})
    with pytest.raises(InputError, match=r"share no layer by order.*a\.exr has airlight_1; .*b\.exr has airlight_2"):
        compare_files(truth, mine, by_order=True)
