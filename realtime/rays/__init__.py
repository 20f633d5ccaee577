# SPDX-License-Identifier: BSD-3-Clause
"""The geometry of a camera ray and a light.

Read in this order:

- `ray_light.py`: the foot of the perpendicular, the height, the lit segment of a ray;
- `spot_cone.py`: where a ray enters and leaves the cone of a spot.
"""
