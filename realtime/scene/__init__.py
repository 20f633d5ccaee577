# SPDX-License-Identifier: BSD-3-Clause
"""The scene as methods see it: camera, lights, media, phase functions and
meshes, read from Mitsuba once.

Read in this order:

- `camera.py`: the pinhole camera, from a pixel to a ray;
- `phase.py`: phase functions, which say their values and series;
- `rule_reach.py`: how far rules of few nodes reach for one, by the error of the rules;
- `rounding.py`: how much float32 coordinates far from the origin change of its lengths;
- `density.py`: clouds whose density differs from place to place;
- `lights.py`: point, spot and directional lights as homogeneous positions;
- `media/`: media, which answer for themselves: extinction, optical depths, airlight;
- `closed_mesh.py`: closed meshes of any shape, what lies inside, and the convex bounds of media;
- `directional_extent.py`: the smallest rectangle across a directional light through which all
  light of the media comes;
- `triangle_table.py`: what shading needs of every triangle;
- `mesh_adjacency.py`: triangles that cast shadows, and their neighbours;
- `read_media.py`: reads the media of a Mitsuba scene;
- `read_scene.py`: reads a Mitsuba scene, and says what it needs of a method;
- `light_table.py`: lights of one structure as a table, and area lights as light samples;
- `animate.py`: the scene after lights, the medium or objects moved.
"""
