# SPDX-License-Identifier: BSD-3-Clause
"""The lit intervals of camera rays: what every method does with the boundaries of shadow that a ray crosses.

A method finds where a ray crosses boundaries of shadow: shadow planes, texels of a shadow map, leaves of a tree. Here
is what follows from it, once for all: crossings are put in order, an interval opens where the light comes back and is
closed where it ends, and closed intervals are integrated and added up.

Read in this order:

- `lit_intervals.py`: the state of a ray between boundaries, the sum, and a queue that puts boundaries in order.
"""
