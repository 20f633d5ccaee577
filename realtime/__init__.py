# SPDX-License-Identifier: BSD-3-Clause
"""The side under test: real-time single scattering in Dr.Jit, float32 and float64 from one source.

A scene is read once, a method turns the view of a frame into the layers of every pixel, and a frame is composed of the
layers. Mitsuba only reads the scene and casts rays. Nothing here imports the truth (`analytic`, `reference`) or what
compares both sides.

Read in this order:

- `errors.py`: the exception for mistakes of the user;
- `memory.py`: refuses work that needs more memory than the machine, its container or the GPU has;
- `parameters.py`: typed parameters of methods, with defaults, ranges and help;
- `numerics/`: array types, error-free arithmetic, fast functions, Gauss-Legendre nodes;
- `droplets/`: phase functions of the droplets of fog and clouds;
- `area_lights/`: lights with extent, and the points that stand for them;
- `scene/`: camera, lights, media, phase functions and meshes, read from Mitsuba; the features of a scene; what moves;
- `rays/`: the geometry of rays and lights, and the cone of a spot;
- `shadow_maps/`: shadow maps and the field of inverse depth over them;
- `image_filters/`: Gaussian, bilateral and joint bilateral filters of whole images, and up-sampling;
- `tiles/`: pixels in tiles of 4 x 4, lists of candidates, and adaptive sampling between the corners of tiles;
- `kernels/`: the airlight integral between two distances along a ray;
- `bounded_media/`: rays, legs and airlight in bounded media;
- `intervals/`: the lit intervals of rays, their sum, and the nearest crossings;
- `clouds/`: light scattered more than once: a slab by orders;
- `methods/`: the methods: `interface/`, `unshadowed`, `ray_march`, `shadow_planes/`, `light_volumes/`, `epipolar/`,
  `froxel_fog/`, `soft_shafts/`;
- `frame/`: camera rays, the lit surface, and whole frames, one or the next.
"""
