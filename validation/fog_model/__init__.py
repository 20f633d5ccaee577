# SPDX-License-Identifier: BSD-3-Clause
"""The single scattering of an image as a function of what describes the fog.

The lit intervals of the reference say once where light passes and where it is hidden. An image is
then a sum over nodes on them. In this sum extinction, albedo, phase function and intensities are
free, and so are the laws that an engine may get wrong: `airlight compare --fit` and `airlight
compare --diagnose` search among these for the explanation of an image.

Read in this order:

- `places.py`: nodes on lit parts of rays, and lit surface points, of one light;
- `view.py`: the rays of some pixels, what lights reach on them, and all places of a scene;
- `laws.py`: how the light of lamps falls with the distance;
- `radiance.py`: what describes the fog and how its laws are read, and the radiance of every pixel;
- `equation.py`: the fog and the scenery of the equation of an engine.
"""
