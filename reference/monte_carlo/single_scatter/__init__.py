# SPDX-License-Identifier: BSD-3-Clause
"""`single-scatter`: a Monte Carlo estimate of exactly one scattering, on rays that Mitsuba casts.

Read in this order:

- `distance_sampling.py`: distances along a ray: equi-angular, uniform and free-flight sampling combined;
- `boundary_walk.py`: optical depth and visibility through the boundaries of media;
- `stretches.py`: camera rays, their parts in media, cells of samples;
- `height_fog.py`: parts in height fog, with optical depths of its own;
- `density_grid.py`: parts in density grids, by ratio tracking;
- `area_sampling.py`: area lights, and points on them;
- `sources.py`: what samples receive of lights;
- `scene_data.py`: what the integrator must know of a scene, read on its own;
- `estimator.py`: the estimate of one camera ray;
- `integrator.py`: its batches.
"""
