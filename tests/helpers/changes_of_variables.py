# SPDX-License-Identifier: BSD-3-Clause
"""The changes of variables in the docstring of `analytic.geometry`: x, theta and w."""

import numpy as np


def theta_of_x(x, foot, height):
    """Return theta = atan((x - foot)/height) [rad]; +-pi/2 where the height is zero."""
    return np.arctan2(np.asarray(x, dtype=np.float64) - foot, height)


def x_of_theta(theta, foot, height):
    """Return the distance x = foot + height tan(theta) [m]. Valid for |theta| < pi/2."""
    return np.asarray(foot, dtype=np.float64) + height * np.tan(theta)


def w_of_x(x, foot, height):
    """Return w = asinh((x - foot)/height) [1]. Valid for height > 0."""
    return np.arcsinh((np.asarray(x, dtype=np.float64) - foot) / height)


def x_of_w(w, foot, height):
    """Return the distance x = foot + height sinh(w) [m]."""
    return np.asarray(foot, dtype=np.float64) + height * np.sinh(w)


def theta_of_w(w):
    """Return theta = atan(sinh w) [rad], the Gudermannian of w, as 2 atan(tanh(w/2))."""
    return 2 * np.arctan(np.tanh(0.5 * np.asarray(w, dtype=np.float64)))


def w_of_theta(theta):
    """Return w = asinh(tan theta) [1]. Valid for |theta| < pi/2."""
    return np.arcsinh(np.tan(np.asarray(theta, dtype=np.float64)))
