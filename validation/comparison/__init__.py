# SPDX-License-Identifier: BSD-3-Clause
"""Image files against each other.

Read in this order:

- `images.py`: compares two image files;
- `compare_text.py`: what `airlight compare` prints.
"""
