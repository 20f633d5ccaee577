# SPDX-License-Identifier: BSD-3-Clause
"""Airlight kernels: the airlight integral between two distances along a ray, for a whole array of rays.

Read in this order:

- `registry.py`: what a kernel is, and the kernels by name;
- `preparation.py`: tables that a kernel needs on the device before a frame is recorded;
- `quadrature.py`: Gauss-Legendre nodes in w = asinh(q/h);
- `exact.py`: the default: as few nodes as a segment needs;
- `short_segments.py`: its rule for segments that are short compared with their distance from the light;
- `panels.py`: its rule for all others;
- `stepping.py`: fixed steps along the ray or in the angle at the light, by the midpoint rule or Gauss's;
- `taylor.py`: the polynomial of Biri 2006 with derived or printed coefficients;
- `table.py`: tables of the integral;
- `closed_form.py`: the closed form of Pegoraro and Parker 2009.
"""
