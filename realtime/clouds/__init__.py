# SPDX-License-Identifier: BSD-3-Clause
"""Clouds: light that was scattered more than once.

Read in this order:

- `slab_orders/`: the light of a slab by order of scattering, in float64; it makes the grid;
- `march.py`: where rays cross the boundaries of clouds of any shape, steps between
  these, and depths along them;
- `single_scattering.py`: opacity and the light of one scattering, which all
  methods for clouds share;
- `canonical/`: radiance, collector centre and spread at any point of a slab, by set of
  orders, as frames look it up;
- `light_maps.py`: a cloud as its sun sees it, filtered to any width;
- `uniform_sky.py`: the light of a sky that is the same everywhere;
- `density_maps.py`: clouds whose density differs from place to place: the depths of all points from
  a sun, and where the density first exceeds a threshold, from the eye and from the sun;
- `collector_search.py`: where the light of a set of orders enters a cloud,
  and how much of it comes.
"""
