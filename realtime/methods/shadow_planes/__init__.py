# SPDX-License-Identifier: BSD-3-Clause
"""Shadow planes: volumetric shadows from the silhouettes of occluders, without
shadow rays and shadow maps.

Silhouettes become planes through the light when the light, the camera or occluders move; the planes
are sorted into wedges of azimuth about the axis from light to camera. Each ray adds up the lit
intervals between the planes of its wedge that it crosses.

Read in this order:

- `method.py`: the method.
- `silhouettes.py`: the edges of occluders that bound their shadows, and
  which occluders a view needs.
- `plane_table.py`: planes as four numbers, by wedges of azimuth.
- `sweep.py`: the lit intervals of a ray, along the planes of its list.
"""
