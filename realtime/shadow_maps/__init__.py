# SPDX-License-Identifier: BSD-3-Clause
"""Shadow maps: what a light sees, by ray casting, and as a height field over its texels.

Read in this order:

- `projection.py`: the homogeneous map from (u, v, s) to points, perspective and orthographic
- `shadow_map.py`: distances at the corners of texels, and their inverse depths
- `inverse_depth_field.py`: inverse depths as a height field, with a pyramid of bounds

May import: `realtime.errors`, `realtime.numerics`, `realtime.parameters`, `realtime.scene`.
"""
