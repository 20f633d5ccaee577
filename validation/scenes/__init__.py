# SPDX-License-Identifier: BSD-3-Clause
"""The built-in scenes, their animations, and the loading of scenes by name or by file.

Read in this order:

- `fog.toml`, `many_lights.toml`, `height_fog.toml`, `density_grid.toml`, `clouds.toml`: the built-in
  scenes as data;
- `names.py`: the names of scenes, and the refusal of others;
- `registry.py`: their records by name, and the Mitsuba dictionaries that the data stand for;
- `parts.py`: shapes of meshes, media, lights and cameras for such dictionaries;
- `meshes.py`: meshes by their parameters;
- `cloud_meshes.py`: surfaces of clouds by formulas;
- `smoke.py`: smoke as a density grid;
- `hypertexture.py`: density by the distance into a mesh and gradient noise;
- `engine_fog.py`: the height fog of engines as layers;
- `models.py`, `models.toml`: the equations of engines by name, as data, and the words that name an
  equation;
- `height_fog.py`: the volume `heightfog` of Mitsuba: density by height;
- `random`: scenes drawn from a seed;
- `numbers.py`: refuses numbers that cannot give a finite image;
- `bodies.py`: refuses bounds of media that are no bodies beside one another;
- `changes.py`: camera, lights and media of a scene changed by name, isotropic
  media given a mean cosine;
- `vdb.py`: grids of OpenVDB as values and a box;
- `pbrt`: scenes of pbrt as text and meshes for Mitsuba's parser;
- `files`: scene files as people write them, made into what both readers take;
- `loading.py`: a scene by its name or from a file, and what it is in keys of results;
- `animation.py`: the scenes of the frames of an animation.
"""
