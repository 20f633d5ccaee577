# SPDX-License-Identifier: BSD-3-Clause
"""Epipolar slices with min/max trees (Chen 2011, Engelhardt and Dachsbacher 2010, Yusov 2013).

Read in this order:

- `slices.py`: half planes through camera and light, and where they cut the image
- `min_max_tree.py`: the height map of each slice, with a tree of bounds
- `walk.py`: the lit pieces of a ray in its slice
- `samples.py`: which rays are computed, and what lies between them
- `method.py`: the method and its parameters

May import: `realtime.intervals`, `realtime.memory`, `realtime.methods.interface`, `realtime.numerics`,
`realtime.parameters`, `realtime.rays`, `realtime.scene`, `realtime.shadow_maps`, `realtime.tiles`.
"""
