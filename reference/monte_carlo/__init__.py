# SPDX-License-Identifier: BSD-3-Clause
"""The reference by random samples: what both Monte Carlo estimators of images need to count,
their folders, and a walk.

Read in this order:

- `batches.py`: means of batches, the spread between them, and where their samples go;
- `single_scatter`: an integrator of our own for Mitsuba;
- `volpath`: Mitsuba's volumetric path tracer;
- `volpath_gaps.py`: refuses bodies so near to each other that its rays leap over the gap;
- `slab_walk`: photons in a slab, counted by order of scattering;
- `cloud_paths`: paths through clouds of any shape, by order of scattering.
"""
