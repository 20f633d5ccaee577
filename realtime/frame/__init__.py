# SPDX-License-Identifier: BSD-3-Clause
"""A frame: camera rays are cast and shaded, a method adds its layers, and all is put together.

Read in this order:

- `surface.py`: camera rays, and the light that surfaces send back through the medium.
- `light_groups.py`: which lights a method renders together, and how many states are kept.
- `renderer.py`: the stages of a frame on the device, and how they follow one another.
- `image.py`: a whole frame, on the host.
- `light_on_ray.py`: checks that radiance is finite and that no ray hits a point light.
- `sphere_lights.py`: the airlight of samples on a sphere, scaled to that of the sphere.
- `history.py`: the mean with the frames before, for any method.
- `incremental.py`: the next frame of an animation, and the cache of what stood still.
- `samples.py`: several rays of each pixel, for pictures.
"""
