# SPDX-License-Identifier: BSD-3-Clause
"""Scenes for other renderers.

Read in this order:

- `scene.py`: a scene in numbers
- `meshes.py`: its shapes as triangles
- `gltf.py`: the scene as glTF
- `cut.py`: a mesh cut at the bounds of a medium
- `pbrt.py`: the scene as a file of pbrt-v4
- `mitsuba_xml.py`: a scene as a file of Mitsuba
- `fog_grid.py`: height fog as a grid of densities
- `words.py`: the scene as a table
"""
