# SPDX-License-Identifier: BSD-3-Clause
"""Studies of whole frames: what a method costs, how wrong it is, and whether either changed.

Read in this order:

- `benchmark.py`: the time and the error of one configuration in one scene;
- `expected_work.py`: what a command will take, and the question before it starts;
- `scene_study.py`: all that a report asks of one scene, by effort;
- `result_cache.py`: results on disk, so that a report computes only what changed;
- `decomposition.py`: the error of an image by its causes, which add up to it;
- `cloud_stages.py`: the stages of collectors for clouds, and whether their searches converge;
- `octave_fit.py`: the constants of octaves that fit a scene of clouds best;
- `froxel_study.py`: which grid froxel fog needs, and the ghosts of its history;
- `map_size.py`: error against the size of the shadow map, and the flicker of a light that moves;
- `interpolation_study.py`: how many rays an image needs between tiles, and along epipolar lines;
- `plane_stability.py`: hard cases for sums over shadow planes;
- `zero_cost.py`: checks that what a scene does not need costs nothing.

May import: `analytic`, `realtime.area_lights`, `realtime.clouds.canonical`, `realtime.errors`, `realtime.frame`,
`realtime.kernels`, `realtime.memory`, `realtime.methods`, `realtime.numerics`, `realtime.parameters`, `realtime.scene`,
`reference.quadrature`, `reference.scene`, `reference.storage`, `validation.configurations`, `validation.estimates`,
`validation.metrics`, `validation.scenes`, `validation.statistics`.
"""
