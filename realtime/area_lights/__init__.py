# SPDX-License-Identifier: BSD-3-Clause
"""Lights with extent: rectangles, disks and spheres of constant radiance, and the points that stand for them.

Read in this order:

- `shape.py`: the record of a light with extent, its area and power, and how it turns;
- `read.py`: reads one from a Mitsuba shape, and refuses what no method can render;
- `patterns.py`: patterns of points in the unit square, on a ring and on a sphere;
- `points.py`: the parameters `points` and `pattern`, and the light points of a light;
- `caster.py`: the triangles of its shape, for the shadows that it casts in the light of others.
"""
