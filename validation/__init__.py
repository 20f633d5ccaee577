# SPDX-License-Identifier: BSD-3-Clause
"""Scenes, measurements and statistics: the only package that sees both the methods and the truth.

Read in this order:

- `scenes/`: the built-in scenes, animations, and the loading of scenes;
- `metrics/`: errors of one image against another;
- `statistics/`: tests for images with random errors, and the noise of errors and times;
- `configurations/`: methods and kernels by name, and the timing of frames;
- `estimates/`: the truth of a scene by each estimator, budgets, and the agreement of the estimators;
- `certified/`: files of certified values: twelve scenes of fog, and airlight integrals;
- `kernels/`: errors, cost, convergence and stability of airlight kernels;
- `frames/`: errors and cost of whole frames, scene by scene;
- `scaling/`: what a method costs as its work grows;
- `papers/`: the claims of papers as data, and the experiments that decide them;
- `slab/`: a slab by order of scattering, on both sides;
- `canonical/`: tables of light scattered in a slab, as frames look them up, against their computation;
- `comparison/`: images from files and engines against the truth;
- `sweep/`: studies of many scenes, and their rows.

`baselines/` holds what sweeps and `bench --scaling` measured once.
"""
