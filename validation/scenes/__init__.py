# SPDX-License-Identifier: BSD-3-Clause
"""The built-in scenes, their animations, and the loading of scenes by name or by file.

A scene is a Mitsuba dictionary that a function builds from arbitrary, never round numbers. The registry lists the
scenes for commands, reports and tests.

Read in this order:

- `record.py`: the entry of a scene in the registry, and what moves in its animation;
- `registry.py`: the scenes by name;
- `parts.py`: meshes, materials, cameras and media that scenes are made of;
- `solids.py`: closed meshes of standard shapes, and walls with openings;
- `open_fog.py`: a lamp in fog, without a shadow;
- `sphere_spot.py`: one sphere in the cone of a spot light;
- `two_pens.py`: two smooth objects whose shadows cross;
- `three_media.py`: three bounded media of coloured fog;
- `clutter.py`: many small objects about a lamp;
- `hall.py`: a great hall lit through a wheel window;
- `colonnade.py`: a hall of fluted columns;
- `omni_box.py`: a lamp amid bars and posts;
- `tangle.py`: uneven tubes before a spot light;
- `windows.py`: a directional light through the windows of a room;
- `penumbra_plane.py`: a disk lamp over the edge of a half-plane;
- `fence.py`: bars at four distances from a rectangular lamp;
- `soft_hall.py`: a hall lit by a window;
- `overlap.py`: two casters whose penumbrae overlap;
- `cloud_parts.py`: droplets, sun and sky of the scenes of clouds;
- `cloud_slab.py`: a slab of cloud;
- `stratocumulus.py`: a layer of stratocumulus of about 130 000 triangles;
- `cumulus.py`: a cumulus of about 5 000 triangles;
- `cumulus_detail.py`: the cumulus with hypertexture;
- `step_cloud.py`: thin and thick cloud by turns;
- `ring.py`: a ring of cloud;
- `two_lobes.py`: a cloud of two lobes;
- `random_scene.py`: scenes drawn from a seed;
- `numbers.py`: refuses numbers of which no finite image can come;
- `changes.py`: camera, lights and media of a scene changed by name;
- `lobes.py`: isotropic media given a mean cosine;
- `files`: scene files as people write them, made into what both readers take;
- `loading.py`: a scene by its name or from a Mitsuba XML file;
- `identity.py`: what a scene is, in keys of results;
- `animation.py`: the scenes of the frames of an animation.
"""
