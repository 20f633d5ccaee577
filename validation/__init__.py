# SPDX-License-Identifier: BSD-3-Clause
"""Scenes, measurements and statistics: the only package that sees both the methods and the truth.

Read in this order:

- `scenes/`: the built-in scenes, animations, and the loading of scenes;
- `metrics/`: errors of one image against another;
- `statistics/`: tests for images with random errors, and the noise of errors and times;
- `columns.py`: records that know their columns: heading, unit, meaning;
- `clock.py`: times and memory of any work;
- `estimates/`: the truth of a scene by each estimator, budgets, and the agreement of the estimators;
- `study/`: scenes x sizes x changes x configurations: what each combination costs and how wrong it is;
- `certified/`: files of certified values: twelve scenes of fog, and airlight integrals;
- `kernels/`: errors, cost, convergence and stability of airlight kernels;
- `papers/`: the claims of papers as data, and the experiments that decide them;
- `slab/`: a slab by order of scattering, on both sides;
- `comparison/`: images from files and engines against the truth;
- `motion/`: independent renders and sequences of frames: bias apart from noise, flicker, lag, ghosts.

`baselines/` holds what `bench --scaling` measured once.
"""
