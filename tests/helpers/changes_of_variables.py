# SPDX-License-Identifier: BSD-3-Clause
"""The changes of variables in the docstring of `analytic.geometry`: x, theta and w."""

import numpy as np


def theta_of_x(x, foot, height):
    """Return theta = atan((x - foot)/height) [rad]; +-pi/2 where the height is zero."""
    return np.arctan2(np.asarray(x, dtype=np.float64) - foot, height)


def x_of_theta(theta, foot, height):
    """Return the distance x = foot + height tan(theta) [m]. Valid for |theta| < pi/2."""
    return np.asarray(foot, dtype=np.float64) + height * np.tan(theta)
