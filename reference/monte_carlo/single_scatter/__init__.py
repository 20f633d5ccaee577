# SPDX-License-Identifier: BSD-3-Clause
"""`single-scatter`: a Monte Carlo estimate of exactly one scattering, on rays that Mitsuba casts.

Read in this order:

- `distance_sampling.py`: distances along a ray: equi-angular and free-flight sampling combined;
- `directional_sampling.py`: distances for directional lights: uniform and free-flight;
- `boundary_walk.py`: optical depth and visibility through the boundaries of media;
- `area_sampling.py`: lights with extent, and points on them;
- `stretches.py`: camera rays, their stretches in one medium, cells of samples;
- `height_fog.py`: the estimate in height fog, with optical depths of its own;
- `density_grid.py`: the estimate in density grids, by ratio tracking;
- `scene_data.py`: what the integrator must know of a scene, read on its own;
- `area_estimate.py`: the estimate under lights with extent;
- `estimator.py`: the estimate of one camera ray;
- `integrator.py`: its batches.
"""
