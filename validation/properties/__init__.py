# SPDX-License-Identifier: BSD-3-Clause
"""Properties of a scene: numbers that say what it holds, from what methods read of it.

Sweeps keep them beside errors and times. They are cheap: a grid of camera rays, and shadow rays from a few points on
each.

Read in this order:

- `properties.py`: the properties of a scene by name;
- `view.py`: what the camera sees: depths, and where light reaches its rays;
- `lights.py`: how many silhouettes the lights see, and where they are;
- `media.py`: optical depths, and what the phase functions are like.
"""
