# SPDX-License-Identifier: BSD-3-Clause
"""Clouds: light that was scattered more than once.

Read in this order:

- `slab_orders/`: the light of a slab by order of scattering, in float64, from which tables are made.

May import: `realtime.droplets`.
"""
