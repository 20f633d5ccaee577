# SPDX-License-Identifier: BSD-3-Clause
"""Airlight in bounded media: rays and light paths in disjoint convex media, in clear air or in another medium.

Read in this order:

- `light_paths.py`: how much of the paths from a light to the points of a ray lies in a convex medium;
- `pieces.py`: the pieces of camera rays, and what their surfaces receive through the media;
- `airlight.py`: the airlight of any light, by few nodes between the bends of its paths.
"""
