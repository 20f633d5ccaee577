# SPDX-License-Identifier: BSD-3-Clause
"""Scenes for other renderers.

Read in this order:

- `scene.py`: a scene in numbers
- `meshes.py`: its shapes as triangles
- `gltf.py`: the scene as glTF
- `fog_grid.py`: height fog as a grid of densities
- `words.py`: the scene as a table
"""
