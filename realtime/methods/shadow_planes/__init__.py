# SPDX-License-Identifier: BSD-3-Clause
"""Shadow planes: volumetric shadows from the silhouettes of casters, without shadow rays and shadow maps.

Silhouettes become planes through the light when the light or casters move. When the camera moves, tiles of rays draw
lists of the planes that they may cross; where planes are finer than tiles, all rays read those of wedges of azimuth
about the light instead. Each ray then adds up the lit intervals between the planes that it crosses.

Read in this order:

- `method.py`: the method, its parameters and what the paper does otherwise.
- `silhouettes.py`: the edges of casters that bound their shadows, as a light sees them.
- `view_culling.py`: which casters can cast a shadow into the view.
- `spot_pyramid.py`: planes about the cone of a spot, as the paper has them.
- `plane_entries.py`: how lists of planes are packed and read, and bins of azimuth.
- `plane_table.py`: planes as four numbers, in bins of azimuth.
- `pixel_rays.py`: camera rays in the frame of the light.
- `tile_boxes.py`: boxes about the rays of tiles and blocks, and which planes they may cross.
- `tile_lists.py`: the planes of each tile, in order.
- `wedges.py`: lists by narrow wedges of azimuth, which serve all tiles where planes are finer than these.
- `sweep.py`: the lit intervals of a ray, along the planes of its list.
- `published_crossings.py`: the sum of the paper, plane by plane with a stencil.
- `published_mesh.py`: its Gamma at the vertices of meshes.
- `published_media.py`: its Gamma in bounded media, medium by medium.
- `plane_counts.py`: how many casters, edges and planes there are, for `--plan`.
"""
