# SPDX-License-Identifier: BSD-3-Clause
"""The ground truth: single-scattering images, each with its own error.

Two estimators that share no code lead to it. `reference.quadrature` finds the lit intervals of every camera ray by
ray-traced visibility and sums certified integrals over them in float64. `reference.volpath` runs Mitsuba's volumetric
path tracer, which nobody here wrote, in batches whose spread gives the standard error. `reference.epsilon` measures
what biases the latter.
"""
