# SPDX-License-Identifier: BSD-3-Clause
"""Writes what a study of scenes measures as a report.

Read in this order:

- `scene.py`: the record of a scene, and its files
- `others.py`: what belongs to no scene: stability, growth, claims of papers
- `claims.py`: the sentences at the top, from the numbers, and what user methods did wrong
- `staged.py`: a folder out of sight until it is whole
- `measure.py`: all of these, report.json and the page
"""
