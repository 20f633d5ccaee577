# SPDX-License-Identifier: BSD-3-Clause
"""The page of a report: one HTML file that needs no network, with its images as data.

`templates/` holds the page, its style and its scripts.

Read in this order:

- `filters.py`: how numbers are written, sentences made of data, the tables
- `chart.py`: speed against error, as SVG
- `images.py`: images as data that the script of the page reads
- `render.py`: the page of all these
"""
