# SPDX-License-Identifier: BSD-3-Clause
"""Figures and tables for papers: `compute` writes data, `draw` and `tabular` only read them.

Read in this order:

- `files.py`: the files of a figure
- `picture_grid.py`: pictures from EXR files
- `report.py`: what figures read of a report
- `cloud_images.py`: clouds beside light paths
- `cloud_transport.py`: light of a slab by direction
- `convergence.py`: the order of the estimators
- `decomposition.py`: errors by cause
- `frame_speed.py`: time of frames against error
- `kernel_errors.py`: errors of kernels over depth and angle
- `kernel_speed.py`: time of kernels against error
- `map_size.py`: error over the size of the shadow map
- `methods_table.py`: times and errors of methods
- `shafts_strip.py`: Fig. 5.8 of Ali 2016 in our scene
- `paper_images.py`: the pictures of the papers in our scenes
- `phase_functions.py`: phase functions of droplets and what stands in for them
- `polynomials.py`: Biri's polynomials
- `published.py`: numbers of the papers beside ours
- `slab_orders.py`: a slab by order of scattering
- `scaling.py`: time of a frame over its work
- `strip.py`: images with insets and errors
- `z_distribution.py`: standardised errors of the estimators
"""
