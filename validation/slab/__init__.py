# SPDX-License-Identifier: BSD-3-Clause
"""A homogeneous slab in sunlight, by order of scattering: the deterministic computation beside photons.

Read in this order:

- `phases.py`: phase functions by name or from a file, for both sides;
- `request.py`: what is asked for, and what is refused;
- `light.py`: the numbers of both sides by name.
"""
