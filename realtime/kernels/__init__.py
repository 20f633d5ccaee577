# SPDX-License-Identifier: BSD-3-Clause
"""Airlight kernels: the integral J over a segment of a ray in one medium without bounds.

A kernel asks the phase function for what it needs, and refuses by name what that does not have.

Read in this order:

- `registry.py`: the kernels by name, and how a segment is clipped before they are called
- `preparation.py`: Kernels that read tables: what must be on the device before a frame is recorded
- `exact.py`: the default: nodes placed by the phase function's lobe
- `panels.py`: its panels in float32
- `short_segments.py`: its few nodes for short segments
- `quadrature.py`: Gauss-Legendre nodes in w
- `quadrature_theta.py`: the same in theta
- `marching.py`: steps, even in the distance or in theta
- `polynomial.py`: a Chebyshev polynomial fitted to each range
- `polynomial_piece.py`: the range and the integrand of that
- `taylor.py`: the polynomial of Biri 2006, derived again
- `taylor_printed.py`: the same as printed
- `table.py`: two reads of a table
- `closed_form.py`: complex exponential integrals

May import: `realtime.errors`, `realtime.numerics`, `realtime.rays`, `realtime.scene`.
"""
