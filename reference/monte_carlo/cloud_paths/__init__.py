# SPDX-License-Identifier: BSD-3-Clause
"""The reference of scenes of clouds: light paths through closed meshes of any shape,
binned by order of scattering.

Read in this order:

- `phases.py`: phase functions: values, and scattering angles at random;
- `tables.py`: the scene as arrays;
- `walk.py`: the paths, one ray cast a turn;
- `opacity.py`: what clouds let through, exactly;
- `integrator.py`: a batch of paths as layers.
"""
