# SPDX-License-Identifier: BSD-3-Clause
"""The light volume as a closed mesh, rasterised with signs, as Billeter, Sintorn
and Assarsson 2010 draw it.

Read in this order:

- `method.py`: the method and its parameters.
- `mesh.py`: the displaced grid of a shadow map, joined to the light.
- `tessellation.py`: fewer triangles where the map is flat.
- `raster.py`: every triangle against every pixel that it covers, with the sign of each crossing,
  and the airlight as their sum.
"""
