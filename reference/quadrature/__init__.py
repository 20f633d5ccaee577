# SPDX-License-Identifier: BSD-3-Clause
"""The reference by quadrature: airlight integrals over lit intervals, added up in float64,
with a bound for each pixel.

Read in this order:

- `stretches.py`: lit stretches, and how lights shine on them;
- `height_fog.py`: sums over lit stretches in height fog;
- `segments.py`: media in convex bounds along rays and shadow segments;
- `pieces.py`: smooth pieces of lit stretches;
- `adaptive_panels.py`: panels that are halved until a sum meets its tolerance;
- `homogeneous.py`: sums over lit stretches in homogeneous media, bounded or not;
- `cell_walk.py`: optical depths through a grid from cell to cell;
- `density_grid.py`: sums over lit stretches in density grids;
- `fields.py`: what every medium answers, the door for new ones;
- `light_airlight.py`: the airlight of one point, spot or directional light;
- `surface.py`: the lit surface behind the medium;
- `replicates.py`: how many samples a ray needs, and means whose intervals hold;
- `mesh_choice.py`: which triangles of a mesh of light samples lie on;
- `light_samples.py`: samples of area lights for a ray or a surface point;
- `shared_samples.py`: even points on them, for sums that all rays share;
- `area_lights.py`: the airlight of area lights, and the surfaces that they light;
- `sky.py`: the light of a uniform sky;
- `emission.py`: these lights seen directly;
- `ray_values.py`: all of this along every ray;
- `image.py`: the image, by pixel centres or by means over pixels.
"""
