# SPDX-License-Identifier: BSD-3-Clause
"""Scenes, measurements and statistics: the only package that sees both the
methods and the reference.

Read in this order:

- `scenes/`: the built-in scenes, animations, random scenes, and the loading of scenes;
- `properties/`: numbers that say what a scene holds;
- `metrics/`: errors of one image against another;
- `statistics/`: tests for images with random errors, and the noise of errors and times;
- `arrays.py`: names of types of arrays and of progress;
- `columns.py`: records that know their columns: heading, unit, meaning;
- `readers.py`: values in files of users;
- `clock.py`, `timing.py`: times and memory of any work, and the record of a time;
- `estimates/`: the reference of a scene by each estimator, budgets, and the
  agreement of the estimators;
- `study/`: scenes x sizes x changes x configurations: what each combination
  costs and how wrong it is;
- `certified/`: files of certified values: twelve scenes of fog, and airlight integrals;
- `kernels/`: errors, cost and stability of airlight kernels;
- `papers/`: the claims of papers as data, and the experiments that decide them;
- `slab/`: a slab by order of scattering, on both sides;
- `comparison/`: two image files against each other;
- `engine/`: images of other renderers: whether they are right, and what is wrong with them;
- `fog_model/`: the single scattering of an image as a function of what describes the fog;
- `fit/`: which parameters of the fog explain an image;
- `check/`: relations between frames, which need no reference;
- `motion/`: independent renders and sequences of frames: bias apart from
  noise, flicker, lag, ghosts.
"""
