# SPDX-License-Identifier: BSD-3-Clause
"""The ground truth: single-scattering images, each with its own error.

Three estimators whose derivations share no code lead to it. `reference.quadrature.image` finds the lit intervals of
every camera ray by exact geometry or ray-traced visibility and sums certified integrals over them in float64.
`reference.monte_carlo.single_scatter.integrator` samples the same integral as an integrator of Mitsuba.
`reference.monte_carlo.volpath.integrator` runs Mitsuba's volumetric path tracer, which nobody here wrote, and
`reference.scene.shadow_epsilon` measures what biases it. The last two go in batches whose spread gives the standard
error.
"""
