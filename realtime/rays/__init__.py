# SPDX-License-Identifier: BSD-3-Clause
"""Camera rays as a light sees them: foot and height, the cone of a spot, the lit segment.

Read in this order:

- `ray_light.py`: foot and height of any light, the segment that it could reach, the fall-off of a spot
- `spot_cone.py`: where a ray enters and leaves a cone, without cancellation

May import: `realtime.numerics`, `realtime.scene`.
"""
