# SPDX-License-Identifier: BSD-3-Clause
"""Scenes from a number: what is drawn, from which ranges, as plain records without Mitsuba.

The scene of seed N is point N of one quasi-random sequence, so the seeds from 0 to N - 1 cover the ranges evenly.
`validation/scenes/random_scene.py` builds the records as Mitsuba scenes, under the name `random:SEED`.

Read in this order:

- `drawn.py`: the records of a scene that was drawn;
- `ranges.py`: what is drawn, from where to where; a TOML table overrides;
- `design.py`: the sequence of points, and what follows from a point;
- `cameras.py`: where the camera is and where it looks;
- `media.py`: endless and bounded media and their phase functions;
- `brightness.py`: how bright a light makes the media without shadows, roughly;
- `lights.py`: kinds, places and brightness of lights;
- `casters.py`: solids, plates, fences, screens, cages and meshes that cast shadows, and the floor;
- `draw.py`: a seed to the record of a scene;
- `reach.py`: whether light reaches what the camera sees.
"""
