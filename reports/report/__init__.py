# SPDX-License-Identifier: BSD-3-Clause
"""Measures what a report asks for and writes it.

Read in this order:

- `asked.py`: the scenes and images that a report is asked for
- `staging.py`: a folder out of sight until it is whole
- `expected.py`: how long the parts will take
- `computed.py`: the results of a scene, data and files, as they are kept
- `scene.py`: one scene: truth, its checks, every method
- `papers.py`: what belongs to no scene: stability, growth
- `claims.py`: the experiments behind the claims of papers
- `measure.py`: all of these, report.json and the page
"""
