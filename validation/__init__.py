# SPDX-License-Identifier: BSD-3-Clause
"""Scenes, measurements and statistics: the only package that sees both the methods and the truth.

Read in this order:

- `scenes/`: the built-in scenes, animations, and the loading of scenes;
- `metrics/`: errors of one image against another;
- `statistics/`: tests for images with random errors, and the noise of errors and times;
- `configurations/`: methods and kernels by name, and the timing of frames;
- `estimates/`: the truth of a scene by each estimator, budgets, and the agreement of the estimators;
- `certified/`: twelve scenes of fog to 12 digits, in mpmath;
- `known_answers/`: laws and scenes whose answer is known;
- `mutations/`: faults of the physics in copies of the estimators, and which of them the checks detect;
- `kernels/`: errors, cost, convergence and stability of airlight kernels;
- `oracles/`: slow programs that compute the airlight of a light volume in float64;
- `frames/`: errors and cost of whole frames, scene by scene, and the comparison with `baselines/`;
- `scaling/`: what a method costs as its work grows;
- `papers/`: the results of papers measured again;
- `fidelity/`: a verdict for every claim of these papers;
- `slab/`: a slab by order of scattering, on both sides;
- `canonical/`: tables of light scattered in a slab, as frames look them up, against their computation;
- `comparison/`: images from files and engines against the truth.

`baselines/` holds the known errors of every configuration as JSON files.

May import: `analytic`, `realtime`, `reference`.
"""
