# SPDX-License-Identifier: BSD-3-Clause
"""Canonical transport (Bouthors 2008): radiance, collector centre and spread at a point of
a slab, by set of orders.

Read in this order:

- `directional_moments.py`: the light of slabs in any direction by sets, with the
  moments of its displacement;
- `coordinates.py`: the coordinates of the grid;
- `transport_grid.py`: the grid of a phase function and albedo, computed once and cached,
  and its look-up in frames;
- `kept.py`: numbers on disk.
"""
