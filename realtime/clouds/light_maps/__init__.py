# SPDX-License-Identifier: BSD-3-Clause
"""A cloud as its sun sees it: both ends along the light and the normal of the lit side, filtered to any width.

Read in this order:

- `surfaces.py`: what rays along the light meet first and last;
- `pyramid.py`: premultiplied MIP levels of that, without holes, and how they are read.
"""
