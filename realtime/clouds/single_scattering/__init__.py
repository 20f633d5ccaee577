# SPDX-License-Identifier: BSD-3-Clause
"""Light that was scattered once in clouds, and how opaque they are: what all methods for clouds share.

Read in this order:

- `opacity.py`: the transmittance of a ray, as derived and as printed;
- `spacing.py`: nodes along a ray, exponentially spaced in optical depth;
- `march.py`: the sum over the steps between nodes, with the legs of the light linear on each;
- `behind.py`: the light that surfaces get through clouds, and the sky.
"""
