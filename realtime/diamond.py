# SPDX-License-Identifier: BSD-3-Clause
"""The diamond angle: an azimuth without trigonometry.

x/(|x| + |y|) and its like, continued round the square |x| + |y| = 1: 0 to 4 for a full turn, from the x axis over the
y axis, monotone in the angle and exact to rounding.
"""

TURN = 4.0  #: a full turn


def diamond_angle(x, y):
    """Return the azimuth of (x, y) in [0, 4) in diamond angles; 0 for the origin."""
    import drjit as dr

    total = dr.abs(x) + dr.abs(y)
    share = y / total
    upper = dr.select(x >= 0, share, 2 - share)
    lower = dr.select(x < 0, 2 - share, 4 + share)
    angle = dr.select(y >= 0, upper, lower)
    return dr.select((total > 0) & (angle < TURN), angle, 0)
