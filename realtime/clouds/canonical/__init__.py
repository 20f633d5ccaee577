# SPDX-License-Identifier: BSD-3-Clause
"""Canonical transport (Bouthors 2008): radiance, collector centre and spread at a point of a slab, by set of orders.

Read in this order:

- `sets.py`: the sets of orders;
- `directional_moments.py`: the light of slabs in any direction by sets, with the moments of its displacement;
- `angular.py`: the phase function scattered n times, of which each set keeps the shape;
- `coordinates.py`: the coordinates of the tables;
- `low_rank.py`: fields over places and directions as sums of products;
- `tables.py`: the tables of a phase function, made once and kept;
- `kept.py`: tables on disk;
- `simplex.py`: the entries around a place of a grid;
- `look_up.py`: the tables on the device, for frames;
- `fit.py`: the 22 functions of the paper, fitted to the tables;
- `scene_phase.py`: the phase function of a scene as the tables need it.
"""
