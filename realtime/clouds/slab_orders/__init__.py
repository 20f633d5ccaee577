# SPDX-License-Identifier: BSD-3-Clause
"""The light of a homogeneous slab under a beam, by order of scattering, with the
moments of its displacement.

A deterministic computation in NumPy and SciPy, float64: it makes the grid of the canonical
transport of Bouthors 2008 and runs nowhere in a frame. The reference that checks it is a walk of
photons, on the other side (`reference/monte_carlo/slab_walk/`).

Read in this order:

- `phases.py`: phase functions by values and Legendre moments;
- `depth_panels.py`: light along straight lines through the slab;
- `discrete_ordinates.py`: directions and scattering between them by mode of the azimuth; all
  orders of a mode at once.
"""
