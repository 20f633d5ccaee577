# SPDX-License-Identifier: BSD-3-Clause
"""Airlight kernels: the airlight integral between two distances along a ray,
for a whole array of rays.

Read in this order:

- `registry.py`: what a kernel is, and the kernels by name;
- `exact.py`: the default: as few nodes as a segment needs, and E = q/h, which
  most kernels integrate over;
- `stepping.py`: rules of a fixed size, midpoint steps or Gauss's nodes, along the ray, in
  the angle or in asinh(q/h);
- `taylor.py`: the polynomial of Biri 2006 with derived or printed coefficients;
- `table.py`: the published table of the integral;
- `closed_form.py`: the closed form of Pegoraro and Parker 2009.
"""
