# SPDX-License-Identifier: BSD-3-Clause
"""Mutation tests of the ground truth: faults of the physics in copies of the estimators, and whether checks find them.

The text that a mutation replaces stands exactly once in its module: who moves a formula moves its mutation.

Read in this order:

- `record.py`: what a mutation is;
- `quadrature.py`: faults of the quadrature;
- `single_scatter.py`: faults of the integrator `single-scatter`;
- `directional.py`: faults of either under directional lights;
- `area.py`: faults of either under lights with extent;
- `catalogue.py`: all of them by name;
- `module_copies.py`: copies of modules in which a text is replaced;
- `test_beds.py`: small scenes with the images of unchanged estimators;
- `study.py`: counts how many faults the standard run finds.
"""
