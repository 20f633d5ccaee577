# SPDX-License-Identifier: BSD-3-Clause
"""Epipolar sampling with one-dimensional min/max trees: the peer of the two methods at the centre.

All rays of a slice see one line of the shadow map. A tree over that line tells a ray of long lit
and dark intervals; airlight is computed at samples of the slices and interpolated to the pixels.

Read in this order:

- `method.py`: the method, its parameters, and how its stages follow one another.
- `slices.py`: half planes about the line of camera and light.
- `min_max_tree.py`: the height map of a slice, and the tree over it.
- `walk.py`: the lit intervals of a ray, by long steps through the tree.
- `samples.py`: which samples of a slice are computed, and interpolation between them.
"""
