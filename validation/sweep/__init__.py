# SPDX-License-Identifier: BSD-3-Clause
"""Sweeps: studies of many scenes, cell by cell, and the rows that come of them.

A *study* says which scenes, methods and sizes; a *cell* is one combination of them; a *row* is what came of a cell.

Read in this order:

- `row.py`: the columns of a row, their types and units: the one place.

May import: `analytic.errors`.
"""
