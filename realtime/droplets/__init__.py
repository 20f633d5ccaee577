# SPDX-License-Identifier: BSD-3-Clause
"""Phase functions of water droplets for methods and kernels: Mie's theory, by another route than `analytic.droplets`.

Read in this order:

- `spheres.py`: the amplitudes of light that spheres scatter;
- `series.py`: the phase function of droplets as a cosine series of the angle, and its forward peak;
- `table.py`: the table that kernels look up.
"""
