# SPDX-License-Identifier: BSD-3-Clause
"""Light volumes: what a light reaches, bounded by the height field of its shadow map,
crossed without marching.

A ray is a straight line over each face of the map. It descends into a pyramid of heights to the
texels over which it crosses the height field, and adds up the lit intervals between them.

Read in this order:

- `method.py`: the method and its parameters.
- `walk.py`: the lit intervals of a ray, node by node of the pyramid.
- `face_lines.py`: a camera ray over a face of the map, in projective coordinates.
- `texel_crossings.py`: where it crosses the height field over one texel.
- `texel_walls.py`: the height field over a texel with upright walls.
- `jump_search.py`: how rays from the light find those walls.
"""
