# SPDX-License-Identifier: BSD-3-Clause
"""Shadow planes as Biri, Arques and Michelin 2006 draw them: Gamma at every plane, with a
stencil and a frame buffer.

Silhouettes, their planes and the wedges are those of `realtime.methods.shadow_planes`.

Read in this order:

- `method.py`: the method, and what each of its parameters takes from the paper.
- `planes.py`: the planes in the paper's order, and the cone of a spot as an occluder.
- `crossings.py`: the sum, plane by plane with a stencil, in a buffer.
- `media.py`: bounded media with a constant distance from the light.
- `polynomial.py`: the polynomial in them.
- `mesh.py`: Gamma at the vertices of meshes, also in bounded media, medium by medium.
"""
