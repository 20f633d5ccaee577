# SPDX-License-Identifier: BSD-3-Clause
"""Work on several processes or machines, by Dask.

Read in this order:

- `connect.py`: processes of this machine, or a scheduler with workers of our version;
- `run.py`: groups of tasks as futures, what a worker does of one, and one
  rule for processes that die;
- `cells.py`: the cells of a sweep as tasks;
- `references.py`: references and batches for the cache of this machine.
"""
