# SPDX-License-Identifier: BSD-3-Clause
"""A Mitsuba scene as numbers in float64: what all estimators of the reference may share.

These are facts that Mitsuba reports. Each estimator derives for itself what
follows from them along a ray.

Read in this order:

- `device.py`: numbers of NumPy for compiled kernels, and how types of Mitsuba are written;
- `transforms.py`: transforms as matrices, and what their scales do to lights and spheres;
- `colours.py`: colours of lights and media, checked;
- `camera.py`: the camera, and directions of rays through positions on the film;
- `convex_bounds.py`: convex bounds of media, read and checked;
- `point_light.py`: points and spots, read and checked;
- `directional_light.py`: directional lights: direction and irradiance;
- `area_light.py`: area lights, read and checked;
- `varying.py`: media whose extinction differs from place to place: height fog and density grids;
- `model_words.py`: the terms of an engine's equation in words, and what each may be;
- `model.py`: an engine's equation by its terms: facts about it, and no physics;
- `homogeneous_medium.py`: media of one extinction;
- `medium_around.py`: the medium around the camera;
- `shape_roles.py`: which shapes stop light, and which bound media;
- `read.py`: the whole scene: lights, media, camera rays;
- `clouds.py`: scenes of clouds: media of any shape, suns and a sky;
- `shapes.py`: opaque shapes as triangles and spheres;
- `shadow_epsilon.py`: how far short of the light Mitsuba's shadow rays end.
"""
