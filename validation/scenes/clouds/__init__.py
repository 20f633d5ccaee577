# SPDX-License-Identifier: BSD-3-Clause
"""Shapes of clouds by formulas, as closed triangle meshes, and what fills them.

Read in this order:

- `surfaces.py`: closed surfaces from functions of points, and between two heights;
- `lobes.py`: lobes with bumps as such functions;
- `hypertexture.py`: density by the distance into a mesh and gradient noise.
"""
