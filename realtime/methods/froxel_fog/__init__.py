# SPDX-License-Identifier: BSD-3-Clause
"""Froxel fog: scattered light in a grid that is aligned with the view, summed front to
back, as in game engines.

Read in this order:

- `grid.py`: where the froxels of a view are, and the airlight from the camera
  to the end of each slice;
- `injection.py`: the light that reaches the middle of each froxel and is
  scattered there to the camera;
- `method.py`: the parameters, and the stages of a frame.
"""
