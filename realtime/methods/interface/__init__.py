# SPDX-License-Identifier: BSD-3-Clause
"""What a method is given, and what it returns: all that methods and frames know of one another.

Read in this order:

- `method.py`: the record of a method: parameters, `prepare`, `cull`, `render`, passes over the image.
- `view.py`: the rays of a frame, the lights and the media, as a method sees them.
- `layers.py`: what a method returns, the G-buffer and the last frame for passes, and the formula of a frame.
- `light_airlight.py`: the airlight of one light along the rays, whatever fills the scene: what methods sum up.
- `marching.py`: the same integral by midpoint steps: what marchers sum up.
"""
