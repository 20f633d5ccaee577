# SPDX-License-Identifier: BSD-3-Clause
"""A homogeneous slab in sunlight, by order of scattering: the deterministic
computation beside photons.

Read in this order:

- `phases.py`: phase functions by name or from a file, for both sides;
- `moments.py`: order after order, with the moments of the displacement, and the sum of the rest;
- `radiance.py`: the radiance of all orders in any direction;
- `request.py`: what is asked for, and what is refused;
- `light.py`: what leaves a slab and what is inside, of both sides by name, with
  the error of every number.
"""
