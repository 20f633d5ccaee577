# SPDX-License-Identifier: BSD-3-Clause
"""Claim: references of clouds hold the sets of orders that were asked for, and go on where they ended."""

import numpy as np
import pytest

from analytic.errors import InputError
from validation.estimates.images import Budget, cloud_orders, monte_carlo_reference
from validation.scenes.loading import load_scene


def test_sets_are_disjoint():
    assert cloud_orders("1, 2,3-4,5-inf") == ("1", "2", "3-4", "5-inf")
    assert cloud_orders("sets")[-1] == "31-inf"
    assert cloud_orders("all") == ()
    with pytest.raises(InputError, match="names order 3 twice"):
        cloud_orders("1-3,3-4")
    with pytest.raises(InputError, match="wanted for example"):
        cloud_orders("many")


def test_a_reference_has_the_layers_and_is_kept(variant, tmp_path, monkeypatch):
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path))
    loaded = load_scene("ring", (8, 6))
    orders = cloud_orders("1,2-inf")
    first = monte_carlo_reference(loaded, "cloud-paths", budget=Budget(samples=64), orders=orders)
    again = monte_carlo_reference(loaded, "cloud-paths", budget=Budget(samples=64), orders=orders)
    assert (first.cached, again.cached) == (0, 32)
    layers = first.image.layers
    sampled = ("airlight", "surface", "airlight_1", "airlight_2_inf", "surface_straight")
    assert set(layers) == {name + end for name in sampled for end in ("", "_se")} | {"opacity", "background"}
    for name, values in layers.items():
        np.testing.assert_array_equal(values, again.image.layers[name])
    np.testing.assert_allclose(
        layers["airlight"], layers["airlight_1"] + layers["airlight_2_inf"], rtol=1e-5, atol=1e-9
    )
    clear = layers["opacity"] == 0
    assert clear.any()
    assert not layers["airlight"][clear].any()
    assert (layers["airlight"][~clear] > 0).any()
