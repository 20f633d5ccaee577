# SPDX-License-Identifier: BSD-3-Clause
"""The reference: images of single scattering, each with its own error.

Three estimators lead to it. `quadrature` finds the lit intervals of every camera ray by exact
geometry and sums airlight integrals over them in float64. `monte_carlo.single_scatter` samples the
same integral as an integrator of Mitsuba. `monte_carlo.volpath` runs Mitsuba's volumetric path
tracer, independent of this project. In clouds, where light scatters many times,
`monte_carlo.cloud_paths` takes their place.

None of the three imports another. They share the reading of the scene (`scene`: coefficients,
lights, the rays through pixel centres, as Mitsuba gives them), the class of errors for the user,
and, in the two that sample, the means over batches. Reading a scene is no derivation; all that is
derived from these facts, from the planes of directional lights to the crossings of bounds, belongs
to one estimator alone. The contracts of import-linter in `pyproject.toml` follow all imports and
hold this list.

Read in this order:

- `storage`: files written whole, layered OpenEXR images, and the cache of finished references;
- `scene`: a Mitsuba scene read as numbers;
- `visibility`: which parts of camera rays a light reaches;
- `quadrature`: the first estimator;
- `monte_carlo`: the other two, and batches of samples.
"""
