# SPDX-License-Identifier: BSD-3-Clause
"""What is measured: a method with a kernel and the values of its parameters, and how long it takes.

Read in this order:

- `methods.py`: configurations as a user names them, checked, and those that `bench` and `report` measure.
- `kernel_names.py`: kernels as a user names them.
- `timing.py`: medians after warm-up of frames and of their stages.

May import: `analytic.errors`, `realtime.errors`, `realtime.frame`, `realtime.kernels`, `realtime.methods`,
`realtime.parameters`, `realtime.scene`, `validation.scenes`.
"""
