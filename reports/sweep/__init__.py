# SPDX-License-Identifier: BSD-3-Clause
"""The results of a sweep, from its Parquet alone: claims with their intervals, figures, a page.

Read in this order:

- `samples.py`: the Parquet by columns, one sample a scene for each configuration
- `claims.py`: fractions of scenes within an error, which property of a scene
  goes with it, with intervals
- `faults.py`: refusals, what is wrong whatever the error, the worst scenes
- `summary.py`: all of these, worked out once
- `tables.py`: tables of them
- `page.py`: the page, its figures, and all files
"""
