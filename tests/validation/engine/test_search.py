# SPDX-License-Identifier: BSD-3-Clause
"""A light whose shadows have moved is found, although small steps change nothing there."""

from types import SimpleNamespace

import numpy as np

from validation.engine.fault import Fault
from validation.engine.light_faults import PLACE
from validation.engine.search import _Search


def test_a_place_is_found_where_pixels_are_lit_or_dark():
    """Each pixel is wrong by all of its light while the light is further from its place than the shadow is wide."""
    true, widths = np.array([0.05, -0.07, 0.05]), np.linspace(0.004, 0.3, 100)

    def errors(place):
        return np.repeat((widths < np.linalg.norm(np.array(place) - true))[:, None], 3, axis=1).astype(float)

    place_of = Fault("place", "", lambda predictor, guess, p: p, PLACE)
    search = _Search(SimpleNamespace(fog=None, errors=errors), (place_of,))
    begun = np.zeros(3)
    np.testing.assert_array_equal(search.by_steps(begun, 0.01, False), begun)
    np.testing.assert_allclose(search.along_axes(begun, 0.01), true, atol=0.01)
