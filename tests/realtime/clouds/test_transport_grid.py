# SPDX-License-Identifier: BSD-3-Clause
"""The grid of the canonical transport: linear between its entries, defined outside of them."""

from types import SimpleNamespace

import drjit as dr
import mitsuba as mi
import numpy as np

from realtime.clouds.canonical.coordinates import ENTRIES
from realtime.clouds.collectors.transport_grid import transport_grid
from realtime.numerics.array_types import aligned_array

SETS = 2


def _formula(types):
    """Return a look-up that is smooth in the coordinates of the tables, with steep light and long displacements."""

    class Formula:
        angular = (types.scalar([1.0]),)

        def __call__(self, number, t, d, mu, cos_phi, sin_phi, mu_l):
            Float = type(t)
            behind = dr.select(mu < 0, d, t - d) / dr.maximum(dr.abs(mu), 1e-6)
            passed = dr.select(behind < 1e-3, behind, 1 - dr.exp(-behind))
            T = Float(0.1 + number) * passed * dr.exp(-0.3 * d) * (1 + 0.2 * mu + 0.1 * cos_phi) * (0.5 + mu_l)
            sigma = 0.5 + 0.1 * dr.log(1 + d)
            return T, -sigma * (0.3 + 0.1 * cos_phi), 0.2 * sigma * sin_phi, sigma

    return Formula()


def _both(points):
    look_up = _formula(SimpleNamespace(scalar=mi.Float))
    grid = transport_grid(look_up, np.ones((SETS, ENTRIES)), SETS)
    arguments = [aligned_array(mi.Float, np.asarray(column)) for column in points]
    values = [[transport(number, *arguments) for number in range(SETS)] for transport in (look_up, grid)]
    dr.eval(values)
    return [[[np.array(value) for value in of_set] for of_set in of_transport] for of_transport in values]


def _points(count=3000, seed=5):
    rng = np.random.default_rng(seed)
    t = np.exp(rng.uniform(np.log(0.02), np.log(150.0), count))
    d, mu, phi = t * rng.uniform(0, 1, count) ** 2, rng.uniform(-1, 1, count), rng.uniform(-np.pi, np.pi, count)
    return t, d, mu, np.cos(phi), np.sin(phi), rng.uniform(0.03, 1, count)


def test_the_grid_is_its_look_up_between_entries(variant):
    points = _points()
    lit = points[1] < 20  # deeper, less than e^-6 of the light is left
    for exact, found in zip(*_both(points)):
        assert np.quantile(np.abs(found[0] / exact[0] - 1)[lit], 0.95) < 0.08
        away = np.hypot(found[1] - exact[1], found[2] - exact[2]) / exact[3]
        assert np.quantile(away, 0.95) < 0.05
        assert np.quantile(np.abs(found[3] / exact[3] - 1), 0.95) < 0.03
