# SPDX-License-Identifier: BSD-3-Clause
"""The truth by quadrature: airlight integrals over lit intervals, added up in float64, with a bound for each pixel.

Read in this order:

- `unbounded.py`: sums over lit intervals in one medium without bounds;
- `segments.py`: media in convex bounds along rays;
- `pieces.py`: smooth pieces of lit intervals in bounded media;
- `adaptive_panels.py`: panels that are halved until a sum meets its tolerance;
- `bounded.py`: sums over lit intervals in bounded media;
- `light_airlight.py`: the airlight of one point or spot light;
- `directional_sums.py`: the same for directional lights;
- `directional_airlight.py`: the airlight of one directional light;
- `surface.py`: the lit surface behind the medium;
- `ahead.py`: work that threads do ahead of what needs it;
- `light_points.py`: points on lights with extent;
- `replicates.py`: how many of them a ray needs, and means whose intervals hold;
- `area_airlight.py`: the airlight of lights with extent;
- `area_surface.py`: the surface that they light;
- `emission.py`: these lights seen directly;
- `ray_values.py`: all of this along every ray;
- `pixel_area.py`: means over the areas of pixels;
- `image.py`: the image.
"""
