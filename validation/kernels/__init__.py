# SPDX-License-Identifier: BSD-3-Clause
"""Studies of kernels: how wrong, how fast and where they break.

Read in this order:

- `case_files.py`: tables of cases in CSV files or in memory, and their integrals;
- `cases.py`: values of a kernel on tables of cases, certified ones among them;
- `rays.py`: quasi-random rays with their reference;
- `records.py`: what studies of kernels say, as rows and reports hold it;
- `errors.py`: relative errors on rays with a known J, and what a value may lose
  near the smallest numbers;
- `stability.py`: where kernels break;
- `benchmark.py`: time against error.
"""
