# SPDX-License-Identifier: BSD-3-Clause
"""A frame: camera rays are cast and shaded, a method adds its layers, passes go over the image, all is composed.

Read in this order:

- `light_on_ray.py`: what no frame may hold: radiance that is not finite.
- `renderer.py`: the stages of a frame and how they follow one another.
- `surface.py`: camera rays, and the light that surfaces send back through the medium.
- `surface_stages.py`: these as two recorded functions, one that casts and one that shades what was cast before.
- `frame_view.py`: the view that a method is given.
- `layers.py`: adaptive sampling around a method, passes over its image, and the composition.
- `incremental.py`: the next frame of an animation, and the cache of what stood still.
- `samples.py`: several rays of each pixel, for pictures.
"""
