# SPDX-License-Identifier: BSD-3-Clause
"""The reference of slabs and clouds by order of scattering: photons, followed in NumPy and float64.

Read in this order:

- `scattering.py`: scattering angles at random;
- `walk.py`: photons through a slab, counted by order with their distance from the point of entry;
- `estimates.py`: sets of orders with standard errors;
"""
