# SPDX-License-Identifier: BSD-3-Clause
"""The ground truth: images of single scattering, each with its own error.

Three estimators share no derivation. `quadrature` sums certified integrals over exact lit intervals in float64.
`single-scatter` samples the same integral as a Mitsuba integrator of our own. `volpath` is Mitsuba's volumetric path
tracer, which others wrote. The last two run in batches; the spread of the batches gives the standard error.

Read in this order:

- `storage/`: files written whole or not at all, layered EXR images, and the cache of finished references;
- `scene/`: a Mitsuba scene as NumPy arrays in float64: camera rays, lights, shapes, bounds of media;
- `visibility/`: the lit intervals of camera rays, by exact geometry or by cast rays, and their random checks;
- `quadrature/`: the estimator `quadrature`: integrals over the lit intervals, with a bound in every pixel;
- `monte_carlo/`: batches and their allocation, with the estimators `single_scatter/` and `volpath/`.

`quadrature/`, `single_scatter/` and `volpath/` import nothing of one another.

May import: `analytic`.
"""
