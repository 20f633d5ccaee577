# SPDX-License-Identifier: BSD-3-Clause
"""The diamond angle: an azimuth without trigonometry.

x/(|x| + |y|) and its like, continued round the square |x| + |y| = 1: 0 to 4 for a full turn, from the x axis over the
y axis, monotone in the angle and exact to rounding.
"""

import drjit as dr
import numpy as np

TURN = 4.0  #: a full turn


def diamond_angle(x, y):
    """Return the azimuth of (x, y), Dr.Jit arrays, in [0, 4) in diamond angles; 0 for the origin."""
    return _diamond_angle(x, y, dr.select)


def host_diamond_angle(x, y):
    """Return the azimuth of (x, y), float32 NumPy arrays, as `diamond_angle` does."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return _diamond_angle(x, y, np.where)


def host_direction(angle):
    """Return the unit vectors (..., 2) at diamond angles, NumPy, of any turn."""
    angle = np.asarray(angle, dtype=np.float64) % TURN
    x = np.where(angle < 2, 1 - angle, angle - 3)
    y = np.where(angle < 1, angle, np.where(angle < 3, 2 - angle, angle - 4))
    return np.stack([x, y], axis=-1) / np.hypot(x, y)[..., None]


def _diamond_angle(x, y, select):
    total = abs(x) + abs(y)
    share = y / total
    upper = select(x >= 0, share, 2 - share)
    lower = select(x < 0, 2 - share, 4 + share)
    angle = select(y >= 0, upper, lower)
    # 4 + share rounds to 4 just below the axis: that is azimuth 0.
    return select((total > 0) & (angle < TURN), angle, 0)
