# SPDX-License-Identifier: BSD-3-Clause
"""The light of a sky that has the same radiance everywhere, by order of scattering.

Read in this order:

- `escapes.py`: the share of paths that leave a slab after a number of scatterings, in float64;
- `light.py`: what a ray through clouds gets of the sky.

May import: `realtime.clouds.bounds`, `realtime.clouds.canonical`, `realtime.clouds.order_layers`,
`realtime.clouds.single_scattering`, `realtime.clouds.slab_orders`, `realtime.numerics`, `realtime.scene`.
"""
