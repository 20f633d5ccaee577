# SPDX-License-Identifier: BSD-3-Clause
"""Clouds whose density differs from place to place (Bouthors 2008, section 8): rays march through their grids.

Read in this order:

- `march.py`: small steps of rays through clouds, and depths along them;
- `light_depths.py`: the depths of all points from a sun, in a map;
- `scattered.py`: light that was scattered once, and opacity as printed;
- `lit_surface.py`: where the density first exceeds a threshold, from the eye and from the sun.
"""
