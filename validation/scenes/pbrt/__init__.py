# SPDX-License-Identifier: BSD-3-Clause
"""Scenes of pbrt-v4 and pbrt-v3, translated to what Mitsuba's parser takes.

A file becomes the text of a Mitsuba scene and mesh files beside it; `validation.scenes.files` then
treats it as every other file. Features that are not translated are refused by name and line.

Read in this order:

- `tokens.py`: words, strings and lists of a file, each with its line;
- `directives.py`: directives and their parameters, included files among them;
- `transforms.py`: the transforms of pbrt as matrices;
- `state.py`: the graphics state, and what stands in the scene with the state where it stands;
- `sides.py`: which meshes are closed, and whether the backs of open ones are lit;
- `lights.py`: lights; the soft edge of a spot as a sum of linear ones;
- `shapes.py`: shapes and area lights, with their materials and the media on their sides;
- `translate.py`: camera, media and the whole scene.
"""
