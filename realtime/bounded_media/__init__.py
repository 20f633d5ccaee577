# SPDX-License-Identifier: BSD-3-Clause
"""Airlight in bounded media: rays and legs in disjoint convex media, in clear air or in another medium.

Read in this order:

- `airlight.py`: the airlight of point and spot lights in bounded media;
- `views.py`: bounded media as the camera and the lights see them, before there are rays;
- `envelopes.py`: the least and the largest of lines along a ray, and where others take over;
- `convex_clip.py`: where lines from one point cross convex bounds;
- `ray_segments.py`: the segments of camera rays, and the parts of legs in each medium;
- `facet_walk.py`: where legs enter a polyhedron on their way to the points of a ray;
- `panels.py`: few nodes along a ray, by the kinks of the legs and the optical depth;
- `directional_legs.py`: the lengths of the legs of a directional light;
- `directional_airlight.py`: the airlight of a directional light.
"""
