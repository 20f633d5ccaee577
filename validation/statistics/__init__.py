# SPDX-License-Identifier: BSD-3-Clause
"""Statistics: does an image with random errors agree with another, and what is noise?

Read in this order:

- `p_values.py`: p-values, and what to do with many of them;
- `comparison.py`: all tests of one image against another;
- `noise.py`: how far a number may move before that means something;
- `intervals.py`: what few samples say of all: shares, quantiles, rank correlations.
"""
