# SPDX-License-Identifier: BSD-3-Clause
"""Airlight in media with convex bounds: which parts of rays and of legs from the light lie in which medium.

`airlight.py` is the way in: `lit_ray` returns what answers `airlight` and `source` for any light.

Read in this order:

- `convex_clip.py`: lines from one point through convex bodies
- `facet_walk.py`: the same along a ray, from facet to facet
- `directional_legs.py`: legs to a directional light, piecewise linear along a ray
- `body_views.py`: bounded media as camera and lights see them, once a frame
- `ray_segments.py`: the pieces of camera rays, and the legs of their points
- `panels.py`: the integral within one bounded medium, for a light that has a place
- `directional_airlight.py`: the integral for a directional light
- `airlight.py`: both, and the published approximation

May import: `realtime.errors`, `realtime.numerics`, `realtime.rays`, `realtime.scene`.
"""
