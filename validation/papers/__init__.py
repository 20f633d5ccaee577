# SPDX-License-Identifier: BSD-3-Clause
"""The claims of papers as data, the experiments that measure their figures, and a verdict for each.

Read in this order:

- `claims.py`: a claim, its figure and the rule that makes its verdict; `claims.toml` has
  all claims and experiments
- `formulas.py`: printed formulas beside what they must be, what misprints cost, and droplets
- `shadow_planes.py`: orders and shortcuts of shadow planes in images, and the stencil along a ray
- `scattering.py`: multiple scattering, and the constant R of bounded media
- `biri_tables.py`: Table 2 and the times of section 6 of Biri 2006
- `light_volumes.py`: meshes, depths and maps of light volumes
- `billeter_tables.py`: Figures 6 and 7 and Table 1 of Billeter 2010
- `soft_shafts.py`: the figures of Ali 2016
- `fitted_transport.py`: the functions that Bouthors 2008 fits to the light of slabs
- `slab.py`: what a slab decides of Bouthors 2008
- `clouds.py`: the clouds of Bouthors 2008
- `pictures.py`: the pictures of papers again
"""
