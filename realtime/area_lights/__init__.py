# SPDX-License-Identifier: BSD-3-Clause
"""Lights with extent: rectangles, disks, spheres and meshes of constant radiance, and the points that stand for them.

Read in this order:

- `shape.py`: a light with extent, its area and power, how it turns, its triangles, and how it is read;
- `points.py`: the parameters `points` and `pattern`, and the light points of a light.
"""
