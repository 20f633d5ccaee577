# SPDX-License-Identifier: BSD-3-Clause
"""The airlight integral in the distance, in the angle and in the path, by separate quadratures, is one number.

With s = x - foot and r = sqrt(height^2 + s^2), cos = -s/r is the cosine of the scattering angle:

* distance: J = int exp(-sigma_t (x + r)) p(cos) / r^2 dx.
* angle: s = h tan(theta), so that r = h/cos(theta), dx = r^2/h dtheta, cos = -sin(theta) and
  x + r = foot + h tan(theta/2 + pi/4).
* path: q = s + r, so that r = (q + h^2/q)/2, s = (q - h^2/q)/2, dx/r^2 = 2 dq/(q^2 + h^2) and x + r = foot + q.
"""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from analytic.panels import airlight_segments
from analytic.phase import PhaseFunction

PHASES = [
    PhaseFunction("rayleigh"),
    PhaseFunction("murky"),
    PhaseFunction("hg", g=-0.9),
    PhaseFunction("tabulated", table=[1.0, 0.0, 3.0, 0.2, 9.0]),
]


@pytest.mark.claim("integral-three-forms", tolerance="1e-10 relative")
@pytest.mark.parametrize("phase", PHASES, ids=lambda phase: phase.name)
def test_three_forms_are_one_integral(phase):
    rng = np.random.default_rng(17)
    for _ in range(6):
        foot, height, x0, length, sigma_t = rng.uniform((-2, 0.2, 0, 0.1, 0), (6, 2, 2, 8, 1))

        def distance(s, foot=foot, height=height, sigma_t=sigma_t):
            r = np.hypot(height, s)
            return np.exp(-sigma_t * (foot + s + r)) * phase(-s / r) / r**2

        def angle(theta, foot=foot, height=height, sigma_t=sigma_t):
            way = foot + height * np.tan(theta / 2 + np.pi / 4)
            return np.exp(-sigma_t * way) * phase(-np.sin(theta)) / height

        def path(q, foot=foot, height=height, sigma_t=sigma_t):
            cosine = (height**2 - q**2) / (height**2 + q**2)
            return np.exp(-sigma_t * (foot + q)) * phase(cosine) * 2 / (q**2 + height**2)

        # From x0 to the end, in pieces between which a table has its kinks.
        kinks = -height * phase.kinks / np.sqrt(1 - phase.kinks**2)
        s = np.clip(np.sort([x0 - foot, *kinks, x0 + length - foot]), x0 - foot, x0 + length - foot)
        forms = (distance, s), (angle, np.arctan(s / height)), (path, s + np.hypot(s, height))
        expected, _ = airlight_segments(foot, height, x0, x0 + length, sigma_t, phase)
        for form, ends in forms:
            pieces = [quad(form, a, b, epsabs=0, epsrel=1e-12)[0] for a, b in pairwise(ends) if b > a]
            # What the panels are asked for; the pieces are right to 1e-12.
            assert sum(pieces) == pytest.approx(expected[0], rel=1e-10)
