# SPDX-License-Identifier: BSD-3-Clause
"""Canonical transport (Bouthors 2008): radiance, collector centre and spread at a point of a slab, by set of orders.

Read in this order:

- `directional_moments.py`: the light of slabs in any direction by sets, with the moments of its displacement;
- `coordinates.py`: the coordinates of the tables;
- `tables.py`: the tables of a phase function, made once and kept;
- `kept.py`: tables on disk;
- `look_up.py`: the tables on the device, for frames;
- `fit.py`: the 22 functions of the paper, fitted to the tables.
"""
