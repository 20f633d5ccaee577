# SPDX-License-Identifier: BSD-3-Clause
"""Estimates of the reference, and how well they are known, held against each other.

Read in this order:

- `quadrature.py`: the layers of a quadrature image, each with its error: proven, estimated or
  statistical;
- `monte_carlo.py`: batches of a Monte Carlo estimator;
- `images.py`: references as layered images, and when a Monte Carlo run ends;
- `merge.py`: references of several machines as one;
- `agreement.py`: Monte Carlo estimators against the quadrature image;
- `multiple_scattering.py`: the fraction of light that single scattering leaves out.
"""
