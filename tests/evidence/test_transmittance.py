# SPDX-License-Identifier: BSD-3-Clause
"""Estimators of transmittance: expectations by enumeration and quadrature, and
rays through a rough grid.
"""

from itertools import product

import numpy as np
import pytest

from airlight.reference.scene.read import read_reference
from airlight.validation.scenes.loading import load_scene
from tests.helpers.density_grid import ROUGH, grid_xml, volume
from tests.helpers.height_fog import LAMP
from tests.helpers.transmittance import (
    jackknife,
    marches,
    naive,
    power_series,
    ratio_tracking,
    transmittance_errors,
)

TIMES = 200_000


@pytest.mark.claim("transmittance-estimators", tolerance="1e-7: orders above 12 are left out")
def test_the_power_series_is_unbiased_by_enumeration():
    """Marches that are 0.3 with the probability 0.7, else 1.2: all outcomes of all orders,
    with their probabilities.
    """
    values, odds = np.array([0.3, 1.2]), np.array([0.7, 0.3])
    reach = {0: 1.0, 1: 0.1, 2: 0.1}
    for k in range(3, 14):
        reach[k] = reach[k - 1] * 2 / k
    total = 0.0
    for order in (0, *range(2, 13)):
        outcomes = np.array(list(product((0, 1), repeat=order + 1)))
        after = reach[1] if order == 0 else reach[order + 1]
        mean = np.sum(power_series(values[outcomes]) * odds[outcomes].prod(axis=1))
        total += (reach[order] - after) * mean
    assert total == pytest.approx(np.exp(-values @ odds), rel=1e-7)


@pytest.mark.claim("transmittance-estimators", tolerance="1e-12: Gauss-Hermite of smooth functions")
def test_the_jackknife_is_unbiased_for_normal_depths():
    nodes, weights = np.polynomial.hermite_e.hermegauss(40)
    depth = 1.7 + 0.6 * np.array(list(product(nodes, nodes)))
    mean = np.sum(jackknife(depth) * np.outer(weights, weights).ravel()) / weights.sum() ** 2
    assert mean == pytest.approx(np.exp(-1.7), rel=1e-12)


def test_a_constant_extinction_is_exact_and_tracking_is_unbiased():
    random = np.random.default_rng(1)
    depth = np.stack(
        [marches(lambda x: np.full(x.shape, 0.8), random, 9, 3) for _ in range(3)], axis=1
    )
    for estimate in (naive(depth), jackknife(depth[:, :2]), power_series(depth)):
        np.testing.assert_allclose(estimate, np.exp(-0.8), rtol=1e-12)
    values, _ = ratio_tracking(lambda x: 3 * x, random, TIMES, 3.0)
    assert values.mean() == pytest.approx(np.exp(-1.5), abs=4 * values.std() / TIMES**0.5)


@pytest.mark.claim(
    "transmittance-estimators",
    tolerance="a quarter of the brightening, third order; 4 standard errors",
)
def test_a_naive_march_is_too_bright_as_jensen_says(variant, tmp_path):
    path = tmp_path / "grid.xml"
    path.write_text(grid_xml(volume(tmp_path / "smoke.vol", ROUGH**3), LAMP))
    errors = transmittance_errors(read_reference(load_scene(str(path)).scene), (2, 4))
    for each in errors:
        if each.estimator == "naive":
            assert each.bias == pytest.approx(each.jensen, rel=0.25, abs=4 * each.bias_error)
            assert each.bias > 4 * each.bias_error
        elif each.estimator != "jackknife":
            assert abs(each.bias) < 4 * each.bias_error
