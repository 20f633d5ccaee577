# SPDX-License-Identifier: BSD-3-Clause
"""A frame: camera rays are cast and shaded, a method adds its layers, and all is put together.

Read in this order:

- `light_on_ray.py`: checks that radiance is finite and that no ray hits a point light.
- `renderer.py`: a frame as groups of lights times parts of the image, and how its
  stages follow one another.
- `sphere_lights.py`: the airlight of samples on a sphere, scaled to that of the sphere.
- `surface.py`: camera rays, and the light that surfaces send back through the medium.
- `history.py`: the mean with the frames before, for any method.
- `incremental.py`: the next frame of an animation, and the cache of what stood still.
- `samples.py`: several rays of each pixel, for pictures.
"""
