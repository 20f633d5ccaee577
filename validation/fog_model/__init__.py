# SPDX-License-Identifier: BSD-3-Clause
"""The single scattering of an image as a function of what describes the fog, with derivatives.

Where light passes and where it is hidden is found once, by the truth's own lit intervals. What is left is a sum over
nodes on them in which extinction, albedo, phase function and intensities are free, and so are the laws that an engine
may get wrong: `airlight compare --fit` and `airlight compare --diagnose` search among these for what explains an image.

Read in this order:

- `paths.py`: nodes on lit intervals and lit surface points, as arrays;
- `nodes.py`: nodes on pieces of rays;
- `lengths.py`: how much of a line lies in each medium;
- `point_paths.py`: those of point and spot lights, and of points of lights with extent;
- `directional_paths.py`: those of directional lights;
- `surface_paths.py`: the surfaces that lights reach;
- `build.py`: all of these for some pixels of a scene;
- `fog.py`: what describes the fog, and what a law may be read as;
- `radiance.py`: the radiance of every pixel, in Dr.Jit, with derivatives in forward mode.
"""
