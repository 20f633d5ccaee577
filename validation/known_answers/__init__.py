# SPDX-License-Identifier: BSD-3-Clause
"""Scenes and laws whose answer is known, and how far each estimator is from it.

Read in this order:

- `record.py`: one known answer, and how an estimator is held against it;
- `point_lights.py`: answers and laws for point and spot lights;
- `directional.py`: the same for directional lights;
- `area_lights.py`: the same for lights with extent.

May import: `analytic`, `reference.monte_carlo.single_scatter`, `reference.monte_carlo.volpath`, `reference.quadrature`,
`reference.scene`, `reference.visibility`, `validation.certified`.
"""
