# SPDX-License-Identifier: BSD-3-Clause
"""Work on several processes or machines, by Dask.

Read in this order:

- `worker.py`: what runs in a worker: one task at a time, within its time;
- `connect.py`: processes of this machine, or a scheduler with workers of our version;
- `run.py`: every task ends in one outcome, whatever happens to workers and scheduler;
- `cells.py`: the cells of a sweep as tasks;
- `references.py`: truths and batches for the cache of this machine.
"""
