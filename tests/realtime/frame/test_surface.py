# SPDX-License-Identifier: BSD-3-Clause
"""The surface under the points of a light with extent is one sum, with what they have in common taken out of it."""

import numpy as np
import pytest

from tests.helpers.lamps import frame, lamp_scene


@pytest.mark.parametrize(("shape", "sigma_t"), [("rectangle", (0.11, 0.31, 0.53)), ("sphere", 0.21)])
def test_the_sum_by_points_is_the_sum_of_the_points(variant, shape, sigma_t):
    """Rationale: rounding of float32, a dozen operations a point."""
    changes = {"ball": None, "fog": fog(sigma_t)}
    scene = lamp_scene(shape, **changes)
    own = frame(scene, points=7, pattern="sobol").surface
    single = frame(scene, "unshadowed", kernel="quadrature", points=7, pattern="sobol").surface
    assert single.mean() > 0
    np.testing.assert_allclose(own, single, rtol=3e-6, atol=1e-6 * single.mean())


def fog(sigma_t):
    """Return the fog of the tiny scene, grey or coloured."""
    colour = isinstance(sigma_t, tuple)
    value = {"type": "rgb", "value": list(sigma_t)} if colour else sigma_t
    return {"type": "homogeneous", "id": "fog", "sigma_t": value, "albedo": 0.9, "has_spectral_extinction": colour}
