# SPDX-License-Identifier: BSD-3-Clause
"""Two reports compared: what got slower or less accurate beyond the noise, what
is new and what is gone.

Read in this order:

- `times.py`: a finding; times, by the rules of `validation.statistics.noise`
- `compare.py`: errors, references, papers, and all of these together
- `engines.py`: reports on engines: which numbers moved, which verdicts turned
"""
