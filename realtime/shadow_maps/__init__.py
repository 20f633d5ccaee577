# SPDX-License-Identifier: BSD-3-Clause
"""Shadow maps of all lights, by cast rays, and the height field over them.

Read in this order:

- `projection.py`: perspective and orthographic projections as one homogeneous map;
- `shadow_map.py`: casts the rays of a map: one face for a spot or a directional
  light, six for a point light;
- `hemisphere_map.py`: the maps of all points of an area light in one array,
  each over its hemisphere;
- `inverse_depth_field.py`: the light volume as a height field of inverse depth.
"""
