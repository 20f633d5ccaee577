# SPDX-License-Identifier: BSD-3-Clause
"""Oracles of light volumes: the same shadow map met by the same rays, slowly, in float64, one line after the other.

Each is written anew from the definition, so that it can judge the method.

Read in this order:

- `height_field.py`: the height field of a shadow map, and rays over a face of it;
- `upright_walls.py`: the walls between texels, for maps that have them;
- `light_volume.py`: the airlight of a light volume along camera rays.

May import: `analytic`, `realtime.methods.light_volumes`, `realtime.scene`, `realtime.shadow_maps`,
`reference.quadrature`, `reference.scene`, `reference.visibility`.
"""
