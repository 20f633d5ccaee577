# SPDX-License-Identifier: BSD-3-Clause
"""Figures for papers that are no study's: of a report, and the papers' own pictures again.

Read in this order:

- `report.py`: time against error, images with insets, a LaTeX table, from report.json
- `papers.py`: the pictures of the papers in our scenes
"""
