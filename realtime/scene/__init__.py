# SPDX-License-Identifier: BSD-3-Clause
"""A scene as the methods see it: camera, lights, media, phase functions, meshes, read from Mitsuba's scene.

All of it is data in Dr.Jit arrays that are opaque, so a scene in which something moved is rendered by kernels that were
recorded before. Lights and phase functions answer questions: no other room asks for their kind or their name.

Read in this order:

- `lights.py`: a light as a homogeneous position: place, cone, directional extent
- `phase.py`: phase functions, with the widths of their lobes and their series
- `medium.py`: homogeneous media, and bounded media in them
- `camera.py`: the pinhole camera and its rays
- `features.py`: what a scene needs of a method
- `convex_bounds.py`: the half spaces or the sphere that bound a medium
- `directional_extent.py`: the rectangle through which a directional light lights the media
- `triangle_table.py`: colours and normals of meshes, by triangle
- `mesh_adjacency.py`: casters: triangles, their neighbours, connected parts
- `read_media.py`: media from Mitsuba
- `read_scene.py`: a whole scene from Mitsuba
- `animate.py`: a scene in which something moved

May import: `realtime.errors`, `realtime.numerics`.
"""
