# SPDX-License-Identifier: BSD-3-Clause
"""Area lights: rectangles, disks, spheres and meshes of constant radiance, and the
points that stand for them.

Read in this order:

- `shape.py`: an area light, its area and power, how it turns, its triangles, and how it is read;
- `points.py`: the parameters `points` and `pattern`, and the light samples of a light.
"""
