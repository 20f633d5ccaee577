# SPDX-License-Identifier: BSD-3-Clause
"""The light of a sky that has the same radiance everywhere, by order of scattering.

Read in this order:

- `escapes.py`: the share of paths that leave a slab after a number of scatterings, in float64;
- `light.py`: what a ray through clouds gets of the sky.
"""
