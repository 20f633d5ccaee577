# SPDX-License-Identifier: BSD-3-Clause
"""Light volumes: what a light reaches, bounded by the height field of its shadow map, crossed without marching.

A ray is a straight line over each face of the map. Tiles of rays draw lists of the texels over which they may cross the
height field; each ray finds its crossings there and adds up the lit intervals between them. `published/` draws the
volume as a mesh instead, as in the paper.

Read in this order:

- `method.py`: the method and its parameters.
- `ray_lines.py`: a camera ray over a face of the map, in projective coordinates.
- `texel_lines.py`: its line over the texels of the face.
- `texel_crossings.py`: where it crosses the height field over one texel.
- `texel_walls.py`: the height field over a texel with upright walls.
- `jump_search.py`: how rays from the light find those walls.
- `cube_faces.py`: the faces that a tile passes, in order.
- `tile_beams.py`: the planes about the rays of a tile or block.
- `pyramid.py`: the nodes of a pyramid of heights that a beam may meet.
- `tile_lists.py`: the texels of each tile.
- `crossings.py`: the nearest crossings of a ray, from the list of its tile.
- `walk.py`: its lit intervals, face by face.
- `published/`: the volume as a mesh.
"""
