# SPDX-License-Identifier: BSD-3-Clause
"""Two reports compared: what got slower or less accurate beyond the noise, what is new and what is gone.

Read in this order:

- `finding.py`: one thing that differs
- `errors.py`: errors, scene by scene and method by method
- `times.py`: times, by the rules of `validation.statistics.noise`
- `truth_and_claims.py`: truth, claims, broken kernels, missed faults, the fastest methods
- `papers.py`: verdicts on the claims of papers
- `compare.py`: all of these together, and how a report is read
- `table.py`: what `airlight diff` prints
"""
