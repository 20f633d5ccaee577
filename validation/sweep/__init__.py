# SPDX-License-Identifier: BSD-3-Clause
"""Sweeps: studies of many scenes, cell by cell, and the rows that come of them.

A *study* says which scenes, methods and sizes; a *cell* is one combination of them; a *row* is what came of a cell.

Read in this order:

- `row.py`: the columns of a row, their types and units: the one place;
- `study.py`: a study from its TOML file, and its cells;
- `sampled_truth.py`: the truth of some pixels under lights with extent;
- `truth.py`: the truth that the cells of an image share;
- `bounds.py`: the errors that methods state for themselves;
- `work.py`: a cell becomes a row;
- `keys.py`: what decides the numbers of a row, as a digest;
- `rows.py`: finished rows on disk, and their Parquet.
"""
