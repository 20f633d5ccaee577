# SPDX-License-Identifier: BSD-3-Clause
"""Shadow planes as Biri, Arques and Michelin 2006 draw them: Gamma at every plane, with a
stencil and a frame buffer.

`realtime.methods.shadow_planes` finds the silhouettes, their planes and the wedges.

Read in this order:

- `method.py`: the method, and what each of its parameters takes from the paper.
- `planes.py`: the planes in the paper's order, and the cone of a spot as an occluder.
- `crossings.py`: the sum, plane by plane with a stencil, in a buffer.
- `media.py`: bounded media with a constant distance from the light.
- `polynomial.py`: the polynomial in them.
- `mesh.py`: Gamma at the vertices of meshes, also in bounded media, medium by medium.
"""
