# SPDX-License-Identifier: BSD-3-Clause
"""What `airlight bench` prints: a file for each of its questions.

Read in this order:

- `methods.py`: methods timed in scenes and compared with the truth
- `decompose.py`: the error of every method by its causes
- `kernels.py`: kernels alone
- `estimators.py`: Monte Carlo estimators at equal error
- `scaling.py`: what methods cost as their work grows
"""
