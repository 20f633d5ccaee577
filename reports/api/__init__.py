# SPDX-License-Identifier: BSD-3-Clause
"""The functions of `import airlight` and their results, for scripts and notebooks.

Read in this order:

- `inputs.py`: what the functions take, and the one exception
- `html.py`: pieces of HTML for notebooks
- `results.py`: images as results
- `comparison.py`: a comparison as a result
- `tables.py`: tables and reports as results
- `images.py`: `load_scene`, `render`, `compare`
- `reference.py`: `reference`
- `fit.py`: `fit`
- `studies.py`: `integrate`, `bench`
- `slab.py`: `slab`
- `report.py`: `report`
"""
