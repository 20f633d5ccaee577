# SPDX-License-Identifier: BSD-3-Clause
"""Which parts of camera rays a light reaches, for `reference.quadrature`.

Lit intervals come from exact geometry or from cast rays; random shadow rays check either.

Read in this order:

- `intervals.py`: lit intervals, and what random checks found about them;
- `line_crossings.py`: where lines enter and leave convex bounds;
- `exact_distance.py`: the distance to the visible surface in float64;
- `spot_cone.py`: where rays cross the cones of a spot;
- `spheres.py`: the intervals that spheres hide;
- `triangles.py`: the intervals that triangles hide, and the lit rest;
- `random_checks.py`: checks lit intervals by random shadow rays and mends them;
- `lit_intervals.py`: lit intervals for point and spot lights, by either route;
- `parallel_rays.py`: the planes of camera rays and a directional light;
- `directional_geometry.py`: lit intervals for directional lights by exact geometry;
- `directional_casting.py`: the same by cast rays;
- `surface_shadows.py`: which visible surfaces a light reaches;
- `before_light.py`: what can stand in the light of a light with extent;
- `many_points.py`: lit intervals for many points of such a light at once;
- `pair_checks.py`: checks these by random shadow rays;
- `light_lines.py`: the parts of such a light that surface points see.
"""
