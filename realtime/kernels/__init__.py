# SPDX-License-Identifier: BSD-3-Clause
"""Airlight kernels: the airlight integral between two distances along a ray, for a whole array of rays.

Read in this order:

- `registry.py`: what a kernel is, and the kernels by name;
- `exact.py`: the default: as few nodes as a segment needs, and E = q/h, which most kernels integrate over;
- `quadrature.py`: Gauss-Legendre nodes in w = asinh(q/h);
- `stepping.py`: fixed steps along the ray or in the angle at the light, by the midpoint rule or Gauss's;
- `taylor.py`: the polynomial of Biri 2006 with derived or printed coefficients;
- `table.py`: the published table of the integral;
- `closed_form.py`: the closed form of Pegoraro and Parker 2009.
"""
