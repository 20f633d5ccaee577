# SPDX-License-Identifier: BSD-3-Clause
"""Studies, `airlight study NAME`: a function with typed parameters that returns
rows, tables and a figure.

Read in this order:

- `registry.py`: what a study returns, the studies by name, and `airlight.study`
- `methods.py`: methods timed and compared, errors by cause
- `growth.py`: times and memory as the work grows
- `kernels.py`: kernels timed, where they break, integrals of a file
- `variation.py`: bias apart from noise, flicker and lag under a light that moves
- `clouds.py`: a slab by order of scattering
"""
