# SPDX-License-Identifier: BSD-3-Clause
"""Statistics: does an image with random errors agree with another, and what is noise?

Read in this order:

- `estimate.py`: a number with its error, and the questions that it answers with yes, no or unknown;
- `samples.py`: p-values, what to do with many of them, and intervals of shares,
  quantiles and rank correlations;
- `records.py`: what comparisons say, as rows and reports hold it;
- `comparison.py`: all tests of one image against another;
- `noise.py`: how far a number may move before that means something.
"""
