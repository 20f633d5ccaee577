# SPDX-License-Identifier: BSD-3-Clause
"""`single-scatter`: a Monte Carlo estimate of exactly one scattering, on rays that Mitsuba casts.

Read in this order:

- `distance_sampling.py`: distances along a ray: equi-angular, uniform and
  free-flight sampling combined;
- `boundary_walk.py`: optical depth and visibility through the boundaries of media;
- `stretches.py`: camera rays, their parts in media, cells of samples;
- `varying_media.py`: parts in height fog and density grids, with their own optical depths;
- `area_sampling.py`: points on area lights;
- `model_lamps.py`: distance laws, ranges and edges of spots of a model;
- `sources.py`: the light that samples receive;
- `estimator.py`: the estimate of one camera ray;
- `model_terms.py`: the terms of a model along camera rays, with their derivation;
- `model_parts.py`: parts in media whose light follows them;
- `model_rays.py`: the estimate of one camera ray by a model;
- `integrator.py`: its batches, of a scene that was read.
"""
