# SPDX-License-Identifier: BSD-3-Clause
"""The reference by quadrature: airlight integrals over lit intervals, added up in float64, each
with its error and what that is: proven, estimated or statistical.

Read in this order:

- `reference.py`: the reference of a scene, from the cache or computed, refused where it is infinite;
- `image.py`: all lights along every ray, by pixel centres or by means over pixels;
- `light_airlight.py`: the airlight of one point, spot or directional light;
- `fields.py`: what every medium answers, the door for new ones;
- `model_terms.py`: the terms of an engine's own equation: where its fog is, how its lamps fall off;
- `intervals.py`: lit intervals, cut at media and at the corners of the integrand;
- `integrate.py`: pieces to a value and its error, panels halved until a sum meets its tolerance;
- `homogeneous.py`: homogeneous media, bounded or not;
- `height_fog.py`: height fog;
- `density_grid.py`: density grids, walked from cell to cell;
- `surface.py`: lit surfaces, area lights and background, as the camera sees them;
- `sky.py`: the light of a uniform sky;
- `replicates.py`: how many samples a ray needs, and means whose intervals hold;
- `mesh_choice.py`: which triangles of a mesh of light samples lie on;
- `half_planes.py`: area lights cut by half planes about an axis;
- `light_samples.py`: samples of area lights along a ray;
- `light_sections.py`: sections of area lights for a surface point;
- `shared_samples.py`: even points on them, for sums that all rays share;
- `area_lights.py`: the airlight of area lights, and the surfaces that they light.
"""
