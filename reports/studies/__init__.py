# SPDX-License-Identifier: BSD-3-Clause
"""Studies, `airlight study NAME`: a function with typed parameters that returns rows, tables and a figure.

Read in this order:

- `result.py`: what a study returns
- `methods.py`: methods timed and compared, errors by cause, growth with the work, sizes of shadow maps
- `kernels.py`: kernels timed, where they break, integrals of a file
- `series.py`: Biri's polynomials
- `noise.py`: bias apart from noise, by independent runs
- `motion.py`: flicker, lag and ghosts under a light that moves
- `transmittance.py`: estimators of transmittance in a density grid
- `clouds.py`: a slab by order of scattering
- `registry.py`: the studies by name, and `airlight.study`
"""
