# SPDX-License-Identifier: BSD-3-Clause
"""Scenes drawn from a seed: any number of them, each the same on every machine.

The scene of seed N is point N of one quasi-random sequence, so the seeds from 0 to N - 1
cover the ranges evenly.

Read in this order:

- `design.py`: the names of scenes, the ranges, the sequence of points, and
  what follows from a point;
- `media.py`: unbounded and bounded media, and how bright a light makes them without shadows;
- `lights.py`: kinds, places and brightness of lights;
- `occluders.py`: solids, plates, fences, screens, cages and meshes that
  cast shadows, and the floor;
- `scene.py`: a name to the record of a scene, whether light reaches what the camera
  sees, and Mitsuba's scene.
"""
