# SPDX-License-Identifier: BSD-3-Clause
"""Studies of whole frames: what a method costs, how wrong it is, and whether either changed.

Read in this order:

- `benchmark.py`: the time and the error of one configuration in one scene;
- `expected_work.py`: what a command will take, and the question before it starts;
- `scene_study.py`: all that a report asks of one scene, by effort;
- `result_cache.py`: results on disk, so that a report computes only what changed;
- `decomposition.py`: the error of an image by its causes, which add up to it;
- `cloud_frames.py`: what frames of clouds take that go on with the collectors of the last frame;
- `map_size.py`: error against the size of the shadow map, and the flicker of a light that moves.
"""
