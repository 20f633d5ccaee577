# SPDX-License-Identifier: BSD-3-Clause
"""The light of a homogeneous slab under a beam, by order of scattering, with the moments of its displacement.

A deterministic computation in NumPy and SciPy, float64: it makes the grid of the canonical transport of Bouthors 2008
and runs nowhere in a frame. The truth that checks it is a walk of photons, on the other side
(`reference/monte_carlo/slab_walk/`).

Read in this order:

- `phases.py`: phase functions by values and Legendre moments, water droplets among them;
- `streams.py`: directions, and scattering between them by mode of the azimuth;
- `depth_panels.py`: light along straight lines through the slab;
- `discrete_ordinates.py`: all orders of one mode at once;
- `moments.py`: order after order, with the moments of the displacement, and the sum of the rest;
- `radiance.py`: the radiance of all orders in any direction;
- `slab.py`: what leaves a slab and what is inside, with the error of every number.
"""
