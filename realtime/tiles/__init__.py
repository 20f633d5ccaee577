# SPDX-License-Identifier: BSD-3-Clause
"""Images are divided into tiles of sixteen neighbouring rays, which draw lists of candidates; most are interpolated.

Read in this order:

- `layout.py`: how many rays a tile has, and how the rays of a view may lie in the image.
- `candidate_lists.py`: what the rays of a tile have to look at, and what happens where a list has no room.
- `adaptive_sampling.py`: what is computed at the corners of tiles, and interpolated between them where that is enough.
"""
