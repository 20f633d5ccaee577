# SPDX-License-Identifier: BSD-3-Clause
"""Estimates of the reference, computed or taken from the cache, and held against each other.

Read in this order:

- `quadrature.py`: the quadrature image of a scene, radiance that is refused as infinite, and what
  the reference of another renderer's image holds;
- `monte_carlo.py`: batches of a Monte Carlo estimator;
- `images.py`: references as layered images, and when a Monte Carlo run ends;
- `merge.py`: references of several machines as one;
- `agreement.py`: Monte Carlo estimators against the quadrature image;
- `multiple_scattering.py`: the fraction of light that single scattering leaves out.
"""
