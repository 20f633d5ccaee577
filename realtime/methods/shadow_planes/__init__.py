# SPDX-License-Identifier: BSD-3-Clause
"""Shadow planes: silhouettes extruded away from the light (Biri, Arques, Michelin 2006).

Read in this order:

- `silhouettes.py`: the edges where layers of shadow begin and end
- `plane_table.py`: planes by azimuth about the axis from light to camera
- `spot_pyramid.py`: the cone of a spot as a caster
- `view_culling.py`: casters whose shadow misses the view
- `pixel_rays.py`: camera rays in the frame of the light
- `tile_boxes.py`: boxes about the directions of tiles, and planes that may touch them
- `tile_lists.py`: the planes of each tile, in order
- `sweep.py`: the walk of a ray along the planes of its tile
- `published_crossings.py`: the paper's order and frame buffer
- `published_mesh.py`: the paper's vertices
- `plane_counts.py`: what a scene asks for, in numbers
- `method.py`: the method and its parameters

May import: `realtime.bounded_media`, `realtime.errors`, `realtime.intervals`, `realtime.kernels`,
`realtime.methods.interface`, `realtime.numerics`, `realtime.parameters`, `realtime.rays`, `realtime.scene`,
`realtime.tiles`.
"""
