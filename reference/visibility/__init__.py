# SPDX-License-Identifier: BSD-3-Clause
"""Which parts of camera rays a light reaches, for `reference.quadrature`:
one answer for all lights.

A light is a homogeneous position, a place or a direction; an area light has a sample for each ray.
Occluders are mapped to the ray exactly, and fresh random shadow rays check the lit rest.

Read in this order:

- `distances.py`: where lines enter and leave convex bounds, and the distance to the
  visible surface in float64;
- `planes.py`: the plane of a ray and a light, and the map of occluders to the ray;
- `candidates.py`: which shapes can stand in the light of which rays;
- `shadows.py`: the shadows of triangles, disks and spheres, and the lit rest;
- `certificate.py`: random shadow rays, and the judge of what they contradict;
- `lit_intervals.py`: the possible occluders of a light, and the lit intervals of
  rays, found and checked.
"""
