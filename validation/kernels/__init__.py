# SPDX-License-Identifier: BSD-3-Clause
"""Studies of kernels: how wrong, how fast and where they break.

Read in this order:

- `errors.py`: relative errors on rays with a known J, and what a value may lose near the smallest numbers;
- `values.py`: values of a kernel on tables of cases;
- `cases.py`: kernels on certified cases;
- `rays.py`: quasi-random rays with their truth;
- `stability.py`: where kernels break;
- `benchmark.py`: time against error.
"""
