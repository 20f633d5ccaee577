# SPDX-License-Identifier: BSD-3-Clause
"""What a method costs as its work grows: pixels, triangles, lights, bounded media, texels of its map.

Read in this order:

- `ladders.py`: a scene with less and more of one kind of work;
- `subdivision.py`: its meshes with four times the triangles, and bumps that these resolve;
- `study.py`: the times of every step, the exponent that fits them, and where they jump.
"""
